"""Memory of a finished test goes back to the system.

Blocks wait in memory while a disk takes none. Freed, they stay with the process where the C library is glibc,
which keeps pages between what is still in use; a recorder that lives for days would hold the most that it
ever held. Other allocators give pages back by themselves.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache


@cache
def _trim() -> Callable[[int], int] | None:
    if sys.platform != "linux":
        return None
    # musl has no such function.
    return getattr(ctypes.CDLL(None), "malloc_trim", None)


def give_back() -> None:
    """Return whole free pages to the system; some ten milliseconds for a hundred megabytes."""
    trim = _trim()
    if trim is not None:
        trim(0)
