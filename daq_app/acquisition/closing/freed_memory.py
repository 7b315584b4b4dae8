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
from typing import Any, Final, cast

_TOP_PAD: Final = -2
_ARENA_MAX: Final = -8
_MMAP_MAX: Final = -4
"""Numbers of these parameters for ``mallopt`` (mallopt(3))."""
_RESERVE_BYTES: Final = 32 * 2**20
"""Address space that the heap has beyond what is in use: blocks of some seconds, texts, messages. Pages of
it that nobody has written to take no memory."""
_LEAST_RESERVE_BYTES: Final = 16 * 2**20
"""What of it there is at any time in one piece. Where a product of matrices gets no memory, OpenBLAS ends the
process."""
_MOST_MAPPED: Final = 65536
"""Blocks that the library maps on their own unless told otherwise (mallopt(3))."""
_SIGNATURES: Final = {
    "mallopt": (ctypes.c_int, (ctypes.c_int, ctypes.c_int)),
    "malloc_trim": (ctypes.c_int, (ctypes.c_size_t,)),
    "malloc": (ctypes.c_void_p, (ctypes.c_size_t,)),
    "free": (None, (ctypes.c_void_p,)),
}
"""Type of the result and types of the arguments of each function of the C library that is called here."""


@cache
def _of_c_library(function: str) -> Callable[..., Any] | None:
    if sys.platform != "linux":
        return None
    # musl has neither mallopt nor malloc_trim.
    found: Any = getattr(ctypes.CDLL(None), function, None)
    if found is not None:
        found.restype, found.argtypes = _SIGNATURES[function]
    return cast("Callable[..., Any] | None", found)


def share_one_heap() -> None:
    """Have all threads use one heap from now on, with a reserve: what one of them frees, the next one takes.

    To be called before there are threads. Mapping every large block on its own would give its memory back as
    well, but its pages would be made anew for each block: 0.6 ms for 4000 samples of 41 channels.
    """
    mallopt = _of_c_library("mallopt")
    if mallopt is not None:
        mallopt(_ARENA_MAX, 1)
        mallopt(_TOP_PAD, _RESERVE_BYTES)


def renew_reserve() -> None:
    """Give the heap its reserve again where threads have used it up; to be called now and then.

    The heap grows when it has no room for a small block, not for one that can be mapped on its own. So what
    is left of the reserve is whatever has not been used since it grew last.
    """
    mallopt, malloc, free = map(_of_c_library, ("mallopt", "malloc", "free"))
    if mallopt is None or malloc is None or free is None:
        return
    mallopt(_MMAP_MAX, 0)
    try:
        free(malloc(_LEAST_RESERVE_BYTES))
    finally:
        mallopt(_MMAP_MAX, _MOST_MAPPED)


def give_back() -> None:
    """Return whole free pages but the reserve to the system; some ten milliseconds for 100 MB."""
    trim = _of_c_library("malloc_trim")
    if trim is not None:
        trim(_RESERVE_BYTES)
