"""DAQmx's own recorder: the samples that reads hand out, written to a TDMS file by the driver."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any, Final

import numpy as np
from nidaqmx.constants import LoggingMode, LoggingOperation
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
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

    @property
    def enabled(self) -> bool:
        return bool(self._settings.get("LOGGING_MODE", LoggingMode.OFF.value) != LoggingMode.OFF.value)

    def check(self) -> None:
        """Refuse what the simulation does not do: logging without reading."""
        if self._settings.get("LOGGING_MODE") == LoggingMode.LOG.value:
            raise DaqmxError(
                Code.INVALID_VALUE,
                "Property: DAQmx_Logging_Mode\nRequested Value: DAQmx_Val_Log\n"
                "Possible Values: DAQmx_Val_Off, DAQmx_Val_LogAndRead",
            )

    def open(self) -> None:
        """Open the file of the settings, by the operation of the settings."""
        self.close()
        path = Path(str(self._settings["LOGGING_FILE_PATH"]))
        operation = self._settings.get("LOGGING_TDMS_OPERATION", LoggingOperation.OPEN_OR_CREATE.value)
        if operation == LoggingOperation.CREATE.value and path.exists():
            raise _bad_path(path, "the file exists already")
        if operation == LoggingOperation.OPEN.value and not path.exists():
            raise _bad_path(path, "the file does not exist")
        mode = "a" if operation in _OPENS_EXISTING and path.exists() else "w"
        try:
            self._writer = TdmsWriter(str(path), mode=mode)
            self._writer.open()
        except OSError as error:
            self._writer = None
            raise _bad_path(path, str(error)) from error

    def write(
        self,
        names: list[str],
        units: list[str],
        values: NDArray[np.float64],
        first: int,
        rate_hz: float,
        start: dt.datetime,
    ) -> None:
        """Append a block (channels × samples) that begins with sample `first`; sample 0 is at `start`."""
        if self._settings.get("LOGGING_PAUSE", False):
            return
        if self._writer is None:
            self.open()
        assert self._writer is not None
        group = str(self._settings.get("LOGGING_TDMS_GROUP_NAME") or "Task")
        channels = [
            ChannelObject(
                group,
                name,
                np.ascontiguousarray(row),
                properties={
                    "unit_string": unit,
                    "wf_start_time": np.datetime64(start.replace(tzinfo=None), "us"),
                    "wf_increment": 1.0 / rate_hz,
                    "wf_start_offset": first / rate_hz,
                },
            )
            for name, unit, row in zip(names, units, values, strict=True)
        ]
        self._writer.write_segment([RootObject(), GroupObject(group), *channels])

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None


def _bad_path(path: Path, reason: str) -> DaqmxError:
    return DaqmxError(
        Code.INVALID_VALUE, f"Property: DAQmx_Read_Logging_FilePath\nRequested Value: {path}\n({reason})"
    )
