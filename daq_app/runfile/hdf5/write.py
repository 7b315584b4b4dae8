"""Writes a run as HDF5 that any HDF5 or netCDF4 program reads (docs/reference/run-format.md)."""

from __future__ import annotations

import datetime as dt
import hashlib
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from daq_app.runfile import layout
from daq_app.runfile.hdf5.channels import describe_channels
from daq_app.runfile.hdf5.chunks import ChunkWriter, chunk_samples, chunk_writer, create_chunked
from daq_app.runfile.hdf5.guarded_file import guarded_hdf5
from daq_app.runfile.model import RUN_FORMAT, RUN_FORMAT_VERSION, DerivedData, Event, Gap, to_json
from daq_app.runfile.seal.format import seal_bytes_for, write_seal
from daq_app.runfile.seal.signing import sign
from daq_app.runfile.source import Provenance, RunScaling, RunSource, rig_of

_TEXT = h5py.string_dtype("utf-8")
_MAX_ATTRIBUTE_CHARACTERS = 8000
_STORED_BYTES = 8 + 4
"""A reading and its engineering unit, before they are compressed."""


def write_run(
    path: Path, source: RunSource, provenance: Provenance, derived: DerivedData | None = None
) -> None:
    """Write the whole run to `path`, replacing it. Memory stays within some tens of megabytes.

    Raises `OSError` if the disk is full or fails.

    The caller gives a temporary name and checks the file (`compare_run`) before it gets its own.
    """
    header = source.header
    scaling = RunScaling.of(header, rig_of(header))
    # Version 1.8 of the file format: every HDF5 library since 2008 reads it.
    with (
        guarded_hdf5(path, libver=("v108", "v108")) as (file, guarded),
        chunk_writer(guarded.raise_failure) as writer,
    ):
        offset, seal_bytes = _reserve_seal(file, header.n_channels * source.n_samples)
        _write_texts(file, source)
        digest = _write_samples(file, source, scaling, writer)
        describe_channels(file, header, scaling)
        _write_events(file, source.events, header.rate_hz)
        _write_gaps(file, source.gaps, header.rate_hz)
        if derived is not None:
            _write_derived(file, derived, header.rate_hz, writer)
        _write_root(file, source, provenance, digest)
    write_seal(path, offset, seal_bytes, sign)


def _reserve_seal(file: h5py.File, n_readings: int) -> tuple[int, int]:
    """(first byte, number of bytes) of the seal: it is written first, so it lies near the file's start."""
    seal_bytes = seal_bytes_for(n_readings * _STORED_BYTES)
    kind = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    kind.set_layout(h5py.h5d.CONTIGUOUS)
    kind.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    kind.set_obj_track_times(False)
    group = file.create_group(layout.INTEGRITY)
    space = h5py.h5s.create_simple((seal_bytes,))
    seal = h5py.h5d.create(group.id, layout.SEAL.encode(), h5py.h5t.STD_U8LE, space, kind)
    h5py.Dataset(seal).attrs["long_name"] = "SHA-256 of every block of this file: docs/run-format.md"
    return seal.get_offset(), seal_bytes


def _write_root(file: h5py.File, source: RunSource, provenance: Provenance, digest: str) -> None:
    header = source.header
    started = dt.datetime.fromtimestamp(header.start_utc_ns / 1e9, dt.UTC)
    values: dict[str, Any] = {
        "format": RUN_FORMAT,
        "format_version": RUN_FORMAT_VERSION,
        "Conventions": layout.CONVENTIONS,
        "title": f"Free-rocking test {header.test or header.run_id}",
        "run_id": header.run_id,
        "test": header.test,
        "specimen": header.specimen,
        "rig_name": header.rig_name,
        "rate_hz": header.rate_hz,
        "first_sample": np.int64(source.first_sample),
        "n_samples": np.int64(source.n_samples),
        "start_utc": started.isoformat(timespec="microseconds"),
        "start_utc_ns": np.int64(header.start_utc_ns),
        "host": header.host,
        "versions": to_json(header.versions)[:_MAX_ATTRIBUTE_CHARACTERS],
        "raw_sha256": digest,
        "lost_samples": np.int64(sum(gap.n_samples for gap in source.gaps)),
        "closed_in_good_order": np.int8(provenance.closed),
        "damage": "\n".join(provenance.damage)[:_MAX_ATTRIBUTE_CHARACTERS],
        "source_name": provenance.source_name,
        "source_bytes": np.int64(provenance.source_bytes),
    }
    for name, value in values.items():
        file.attrs[name] = value


