"""Opens a run file and hands out its readings; nothing is believed before it is checked."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Annotated, Any, Final, Literal, Self

import h5py
import numpy as np
import psutil
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from daq_app.config import Rig
from daq_app.runfile import layout
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.hdf5.safe import checked_dataset, damage_told, open_hdf5, read_column, read_text
from daq_app.runfile.model import MAX_SAMPLES, RUN_FORMAT, DerivedData, DerivedSignal, Event, Gap, RunHeader
from daq_app.runfile.seal.format import Seal
from daq_app.runfile.source import RunScaling, rig_of

_SMALL_BYTES: Final = 2**28


class RunAttributes(BaseModel):
    """Attributes at the top of a run file; the model that a run must satisfy."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    format: Literal["rocking-run"]
    format_version: Literal[1, 2]
    run_id: str
    rate_hz: Annotated[float, Field(gt=0, le=1e7)]
    first_sample: Annotated[int, Field(ge=-(2**62), le=2**62)]
    n_samples: Annotated[int, Field(ge=1, le=MAX_SAMPLES)]
    start_utc_ns: int
    raw_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    lost_samples: Annotated[int, Field(ge=0)]
    closed_in_good_order: bool
    damage: str
    source_name: str
    source_bytes: Annotated[int, Field(ge=0)]


