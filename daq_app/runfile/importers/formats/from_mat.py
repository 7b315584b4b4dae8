"""MATLAB files: every vector of numbers is a channel; version 5, and 7.3 as the HDF5 it is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.hdf5.safe import damage_told, open_hdf5
from daq_app.runfile.importers.formats.mat5 import Mat5File, Variable
from daq_app.runfile.importers.formats.own_export import start_in_json
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Reader, Spool

_TIMES: Final = ("t", "time", "time_s")
_RATES: Final = ("fs", "Fs", "rate_hz", "sampling_rate")
_MAX_RATIO: Final = 1100


def open_mat(path: Path, source: SourceMap) -> Reader:
    """The reader for the version of the file at hand."""
    try:
        with path.open("rb") as file:
            head = file.read(128)
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})", advice="Check the name.") from error
    return Mat73Reader(path, source) if b"MATLAB 7.3" in head else Mat5Reader(path, source)


class Mat5Reader:
    """See `Reader`. Variables are read in pieces."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        self._path = path
        self.findings = Findings()
        self._file = Mat5File(path)
        try:
            known = self._file.variables
            self._vectors = {
                name: variable.size
                for name, variable in known.items()
                if variable.is_real and sum(length != 1 for length in variable.shape) == 1
            }
            rates: dict[str, Any] = {
                name: next(iter(self._file.numbers(known[name])))
                for name in _RATES
                if name in known and known[name].is_real and known[name].size == 1
            }
            units = self._units(known.get("channels_json"))
            told = known.get("run_json")
            start = start_in_json(self._file.text(told)) if told and told.is_text else None
            self.channels = _described(self._vectors, units, _increment(rates), start)
            _require_column(path, source, self._vectors)
        except BaseException:
            self._file.close()
            raise
        self.time_channel = _time(self._vectors, source)
        self.time_hint: str | None = None

    def copy(self, spool: Spool) -> None:
        for name in spool.names:
            for piece in self._file.numbers(self._file.variables[name]):
                spool.append(name, piece)

    def close(self) -> None:
        self._file.close()

    def _units(self, text: Variable | None) -> dict[str, str]:
        """Units as this program's own export keeps them."""
        if text is None or not text.is_text:
            return {}
        try:
            return {str(row["variable"]): str(row["unit"]) for row in json.loads(self._file.text(text))}
        except (ValueError, TypeError, KeyError, RecursionError):
            self.findings.doubts.append("channels_json cannot be read: units were not taken from it")
            return {}


class Mat73Reader:
    """See `Reader`. Only plain vectors at the top of the file are channels."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        self._path = path
        self.findings = Findings()
        self._opened = open_hdf5(path)
        self._file = self._opened.file
        try:
            with damage_told(path, "the structure of the file"):
                self._vectors = {
                    str(name): int(item.size)
                    for name, item in self._file.items()
                    if isinstance(item, h5py.Dataset) and self._is_plain(str(name), item)
                }
                rates = {name: self._file[name][()] for name in _RATES if self._is_scalar(name)}
        except BaseException:
            self._opened.close()
            raise
        self.channels = _described(self._vectors, {}, _increment(rates))
        self.time_channel = _time(self._vectors, source)
        self.time_hint: str | None = None
        _require_column(path, source, self._vectors)

    def copy(self, spool: Spool) -> None:
        for name in spool.names:
            with damage_told(self._path, f"variable {name}"):
                dataset = self._file[name]
                rows, columns = dataset.shape
                for start in range(0, max(rows, columns), 2**17):
                    stop = start + 2**17
                    part = dataset[0, start:stop] if rows == 1 else dataset[start:stop, 0]
                    spool.append(name, np.asarray(part, dtype=np.float64))

    def close(self) -> None:
        self._opened.close()

    def _is_plain(self, name: str, dataset: h5py.Dataset) -> bool:
        """A real vector whose bytes are in this file."""
        creation = dataset.id.get_create_plist()
        return (
            isinstance(self._file.get(name, getlink=True), h5py.HardLink)
            and dataset.dtype.kind in "iuf"
            and len(dataset.shape) == 2
            and min(dataset.shape) == 1 < max(dataset.shape)
            and creation.get_layout() != h5py.h5d.VIRTUAL
            and not creation.get_external_count()
            and 8 * dataset.size <= _MAX_RATIO * dataset.id.get_storage_size() + 2**16
            and (dataset.chunks is None or int(np.prod(dataset.chunks)) * 8 <= 2**28)
        )

    def _is_scalar(self, name: str) -> bool:
        return isinstance(self._file.get(name), h5py.Dataset) and self._file[name].size == 1


def _described(
    vectors: dict[str, int],
    units: dict[str, str],
    increment: float | None,
    start_utc_ns: int | None = None,
) -> tuple[ForeignChannel, ...]:
    # MATLAB has no minus in names: LV-A01 is LV_A01 there.
    return tuple(
        ForeignChannel(
            name,
            unit=units.get(name, ""),
            increment_s=increment,
            start_utc_ns=start_utc_ns,
            aliases=(name, name.replace("_", "-"), name.replace("_", "-", 1)),
        )
        for name in vectors
    )


def _increment(rates: dict[str, Any]) -> float | None:
    for value in rates.values():
        rate = float(np.ravel(value)[0]) if np.size(value) == 1 else 0.0
        if np.isfinite(rate) and rate > 0:
            return 1.0 / rate
    return None


def _time(vectors: dict[str, int], source: SourceMap) -> str | None:
    return None if source.time_column else next((name for name in _TIMES if name in vectors), None)


def _require_column(path: Path, source: SourceMap, vectors: dict[str, int]) -> None:
    if source.time_column and source.time_column not in vectors:
        raise RunFileError(
            f"{path} has no vector {source.time_column!r}", advice=f"It has {', '.join(list(vectors)[:60])}."
        )
