"""Memory of a finished test goes back to the system.

Blocks wait in memory while a disk takes none. Freed, they stay with the process where the C library is glibc,
which keeps pages between what is still in use, in a heap for each thread; a recorder that lives for days
would hold the most that it ever held. Other allocators give pages back by themselves.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache
from typing import Any, Final

_ARENA_MAX: Final = -8
"""Number of this parameter for ``mallopt`` (mallopt(3))."""


@cache
def _of_c_library(function: str) -> Callable[..., Any] | None:
    if sys.platform != "linux":
        return None
    # musl has no such functions.
    return getattr(ctypes.CDLL(None), function, None)


def share_one_heap() -> None:
    """Have all threads use one heap from now on: what one of them frees, the next one takes.

    To be called before there are threads. Mapping every large block on its own would give its memory back as
    well, but its pages would be made anew for each block: 0.6 ms for 4000 samples of 41 channels.
    """
    mallopt = _of_c_library("mallopt")
    if mallopt is not None:
        mallopt(_ARENA_MAX, 1)


def give_back() -> None:
    """Return whole free pages to the system; some ten milliseconds for a hundred megabytes."""
    trim = _of_c_library("malloc_trim")
    if trim is not None:
        trim(0)
