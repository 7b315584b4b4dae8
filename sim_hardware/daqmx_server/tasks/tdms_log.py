"""DAQmx's own recorder: the samples that reads hand out, written to a TDMS file by the driver."""

from __future__ import annotations

import datetime as dt
import itertools
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
from nidaqmx.constants import LoggingMode, LoggingOperation
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter
from numpy.typing import NDArray

from sim_hardware.daqmx_server.errors import Code, DaqmxError

_OPENS_EXISTING: Final = (LoggingOperation.OPEN.value, LoggingOperation.OPEN_OR_CREATE.value)


class TdmsLog:
    """One file at a time; every block is one TDMS segment with the readings in the channels' units.

    NI's driver writes raw codes with scaling properties; a reader of the file sees the same values.
    """

    def __init__(self, settings: dict[str, Any]) -> None:
        self._settings = settings
        self._writer: TdmsWriter | None = None
        self._part = 0
        self._written = 0
        self._was_paused = False
        self._group = ""
        self._groups: set[str] = set()
        """Groups that the open file has already."""
        self._begin: int | None = None
        """Sample that the group begins with: its `wf_start_offset`, which every segment repeats."""

    @property
    def enabled(self) -> bool:
        return bool(self._settings.get("LOGGING_MODE", LoggingMode.OFF.value) != LoggingMode.OFF.value)

    @property
    def takes_samples(self) -> bool:
        """Mode Log: the samples go to the file as they come, and cannot be read."""
        return bool(self._settings.get("LOGGING_MODE") == LoggingMode.LOG.value)

    def check(self, buffered: bool) -> None:
        """−201299 for a task without a sample clock."""
        if self.enabled and not buffered:
            raise DaqmxError(Code.LOG_UNBUFFERED)

    def open(self) -> None:
        """Open the file of the settings, by the operation of the settings."""
        self._part = 0
        self._open(Path(str(self._settings["LOGGING_FILE_PATH"])))

    def _open(self, path: Path) -> None:
        self.close()
        self._written = 0
        operation = self._settings.get("LOGGING_TDMS_OPERATION", LoggingOperation.OPEN_OR_CREATE.value)
        if operation == LoggingOperation.CREATE.value and path.exists():
            raise _bad_path(path, "the file exists already")
        if operation == LoggingOperation.OPEN.value and not path.exists():
            raise _bad_path(path, "the file does not exist")
        appends = operation in _OPENS_EXISTING and path.exists()
        mode = "a" if appends else "w"
        try:
            self._groups = _groups_in(path) if appends else set()
            self._begin_group()
            self._writer = TdmsWriter(str(path), mode=mode)
            self._writer.open()
        except (OSError, ValueError) as error:
            self._writer = None
            raise _bad_path(path, str(error)) from error

    def _begin_group(self) -> None:
        """A group that the file does not have yet: ``NAME``, ``NAME #1`` …, as NI's driver appends runs."""
        name = str(self._settings.get("LOGGING_TDMS_GROUP_NAME") or "Task")
        numbered = (f"{name} #{number}" for number in itertools.count(1))
        self._group = next(free for free in itertools.chain([name], numbered) if free not in self._groups)
        self._groups.add(self._group)
        self._begin = None

    def write(
        self,
        names: list[str],
        units: list[str],
        values: NDArray[np.float64],
        first: int,
        rate_hz: float,
        start: dt.datetime,
    ) -> None:
        """Append a block (channels × samples) that begins with sample `first`; sample 0 is at `start`.

        What comes after a pause gets a group of its own.
        """
        if self._settings.get("LOGGING_PAUSE", False):
            self._was_paused = True
            return
        if self._writer is None:
            self.open()
        elif self._was_paused and self._begin is not None:
            self._begin_group()
        self._was_paused = False
        begin = 0
        while begin < values.shape[1]:
            end = min(begin + self._room(), values.shape[1])
            self._append(names, units, values[:, begin:end], first + begin, rate_hz, start)
            self._written += end - begin
            begin = end

    def _room(self) -> int:
        """Samples per channel that go into this file; a full one is followed by ``…_0001.tdms``."""
        limit = int(self._settings.get("LOGGING_SAMPS_PER_FILE", 0))
        if not limit:
            return sys.maxsize
        if self._written >= limit:
            path = Path(str(self._settings["LOGGING_FILE_PATH"]))
            self._part += 1
            self._open(path.with_stem(f"{path.stem}_{self._part:04d}"))
        return limit - self._written

    def _append(
        self,
        names: list[str],
        units: list[str],
        values: NDArray[np.float64],
        first: int,
        rate_hz: float,
        start: dt.datetime,
    ) -> None:
        assert self._writer is not None
        if self._begin is None:
            self._begin = first
        channels = [
            ChannelObject(
                self._group,
                name,
                np.ascontiguousarray(row),
                properties={
                    "unit_string": unit,
                    "wf_start_time": np.datetime64(start.replace(tzinfo=None), "us"),
                    "wf_increment": 1.0 / rate_hz,
                    "wf_start_offset": self._begin / rate_hz,
                },
            )
            for name, unit, row in zip(names, units, values, strict=True)
        ]
        self._writer.write_segment([RootObject(), GroupObject(self._group), *channels])

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


def _groups_in(path: Path) -> set[str]:
    return {group.name for group in TdmsFile.read_metadata(path).groups()}


def _bad_path(path: Path, reason: str) -> DaqmxError:
    return DaqmxError(
        Code.INVALID_VALUE, f"Property: DAQmx_Read_Logging_FilePath\nRequested Value: {path}\n({reason})"
    )
