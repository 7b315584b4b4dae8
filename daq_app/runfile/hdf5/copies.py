"""What a run file without a seal says twice must agree: the only proof of its texts and tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

import h5py
import numpy as np

from daq_app.runfile import layout
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.hdf5.channels import describe_channels
from daq_app.runfile.hdf5.read import Run
from daq_app.runfile.hdf5.safe import checked_dataset, damage_told, read_column, read_text
from daq_app.runfile.model import to_json
from daq_app.runfile.source import RunScaling

_WINDOW = 2**18


def copy_problems(run: Run) -> list[str]:
    """Contradictions between header, attributes, texts, times and the channel table; never raises."""
    problems = []
    for check in (_texts, _attributes, _times, _tables, _channels):
        try:
            with damage_told(run.path, "a text or table"):
                names = list(check(run))
        except RunFileError as error:
            problems.append(error.message)
            continue
        if names:
            shown = ", ".join(names[:5]) + (" …" if len(names) > 5 else "")
            problems.append(f"what it says of itself contradicts its header: {shown}")
    return problems


def _texts(run: Run) -> Iterator[str]:
    file, header = run.hdf5, run.header
    if read_text(run.path, file, layout.RIG_TOML) != header.rig_text:
        yield layout.RIG_TOML
    plan = json.loads(to_json(header.plan))
    if json.loads(read_text(run.path, file, layout.PLAN_JSON)) != plan:
        yield layout.PLAN_JSON
    if header.truth is not None:
        truth = json.loads(to_json(header.truth))
        if json.loads(read_text(run.path, file, layout.TRUTH_JSON)) != truth:
            yield layout.TRUTH_JSON


def _attributes(run: Run) -> Iterator[str]:
    header, attributes = run.header, run.hdf5.attrs
    for name in ("test", "specimen", "rig_name", "host", "start_utc_ns"):
        if name in attributes and not _same(attributes[name], getattr(header, name)):
            yield name
    if "title" in attributes and not str(attributes["title"]).endswith(header.test or header.run_id):
        yield "title"


def _times(run: Run) -> Iterator[str]:
    for name in (layout.RAW, layout.SI):
        time = checked_dataset(run.path, run.hdf5[name], layout.TIME, itemsize=8, length=run.n_samples)
        for start in range(0, run.n_samples, _WINDOW):
            stop = min(start + _WINDOW, run.n_samples)
            if not np.array_equal(time[start:stop], run.time_s(start, stop)):
                yield f"{name}/{layout.TIME}"
                break


def _tables(run: Run) -> Iterator[str]:
    columns: tuple[tuple[str, str, Callable[[], list[float]]], ...] = (
        (layout.EVENTS, "time", lambda: [event.sample / run.rate_hz for event in run.events]),
        (layout.GAPS, "time", lambda: [gap.first_sample / run.rate_hz for gap in run.gaps]),
        (layout.GAPS, "duration", lambda: [gap.n_samples / run.rate_hz for gap in run.gaps]),
    )
    for group, name, expected in columns:
        stored = read_column(run.path, run.hdf5[group], name)
        if not np.array_equal(stored, expected()):
            yield f"{group}/{name}"


def _channels(run: Run) -> Iterator[str]:
    """The writer's own description of the channels, made anew from header and rig, beside the stored one."""
    with h5py.File("expected", "w", driver="core", backing_store=False) as expected:
        for name in (layout.RAW, layout.SI):
            for channel_id in run.channel_ids:
                expected.create_dataset(f"{name}/{channel_id}", data=0.0)
        describe_channels(expected, run.header, RunScaling.of(run.header, run.rig))
        for name in (layout.RAW, layout.SI):
            for channel_id in run.channel_ids:
                wanted = expected[name][channel_id].attrs
                stored = run.hdf5[name][channel_id].attrs if channel_id in run.hdf5[name] else {}
                for key in wanted:
                    if key in stored and not _same(stored[key], wanted[key]):
                        yield f"{name}/{channel_id} {key}"
        table = expected[layout.CHANNELS]
        for name in table:
            if name not in run.hdf5[layout.CHANNELS]:
                continue
            found = read_column(run.path, run.hdf5[layout.CHANNELS], name)
            if not _same(found, read_column(run.path, table, name)):
                yield f"{layout.CHANNELS}/{name}"


def _same(stored: Any, wanted: Any) -> bool:
    try:
        return bool(np.array_equal(stored, wanted, equal_nan=True))
    except TypeError:  # texts know no NaN
        return bool(np.array_equal(stored, wanted))
