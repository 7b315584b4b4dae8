"""Whether NI-DAQmx is installed on this computer, told without loading the client that needs it."""

from __future__ import annotations

import sys
from ctypes.util import find_library
from typing import Final

from drivers.protocol import Block, DriverError

_LIBRARIES: Final = ("nicaiu", "nicai_utf8") if sys.platform == "win32" else ("nidaqmx",)
"""NI-DAQmx's C library, by the names that the nidaqmx client looks for."""


def require_ni_daqmx() -> None:
    """Raise `DriverError` where the connection ``local`` cannot be had."""
    if not any(find_library(name) for name in _LIBRARIES):
        raise not_installed()


def not_installed(partial: Block | None = None) -> DriverError:
    """What to say of a computer without NI-DAQmx; `partial` holds samples that are good."""
    return DriverError(
        "NI-DAQmx is not installed on this computer",
        advice="Install the NI-DAQmx driver from ni.com, or use --connection simulated or grpc://HOST:PORT",
        partial=partial,
    )
