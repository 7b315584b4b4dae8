"""Whether NI-DAQmx is installed on this computer, told from the standard library alone.

The command line asks before it loads anything else, so that the answer takes no second.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from ctypes.util import find_library
from typing import Final

_LIBRARIES: Final = ("nicaiu", "nicai_utf8") if sys.platform == "win32" else ("nidaqmx",)
"""NI-DAQmx's C library, by the names that the nidaqmx client looks for."""

NOT_INSTALLED: Final = "NI-DAQmx is not installed on this computer"
ADVICE: Final = "Install the NI-DAQmx driver from ni.com, or use --connection simulated or grpc://HOST:PORT"


def is_installed() -> bool:
    """Whether the library is where the system looks for libraries."""
    return any(find_library(name) for name in _LIBRARIES)


def is_asked_for(arguments: Sequence[str]) -> bool:
    """Whether a command line names the connection ``local``."""
    pairs = zip(arguments, [*arguments[1:], ""], strict=True)
    return "--connection=local" in arguments or ("--connection", "local") in pairs
