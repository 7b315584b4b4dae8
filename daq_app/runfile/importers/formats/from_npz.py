"""NumPy archives: one rectangle `data` (channels × samples) with `names`, or one array per channel.

Pickled objects are refused; arrays are read in pieces and never trusted to be as small as they say.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.formats.own_export import start_in_json
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Spool

_SMALL_BYTES: Final = 2**24
_UNSUSPICIOUS_BYTES: Final = 2**28
_MAX_RATIO: Final = 50
"""Readings are noise: a recording shrinks to a fifth at best, channels that never change included."""
_PIECE_ROWS: Final = 2**17
_RATES: Final = ("fs", "rate_hz", "sampling_rate", "sampling_rate_hz")
_TIMES: Final = ("time", "t", "time_s")


class NpzReader:
    """See `Reader`. Integers with `scale` and `offset` per channel become ``data · scale + offset``."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        self._path = path
        self.findings = Findings()
        with _Told(str(path)):
            self._archive = zipfile.ZipFile(path)
        try:
            self._shapes = self._read_shapes()
            self._rectangle = "data" if len(self._shapes.get("data", ((),))[0]) == 2 else ""
            self.channels = self._describe()
        except BaseException:
            self._archive.close()
            raise
        self.time_channel = next((name for name in _TIMES if name in self._columns()), None)
        self.time_hint: str | None = None
        if source.time_column:
            self.time_channel = None

    def copy(self, spool: Spool) -> None:
        if not self._rectangle:
            for name in spool.names:
                for piece in self._pieces(name):
                    spool.append(name, piece)
            return
        wanted = {index: name for index, name in enumerate(self._columns()) if name in spool.names}
        scale, offset = self._factors("scale", 1.0), self._factors("offset", 0.0)
        n_channels, n_samples = self._shapes["data"][0]
        at = 0
        for piece in self._pieces("data"):
            # The rectangle lies in the file channel after channel.
            for index in range(at // n_samples, (at + piece.size - 1) // n_samples + 1):
                low, high = max(at, index * n_samples), min(at + piece.size, (index + 1) * n_samples)
                if index in wanted and low < high:
                    spool.append(wanted[index], piece[low - at : high - at] * scale[index] + offset[index])
            at += piece.size
        if at != n_channels * n_samples:
            raise RunFileError(f"{self._path} is cut short")

    def close(self) -> None:
        self._archive.close()

    def _read_shapes(self) -> dict[str, tuple[tuple[int, ...], np.dtype[Any], bool]]:
        """name → (shape, type, Fortran order) from the heads of the arrays."""
        self._refuse_bombs()
        shapes = {}
        for info in self._archive.infolist()[:10_000]:
            if not info.filename.endswith(".npy"):
                continue
            with self._told(info.filename), self._archive.open(info) as member:
                version = npy.read_magic(member)
                read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
                shape, fortran, dtype = read(member)
                if dtype.hasobject:
                    continue  # a pickle: it could run code
                if int(np.prod(shape, dtype=object)) * dtype.itemsize > info.file_size:
                    raise ValueError("it claims more numbers than it holds")
                shapes[info.filename.removesuffix(".npy")] = (shape, dtype, fortran)
        if not shapes:
            raise RunFileError(f"{self._path} holds no arrays of numbers")
        return shapes

    def _refuse_bombs(self) -> None:
        """What the archive claims to unpack to is known before a byte of it is."""
        claimed = sum(info.file_size for info in self._archive.infolist())
        packed = self._path.stat().st_size
        if claimed > max(_UNSUSPICIOUS_BYTES, _MAX_RATIO * packed):
            raise RunFileError(
                f"{self._path} claims to unpack from {packed / 1e6:.1f} MB to {claimed / 1e9:.1f} GB, as no "
                "recording does",
                advice="If it is one, unpack it and save it again with np.savez.",
            )

    def _told(self, name: str) -> _Told:
        return _Told(f"{self._path}: {name}")

    def _columns(self) -> list[str]:
        """Channel names in order."""
        if not self._rectangle:
            return [
                name
                for name, (shape, dtype, _) in self._shapes.items()
                if dtype.kind in "iufb"
                and len([n for n in shape if n != 1]) == 1
                and name not in ("scale", "offset")
            ]
        n_channels = self._shapes["data"][0][0]
        names = [str(name) for name in self._small("names")] if "names" in self._shapes else []
        if len(names) != n_channels or len(set(names)) != n_channels:
            if names:
                self.findings.doubts.append("names and data do not belong together: names were not believed")
            names = [f"channel {index + 1}" for index in range(n_channels)]
        return names

    def _describe(self) -> tuple[ForeignChannel, ...]:
        names = self._columns()
        if len(names) > 4096:
            raise RunFileError(f"{self._path} has {len(names)} channels: it is no recording of a rig")
        units = [str(unit) for unit in self._small("units")] if "units" in self._shapes else []
        if len(units) != len(names):
            units = [""] * len(names)
        rate = next((float(self._small(name)[0]) for name in _RATES if name in self._shapes), 0.0)
        increment = 1.0 / rate if np.isfinite(rate) and rate > 0 else None
        told = self._shapes.get("metadata_json")
        text = str(self._small("metadata_json")[0]) if told and told[0] == () and told[1].kind == "U" else ""
        start = start_in_json(text)
        return tuple(
            ForeignChannel(name, unit=unit, increment_s=increment, start_utc_ns=start, aliases=(name,))
            for name, unit in zip(names, units, strict=True)
        )

    def _factors(self, name: str, default: float) -> NDArray[np.float64]:
        n_channels = self._shapes["data"][0][0]
        if name not in self._shapes:
            return np.full(n_channels, default)
        values = np.asarray(self._small(name), dtype=np.float64).ravel()
        if values.size not in (1, n_channels):
            raise RunFileError(f"{self._path}: {name} has {values.size} values for {n_channels} channels")
        return np.broadcast_to(values, (n_channels,))

    def _small(self, name: str) -> NDArray[Any]:
        shape, dtype, _ = self._shapes[name]
        if int(np.prod(shape, dtype=object)) * dtype.itemsize > _SMALL_BYTES:
            raise RunFileError(f"{self._path}: {name} is absurdly large")
        with self._told(name), self._archive.open(f"{name}.npy") as member:
            return np.atleast_1d(npy.read_array(member, allow_pickle=False)).ravel()
        raise AssertionError

    def _pieces(self, name: str) -> Iterator[NDArray[np.float64]]:
        """Numbers of an array in the order of the file, as float64."""
        shape, dtype, fortran = self._shapes[name]
        if fortran and len([n for n in shape if n != 1]) > 1:
            raise RunFileError(
                f"{self._path}: {name} lies in Fortran order; save it with np.ascontiguousarray"
            )
        if dtype.kind not in "iufb":
            raise RunFileError(f"{self._path}: {name} holds {dtype}, not real numbers")
        with self._told(name), self._archive.open(f"{name}.npy") as member:
            version = npy.read_magic(member)
            (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(member)
            left = int(np.prod(shape, dtype=object))
            while left:
                values = np.frombuffer(_exactly(member, min(left, _PIECE_ROWS) * dtype.itemsize), dtype=dtype)
                left -= values.size
                yield values.astype(np.float64)


class _Told:
    """Errors of zip and NumPy in plain words; damaged archives raise nearly anything in them."""

    def __init__(self, what: str) -> None:
        self._what = what

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, Exception) and not isinstance(error, RunFileError):
            raise RunFileError(
                f"{self._what} cannot be read ({error})", advice="Is it a whole NPZ file?"
            ) from error


def _exactly(member: IO[bytes], n_bytes: int) -> bytes:
    parts = []
    while n_bytes:
        part = member.read(n_bytes)
        if not part:
            raise EOFError("it is cut short")
        parts.append(part)
        n_bytes -= len(part)
    return b"".join(parts)
