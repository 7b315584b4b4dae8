"""The clock of the simulated bench: seconds since its power-on.

Power-on is the first start of a sample clock (or the first command that needs time), so that the first
acquisition always sees the world from 0 s on: same seed, same volts, however late the client came.
"""

from __future__ import annotations

import time
from threading import Condition
from typing import Protocol


class BenchClock(Protocol):
    """All calls are made with the bench's lock held."""

    def power_on(self) -> float:
        """Start counting if that has not happened yet; the time now, exactly 0 at the start."""
        ...

    def now(self) -> float:
        """Simulated seconds since power-on; 0 before."""
        ...

    def glance(self) -> float:
        """`now` for somebody who polls: a clock that moves with its readers moves a little."""
        ...

    def skip(self, seconds: float) -> None:
        """Let time pass at once, as if nobody had been listening."""
        ...

    def deadline(self, timeout_s: float) -> float:
        """Opaque instant at which `wait` gives up; a negative time-out never does."""
        ...

    def wait(self, changed: Condition, target_s: float | None, deadline: float) -> bool:
        """Let time pass towards `target_s` (None: unknown); False once the deadline is over."""
        ...


class PacedClock:
    """The machine's monotonic clock times a factor. Time-outs are real seconds."""

    _SLICE_S = 0.01  # an unknown target is looked for this often

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = speed
        self._started: float | None = None

    def power_on(self) -> float:
        if self._started is None:
            self._started = time.monotonic()
            return 0.0
        return self.now()

    def now(self) -> float:
        return 0.0 if self._started is None else (time.monotonic() - self._started) * self._speed

    def glance(self) -> float:
        return self.now()

    def deadline(self, timeout_s: float) -> float:
        return float("inf") if timeout_s < 0 else time.monotonic() + timeout_s

    def wait(self, changed: Condition, target_s: float | None, deadline: float) -> bool:
        left = deadline - time.monotonic()
        if left <= 0:
            return False
        ahead = None if target_s is None else (target_s - self.now()) / self._speed
        pause = self._SLICE_S if ahead is None or ahead < 0 else min(ahead + 20e-6, 1.0)
        changed.wait(min(pause, left))
        return True

    def skip(self, seconds: float) -> None:
        self.power_on()
        assert self._started is not None
        self._started -= seconds / self._speed


class SteppedClock:
    """Time that passes only when somebody waits for it: as fast as the readers, and repeatable.

    Time-outs are simulated seconds.
    """

    _SEARCH_S = 0.02
    _GLANCE_S = 1e-3
    _LET_IN_S = 1e-3  # of real time: whoever can end a search for an unknown instant gets the lock this often

    def __init__(self) -> None:
        self._now = 0.0

    def power_on(self) -> float:
        """This clock stands still by itself."""
        return self._now

    def now(self) -> float:
        return self._now

    def glance(self) -> float:
        self._now += self._GLANCE_S
        return self._now

    def deadline(self, timeout_s: float) -> float:
        return float("inf") if timeout_s < 0 else self._now + timeout_s

    def wait(self, changed: Condition, target_s: float | None, deadline: float) -> bool:
        if self._now >= deadline:
            return False
        target = self._now + self._SEARCH_S if target_s is None or target_s <= self._now else target_s
        self._now = min(target, deadline)
        changed.notify_all()
        if target_s is None:
            changed.wait(self._LET_IN_S)
        return True

    def skip(self, seconds: float) -> None:
        self._now += seconds
