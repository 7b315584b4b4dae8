"""What must be done although the computer has no memory left."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, TypeVar

_T = TypeVar("_T")
_AGAIN_AFTER_S: Final = 0.2


def until_memory(step: Callable[[], _T]) -> _T:
    """The outcome of `step`, which is done again as long as it ends for want of memory.

    For what must not be lost and does no harm done twice: an answer that somebody waits for. Other programs
    give memory back, or their user ends them.
    """
    while True:
        try:
            return step()
        except MemoryError:
            time.sleep(_AGAIN_AFTER_S)
