"""Memory of a finished test goes back to the system.

Blocks wait in memory while a disk takes none. Freed, they stay with the process where the C library is glibc,
which keeps pages between what is still in use, in a heap for each thread; a recorder that lives for days
would hold the most that it ever held. Other allocators give pages back by themselves.

A little is kept all the same: where the computer has no memory left, a recorder must still be able to write,
to say so and to close its run.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache
from typing import Any, Final

_TOP_PAD: Final = -2
_ARENA_MAX: Final = -8
"""Numbers of these parameters for ``mallopt`` (mallopt(3))."""
_RESERVE_BYTES: Final = 32 * 2**20
"""Address space that the heap has beyond what is in use: blocks of some seconds, texts, messages. Pages of
it that nobody has written to take no memory."""


@cache
def _of_c_library(function: str) -> Callable[..., Any] | None:
    if sys.platform != "linux":
        return None
    # musl has no such functions.
    return getattr(ctypes.CDLL(None), function, None)


def share_one_heap() -> None:
    """Have all threads use one heap from now on, with a reserve: what one of them frees, the next one takes.

    To be called before there are threads. Mapping every large block on its own would give its memory back as
    well, but its pages would be made anew for each block: 0.6 ms for 4000 samples of 41 channels.
    """
    mallopt = _of_c_library("mallopt")
    if mallopt is not None:
        mallopt(_ARENA_MAX, 1)
        mallopt(_TOP_PAD, _RESERVE_BYTES)


def give_back() -> None:
    """Return whole free pages but the reserve to the system; some ten milliseconds for 100 MB."""
    trim = _of_c_library("malloc_trim")
    if trim is not None:
        trim(_RESERVE_BYTES)
