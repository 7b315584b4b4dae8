"""MDF 3 and 4, the measurement files of vehicle test benches, read with asammdf."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import Findings, ForeignChannel, Spool

_UNEVEN: Final = 0.01
"""Deviation of a spacing from the mean, as a share, above which the times count as uneven. Stamps of buses
jitter by more, those of a sample clock by less."""


class MdfReader:
    """See `Reader`. A channel's times are those of its group; its numbers are in engineering units."""

    def __init__(self, path: Path, source: SourceMap) -> None:
        del source
        import asammdf

        self.findings = Findings()
        self.time_channel = self.time_hint = None
        try:
            with path.open("rb") as file:
                head = file.read(64)
            if len(head) < 64 or head[:3] not in (b"MDF", b"UnF"):
                raise RunFileError(f"{path} is no MDF file: it does not begin with 'MDF'")
            self._mdf = asammdf.MDF(path)
            start = self._mdf.header.start_time
            self._places = dict(_places_of(self._mdf))
            start_utc_ns = round(start.timestamp() * 1e9)
            self.channels = tuple(
                self._described(name, place, start_utc_ns) for name, place in self._places.items()
            )
        except RunFileError:
            raise
        except OSError as error:
            raise RunFileError(
                f"{path} cannot be read ({error.strerror})", advice="Check the name."
            ) from error
        except Exception as error:
            raise RunFileError(f"{path} is no MDF file that asammdf reads ({error})") from error
        if not self.channels:
            raise RunFileError(f"{path} holds no channels of numbers")

    def copy(self, spool: Spool) -> None:
        for name in spool.names:
            spool.append(name, np.asarray(self._signal(name).samples, dtype=np.float64))

    def close(self) -> None:
        self._mdf.close()

    def _signal(self, name: str) -> Any:
        group, index = self._places[name]
        return self._mdf.get(group=group, index=index, ignore_invalidation_bits=True)

    def _described(self, name: str, place: tuple[int, int], start_utc_ns: int) -> ForeignChannel:
        signal = self._signal(name)
        increment, first_s = None, 0.0
        if signal.timestamps.size > 1:
            spacing = np.diff(signal.timestamps)
            mean, first_s = float(np.mean(spacing)), float(signal.timestamps[0])
            if mean > 0 and float(np.max(np.abs(spacing / mean - 1.0))) < _UNEVEN:
                increment = mean
            else:
                self.findings.doubts.append(f"the times of {name!r} are not equally spaced")
        return ForeignChannel(
            name,
            unit=signal.unit or "",
            increment_s=increment,
            start_utc_ns=start_utc_ns + round(first_s * 1e9),
            aliases=(name.rpartition("/")[2],),
        )


def _places_of(mdf: Any) -> list[tuple[str, tuple[int, int]]]:
    """(name, (group, index)) of every channel of real numbers but the times; unique names."""
    places: dict[str, tuple[int, int]] = {}
    for group, content in enumerate(mdf.groups):
        master = mdf.masters_db.get(group)
        for index, channel in enumerate(content.channels):
            if index == master:
                continue
            samples = mdf.get(group=group, index=index, record_count=1).samples
            if samples.ndim == 1 and samples.dtype.kind in "fiu":
                name = channel.name if channel.name not in places else f"group {group + 1}/{channel.name}"
                places[name] = (group, index)
    return list(places.items())