class Run:
    """A run file opened for reading. Columns count from 0 at `first_sample`; times and events are absolute.

    Not for use by several threads at once. Use as a context manager.
    """

    def __init__(self, path: Path, *, just_written: bool = False, just_proven: bool = False) -> None:
        self.path = path
        self._opened = open_hdf5(path, just_written=just_written, just_proven=just_proven)
        self._file = self._opened.file
        try:
            with damage_told(path, "the structure of the file"):
                self.attributes = self._read_attributes()
                self._require_seal()
                self.header = self._read_header()
                self.rig: Rig | None = rig_of(self.header)
                """The rig of the run; None if the file holds none that this version understands."""
                self._raw = self._channels()
                self._group(layout.CHECKS)
                self._checks: dict[str, list[int]] = {}
                self.events = self._read_events()
                self.gaps = self._read_gaps()
        except BaseException:
            self._opened.close()
            raise

    @property
    def hdf5(self) -> h5py.File:
        """The opened file itself, for checks that compare its parts."""
        return self._file

    @property
    def seal(self) -> Seal | None:
        """What proves the bytes of the file; None for a run of format version 1."""
        return self._opened.seal

    @property
    def rate_hz(self) -> float:
        return self.header.rate_hz

    @property
    def n_samples(self) -> int:
        return self.attributes.n_samples

    @property
    def first_sample(self) -> int:
        """Absolute sample index of column 0."""
        return self.attributes.first_sample

    @property
    def channel_ids(self) -> tuple[str, ...]:
        return self.header.channel_ids

    def readings(
        self, ids: Sequence[str] | None = None, start: int = 0, stop: int | None = None
    ) -> NDArray[np.float64]:
        """What the NI channels returned: (len(ids), stop − start), unit `header.reading_units`, NaN in gaps.

        `start` and `stop` are columns, cut to the run. Raises `KeyError` for an unknown channel and
        `RunFileError` where the file is damaged.
        """
        ids = self.channel_ids if ids is None else ids
        low, high, _ = slice(start, stop).indices(self.n_samples)
        self._require_memory(8 * len(ids) * max(0, high - low))
        out = np.empty((len(ids), max(0, high - low)))
        unknown = [channel_id for channel_id in ids if channel_id not in self._raw]
        if unknown:
            raise KeyError(f"{self.path} has no channel {', '.join(unknown)}")
        if low < high:
            for row, channel_id in enumerate(ids):
                where = f"between samples {self.first_sample + low} and {self.first_sample + high}"
                with damage_told(self.path, f"channel {channel_id} {where}"):
                    self._read_proven(channel_id, low, high, out[row])
        return out

    def _read_proven(self, channel_id: str, low: int, high: int, out: NDArray[np.float64]) -> None:
        """Fill `out` with columns low … high, reading whole chunks and proving each by its CRC."""
        dataset = self._raw[channel_id]
        checks = self._checks_of(channel_id)
        chunk = dataset.chunks[0]
        for index in range(low // chunk, (high - 1) // chunk + 1):
            first = index * chunk
            values = dataset[first : first + chunk].astype("<f8", copy=False)
            if zlib.crc32(values.data) != checks[index]:
                raise ValueError("the CRC of a chunk is wrong")
            inside = slice(max(low, first), min(high, first + chunk))
            out[inside.start - low : inside.stop - low] = values[inside.start - first : inside.stop - first]

    def si(
        self, ids: Sequence[str] | None = None, start: int = 0, stop: int | None = None
    ) -> NDArray[np.float64]:
        """Engineering units: offset and tare taken off, SI; like `readings`, computed in double precision.

        Raises `RunFileError` for a channel that the run's rig does not describe.
        """
        ids = self.channel_ids if ids is None else tuple(ids)
        scaling = RunScaling.of(self.header.model_copy(update={"channel_ids": tuple(ids)}), self.rig)
        if len(scaling.rows) != len(ids):
            unknown = [channel_id for channel_id in ids if channel_id not in scaling.channels]
            raise RunFileError(f"{self.path}: its rig does not say how to scale {', '.join(unknown)}")
        values = self.readings(ids, start, stop)
        return scaling.to_si(values, out=values)

    def time_s(self, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Times of columns: absolute sample index / rate."""
        low, high, _ = slice(start, stop).indices(self.n_samples)
        return np.asarray((self.first_sample + np.arange(low, high)) / self.rate_hz)

    @property
    def derived(self) -> DerivedData | None:
        """Signals that were computed when the run was saved, or None."""
        with damage_told(self.path, "the group of derived signals"):
            return self._read_derived() if layout.DERIVED in self._file else None

    @property
    def results(self) -> dict[str, Any]:
        """The results of `derived` alone, without its signals; empty where there are none."""
        with damage_told(self.path, "the results of the run"):
            if layout.DERIVED not in self._file:
                return {}
            return self._json(self._group(layout.DERIVED), layout.RESULTS_JSON)

    def _require_memory(self, n_bytes: int) -> None:
        if n_bytes > _SMALL_BYTES and n_bytes > 0.75 * psutil.virtual_memory().available:
            raise RunFileError(
                f"{self.path}: {n_bytes / 1e9:.1f} GB do not fit into memory",
                advice="Read it in parts: start, stop.",
            )

    def _read_derived(self) -> DerivedData:
        group = self._group(layout.DERIVED)
        results = self._json(group, layout.RESULTS_JSON)
        signals: dict[str, DerivedSignal] = {}
        for name in group:
            if name in (layout.TIME, layout.RESULTS_JSON):
                continue
            dataset = checked_dataset(self.path, group, name, itemsize=8)
            self._require_memory(8 * dataset.size * (len(signals) + 1))
            signals[name] = DerivedSignal(
                dataset[()].astype(np.float64),
                str(dataset.attrs.get("units", "")),
                str(dataset.attrs.get("long_name", "")),
            )
        return DerivedData(
            int(group.attrs.get("first_sample", self.first_sample)),
            signals,
            int(group.attrs.get("step", 1)),
            results,
        )

    def stored_si(self, channel_id: str, start: int, stop: int) -> NDArray[np.float32] | None:
        """The engineering units as stored for other programs (float32); None if not there."""
        with damage_told(self.path, f"engineering units of {channel_id}"):
            group = self._group(layout.SI)
            if channel_id not in group:
                return None
            dataset = checked_dataset(self.path, group, channel_id, itemsize=4, length=self.n_samples)
            return np.asarray(dataset[start:stop], dtype=np.float32)

    def stored_sha256(self, channel_id: str) -> str:
        """SHA-256 of a channel's readings as stored beside them."""
        with damage_told(self.path, f"the hash of {channel_id}"):
            return str(self._raw[channel_id].attrs.get("sha256", ""))

    def close(self) -> None:
        """Close the file; safe twice."""
        self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _read_attributes(self) -> RunAttributes:
        if self._file.attrs.get("format", "") != RUN_FORMAT:
            raise RunFileError(
                f"{self.path} is an HDF5 file but no run of this program",
                advice="Foreign recordings come in through `daq-app import`.",
            )
        attributes: dict[str, Any] = {}
        for name in RunAttributes.model_fields:
            if name in self._file.attrs:
                value = self._file.attrs[name]
                attributes[name] = value.item() if isinstance(value, np.generic) else value
        try:
            return RunAttributes.model_validate(attributes)
        except ValidationError as error:
            first = error.errors()[0]
            raise RunFileError(
                f"{self.path}: attribute {'.'.join(map(str, first['loc']))}: {first['msg']}"
            ) from error

    def _require_seal(self) -> None:
        if (self.seal is None) != (self.attributes.format_version == 1):
            raise RunFileError(
                f"{self.path}: its seal is missing or does not belong to it: nothing in it is proven",
                advice="If its journal is still there, `daq-app recover` makes the run anew.",
            )

    def _read_header(self) -> RunHeader:
        try:
            header = RunHeader.model_validate_json(read_text(self.path, self._file, layout.HEADER_JSON))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise RunFileError(f"{self.path}: header: {where}: {first['msg']}") from error
        if header.run_id != self.attributes.run_id or header.rate_hz != self.attributes.rate_hz:
            raise RunFileError(f"{self.path}: its header and its attributes contradict each other")
        return header

    def _group(self, name: str) -> h5py.Group:
        link = self._file.get(name, getlink=True)
        if link is not None and not isinstance(link, h5py.HardLink):
            raise RunFileError(f"{self.path}: /{name} is a link to somewhere else, which a run never holds")
        group = self._file[name] if link is not None else None
        if not isinstance(group, h5py.Group):
            raise RunFileError(f"{self.path}: group {name} is missing")
        return group

    def _channels(self) -> dict[str, h5py.Dataset]:
        group = self._group(layout.RAW)
        datasets = {
            channel_id: checked_dataset(self.path, group, channel_id, itemsize=8, length=self.n_samples)
            for channel_id in self.header.channel_ids
        }
        if any(dataset.chunks is None for dataset in datasets.values()):
            raise RunFileError(f"{self.path}: its readings are not stored in chunks")
        return datasets

    def _checks_of(self, channel_id: str) -> list[int]:
        """The CRC of each chunk of a channel, read with its readings: often only the header is asked for."""
        if channel_id not in self._checks:
            checks = read_column(self.path, self._group(layout.CHECKS), channel_id)
            if len(checks) != -(-self.n_samples // self._raw[channel_id].chunks[0]):
                raise RunFileError(f"{self.path}: the table of checks of {channel_id} is not complete")
            self._checks[channel_id] = checks
        return self._checks[channel_id]

    def _json(self, group: h5py.Group, name: str) -> dict[str, Any]:
        try:
            content = json.loads(read_text(self.path, group, name))
        except (ValueError, RecursionError) as error:
            raise RunFileError(f"{self.path}: {name} is not valid JSON") from error
        return content if isinstance(content, dict) else {}

    def _read_events(self) -> tuple[Event, ...]:
        group = self._group(layout.EVENTS)
        samples = read_column(self.path, group, "sample")
        columns = [read_column(self.path, group, name) for name in ("kind", "text", "data")]
        if any(len(column) != len(samples) for column in columns):
            raise RunFileError(f"{self.path}: the table of events is not rectangular")
        events = []
        for sample, kind, text, data in zip(samples, *columns, strict=True):
            try:
                content = dict(json.loads(data))
            except (ValueError, TypeError, RecursionError) as error:
                raise RunFileError(f"{self.path}: the data of an event is not valid JSON") from error
            events.append(Event(str(kind), int(sample), str(text), content))
        return tuple(events)

    def _read_gaps(self) -> tuple[Gap, ...]:
        group = self._group(layout.GAPS)
        first = read_column(self.path, group, "first_sample")
        count = read_column(self.path, group, "n_samples")
        reason = read_column(self.path, group, "reason")
        if not len(first) == len(count) == len(reason):
            raise RunFileError(f"{self.path}: the table of gaps is not rectangular")
        return tuple(Gap(int(a), int(n), str(why)) for a, n, why in zip(first, count, reason, strict=True))


_ADVICE_NAME: Final = "Give the run file itself, for instance runs/FR1-L3-2.h5."


def open_run(path: Path | str, *, just_written: bool = False, just_proven: bool = False) -> Run:
    """Open a run file. Raises `RunFileError` if it is missing, cut short, foreign or inconsistent.

    A run that this machine did not seal is walked through by a child process first, unless the caller
    has `just_written` it.  Its bytes are proven as they are read, unless the caller
    has `just_proven` them all.
    """
    path = Path(path)
    if path.is_dir():
        raise RunFileError(f"{path} is a folder", advice=_ADVICE_NAME)
    return Run(path, just_written=just_written, just_proven=just_proven)