def _write_texts(file: h5py.File, source: RunSource) -> None:
    header = source.header
    texts = {
        layout.HEADER_JSON: (header.model_dump_json(), "everything known before the first sample, JSON"),
        layout.RIG_TOML: (header.rig_text, "the rig file, letter by letter"),
        layout.PLAN_JSON: (to_json(header.plan), "the NI task plan, JSON"),
    }
    if header.truth is not None:
        texts[layout.TRUTH_JSON] = (to_json(header.truth), "what this simulated run was made from, JSON")
    for name, (text, long_name) in texts.items():
        file.create_dataset(name, data=text, dtype=_TEXT).attrs["long_name"] = long_name


def _write_samples(file: h5py.File, source: RunSource, scaling: RunScaling, writer: ChunkWriter) -> str:
    """Groups raw and si; returns the SHA-256 over all channels."""
    header, n_samples = source.header, source.n_samples
    chunk = chunk_samples(header.n_channels, n_samples)
    raw_group = file.create_group(layout.RAW, track_order=True)
    si_group = file.create_group(layout.SI, track_order=True)
    raw_time = _create_time(raw_group, n_samples, chunk)
    si_time = _create_time(si_group, n_samples, chunk)
    raw = []
    for channel_id, unit in zip(header.channel_ids, header.reading_units, strict=True):
        dataset = _create_signal(raw_group, channel_id, raw_time, chunk, "<f8", unit)
        dataset.attrs["long_name"] = f"reading of {channel_id}"
        raw.append(dataset)
    si = []
    for channel in scaling.channels.values():
        dataset = _create_signal(si_group, channel.id, si_time, chunk, "<f4", channel.si_unit)
        si.append(dataset)
    digests = [hashlib.sha256() for _ in raw]
    checks: list[list[int]] = [[] for _ in raw]
    for first, window in source.windows(chunk):
        start = first - source.first_sample
        time_s = (first + np.arange(window.shape[1])) / header.rate_hz
        writer.put(raw_time, si_time, start=start, values=time_s)
        si_window = scaling.stored_si(window)
        for row, dataset in enumerate(raw):
            writer.put(dataset, start=start, values=window[row])
            digests[row].update(window[row].data)
            checks[row].append(zlib.crc32(window[row].data))
        for row, dataset in enumerate(si):
            writer.put(dataset, start=start, values=si_window[row])
        writer.end_window()
    writer.flush()
    hashes = [digest.hexdigest() for digest in digests]
    for dataset, value in zip(raw, hashes, strict=True):
        dataset.attrs["sha256"] = value
    _write_checks(file, header.channel_ids, checks)
    return combined_sha256(hashes)


def _write_checks(file: h5py.File, channel_ids: Sequence[str], checks: list[list[int]]) -> None:
    """CRC-32 of each chunk's readings, so that every read proves that it got the right chunk.

    The index of chunks in this version of HDF5 has no checksum of its own: one flipped bit there
    would hand out a sound chunk at the wrong place.
    """
    group = file.create_group(layout.CHECKS, track_order=True)
    index = group.create_dataset("chunk", data=np.arange(len(checks[0]), dtype=np.int64))
    index.make_scale("chunk")
    for channel_id, values in zip(channel_ids, checks, strict=True):
        dataset = group.create_dataset(channel_id, data=np.array(values, dtype=np.uint32))
        dataset.dims[0].attach_scale(index)
        dataset.attrs["long_name"] = f"CRC-32 of each chunk of raw/{channel_id}, float64 little-endian"


