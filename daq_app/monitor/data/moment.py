"""The instant at which a window looks at its session."""

from __future__ import annotations

import time
from collections.abc import Callable


class Moment:
    """A clock that stands still between two takings-in of messages.

    Everything that is drawn between them judges by the same instant how old a message is. By a clock that
    runs on, a slow drawing would make the strip and the picture beside it say different words.
    """

    def __init__(self, source: Callable[[], float] = time.monotonic) -> None:
        """`source`: the clock of the received messages, seconds."""
        self.source = source
        self._now_s = source()

    def renew(self) -> None:
        """Take the present instant: everything that had come by now has been taken in."""
        self._now_s = self.source()

    def __call__(self) -> float:
        return self._now_s
