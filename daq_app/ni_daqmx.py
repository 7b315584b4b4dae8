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

_OPTIONS: Final = ("--connection", "--against", "--hardware")
"""Options that take a connection."""
_COMMANDS: Final = (("rig", "from-device"), ("rig", "product"), ("rig", "reserve"))
"""Commands that ask NI-DAQmx on this computer unless their arguments name another connection."""


def is_installed() -> bool:
    """Whether the library is where the system looks for libraries."""
    return any(find_library(name) for name in _LIBRARIES)


def is_asked_for(arguments: Sequence[str]) -> bool:
    """Whether a command line, from the command's name on, needs NI-DAQmx on this computer."""
    pairs = zip(arguments, [*arguments[1:], ""], strict=True)
    if any(f"{option}=local" in arguments for option in _OPTIONS) or any(
        option in _OPTIONS and value == "local" for option, value in pairs
    ):
        return True
    return tuple(arguments[:2]) in _COMMANDS and not any("://" in argument for argument in arguments)