def combined_sha256(channel_hashes: Sequence[str]) -> str:
    """Hash of a whole run: SHA-256 of the channels' hex digests, joined by newlines, in channel order."""
    return hashlib.sha256("\n".join(channel_hashes).encode()).hexdigest()


def _create_time(group: h5py.Group, n_samples: int, chunk: int) -> h5py.Dataset:
    time = create_chunked(group, layout.TIME, n_samples, chunk, "<f8")
    time.make_scale(layout.TIME)
    time.attrs["units"] = "s"
    time.attrs["long_name"] = "sample index / rate; add a channel's time_offset_s for its exact instant"
    return time


def _create_signal(
    group: h5py.Group, name: str, time: h5py.Dataset, chunk: int, dtype: str, unit: str
) -> h5py.Dataset:
    dataset = create_chunked(group, name, time.shape[0], chunk, dtype)
    dataset.dims[0].attach_scale(time)
    dataset.attrs["units"] = unit
    return dataset


def _write_events(file: h5py.File, events: Sequence[Event], rate_hz: float) -> None:
    group = file.create_group(layout.EVENTS)
    samples = np.array([event.sample for event in events], dtype=np.int64)
    _write_table(
        group,
        "event",
        {
            "sample": (samples, "1"),
            "time": (samples / rate_hz, "s"),
            "kind": ([event.kind for event in events], ""),
            "text": ([event.text for event in events], ""),
            "data": ([to_json(event.data) for event in events], ""),
        },
    )


def _write_gaps(file: h5py.File, gaps: Sequence[Gap], rate_hz: float) -> None:
    group = file.create_group(layout.GAPS)
    first = np.array([gap.first_sample for gap in gaps], dtype=np.int64)
    count = np.array([gap.n_samples for gap in gaps], dtype=np.int64)
    _write_table(
        group,
        "gap",
        {
            "first_sample": (first, "1"),
            "n_samples": (count, "1"),
            "time": (first / rate_hz, "s"),
            "duration": (count / rate_hz, "s"),
            "reason": ([gap.reason for gap in gaps], ""),
        },
    )


def _write_table(group: h5py.Group, dimension: str, columns: dict[str, tuple[Any, str]]) -> None:
    length = len(next(iter(columns.values()))[0])
    index = group.create_dataset(dimension, data=np.arange(length, dtype=np.int64))
    index.make_scale(dimension)
    for name, (values, unit) in columns.items():
        if isinstance(values, list):
            dataset = group.create_dataset(name, data=np.array(values, dtype=object), dtype=_TEXT)
        else:
            dataset = group.create_dataset(name, data=values)
        if unit:
            dataset.attrs["units"] = unit
        dataset.dims[0].attach_scale(index)


def _write_derived(file: h5py.File, derived: DerivedData, rate_hz: float, writer: ChunkWriter) -> None:
    group = file.create_group(layout.DERIVED, track_order=True)
    lengths = {signal.values.size for signal in derived.signals.values()}
    if len(lengths) > 1:
        raise ValueError("derived signals of one run must have one length")
    group.attrs["first_sample"] = np.int64(derived.first_sample)
    group.attrs["step"] = np.int64(derived.step)
    group.create_dataset(layout.RESULTS_JSON, data=to_json(derived.results), dtype=_TEXT)
    if not lengths:
        return
    n_samples = lengths.pop()
    chunk = chunk_samples(1, n_samples)
    time = _create_time(group, n_samples, chunk)
    datasets = {}
    for name, signal in derived.signals.items():
        datasets[name] = _create_signal(group, name, time, chunk, "<f8", signal.unit)
        datasets[name].attrs["long_name"] = signal.long_name
    for start in range(0, n_samples, chunk):
        stop = min(start + chunk, n_samples)
        instants = (derived.first_sample + np.arange(start, stop) * derived.step) / rate_hz
        writer.put(time, start=start, values=instants)
        for name, signal in derived.signals.items():
            values = np.asarray(signal.values[start:stop], dtype="<f8")
            writer.put(datasets[name], start=start, values=values)
        writer.end_window()
    writer.flush()
