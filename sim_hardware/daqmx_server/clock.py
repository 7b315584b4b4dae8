"""The clock of the simulated bench: seconds since its power-on.

Power-on is the first start of a task (or the first command that needs time), so that the first
acquisition always sees the world from 0 s on: same seed, same volts, however late the client came.
"""

from __future__ import annotations

import time
from threading import Condition
from typing import Protocol


class BenchClock(Protocol):
    """All calls are made with the bench's lock held."""

    def power_on(self) -> None:
        """Start counting; later calls do nothing."""
        ...

    def now(self) -> float:
        """Simulated seconds since power-on; 0 before."""
        ...

    def glance(self) -> float:
        """`now` for somebody who polls: a clock that moves with its readers moves a little."""
        ...

    def deadline(self, timeout_s: float) -> float:
        """Opaque instant at which `wait` gives up; a negative time-out never does."""
        ...

    def wait(self, changed: Condition, target_s: float | None, deadline: float) -> bool:
        """Let time pass towards `target_s` (None: unknown); False once the deadline is over."""
        ...


class PacedClock:
    """The machine's monotonic clock times a factor. Time-outs are real seconds."""

    _SLICE_S = 0.05  # an unknown target is looked for this often

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = speed
        self._started: float | None = None

    def power_on(self) -> None:
        if self._started is None:
            self._started = time.monotonic()

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
        pause = self._SLICE_S
        if target_s is not None:
            pause = min((target_s - self.now()) / self._speed + 20e-6, 1.0)
        changed.wait(max(min(pause, left), 0.0))
        return True


class SteppedClock:
    """Time that passes only when somebody waits for it: as fast as the readers, and repeatable.

    Time-outs are simulated seconds.
    """

    _SEARCH_S = 0.05
    _GLANCE_S = 1e-3

    def __init__(self) -> None:
        self._now = 0.0

    def power_on(self) -> None:
        """Nothing to do: this clock stands still by itself."""

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
        target = self._now + self._SEARCH_S if target_s is None else max(target_s, self._now)
        self._now = min(target, deadline)
        changed.notify_all()
        return True
