"""Sample clocks whose instants are found as time passes: changes of lines, and clocks that are held."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
from sim_hardware.daqmx_server.timing.sampling import BlockSource
from sim_hardware.daqmx_server.timing.triggers import Hold


class Finder(Protocol):
    """Instants in order; what has been found stays."""

    @property
    def first_s(self) -> float:
        """Nothing is found before this instant."""
        ...

    def until(self, now_s: float) -> Sequence[float]:
        """Every instant up to now, from the first on."""
        ...

    def known(self) -> Sequence[float]:
        """What has been found so far, without looking further."""
        ...


class FoundTimes(SampleTimes):
    """A clock whose samples are the instants of a finder, counted from one of them, perhaps later each."""

    def __init__(self, finder: Finder, rate_hz: float, skipped: int = 0, delay_s: float = 0.0) -> None:
        """`rate_hz` is what the task says its rate is; the instants do not keep to it."""
        known = finder.known()
        super().__init__(known[skipped] if skipped < len(known) else finder.first_s, rate_hz)
        self.finder = finder
        self._skipped = skipped
        self._delay_s = delay_s

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Instant of each sample; inf where it has not been found."""
        known = np.append(np.asarray(self.finder.known(), dtype=np.float64), np.inf)
        place = np.minimum(np.asarray(index) + self._skipped, len(known) - 1)
        return np.asarray(known[place] + self._delay_s)

    def later(self, delay_s: float) -> SampleTimes:
        return FoundTimes(self.finder, self.rate_hz, self._skipped, self._delay_s + delay_s)

    def from_sample(self, index: int) -> SampleTimes:
        return FoundTimes(self.finder, self.rate_hz, self._skipped + index, self._delay_s)

    def count(self, now_s: float) -> int:
        found = self.finder.until(now_s - self._delay_s)
        upto = int(np.searchsorted(np.asarray(found), now_s - self._delay_s, side="right"))
        return max(upto - self._skipped, 0)


Changes = Callable[[float, float], Sequence[tuple[float, bool]]]
"""Changes of a line after one instant and up to another: instant, and whether the line rises."""


class LineChanges:
    """Finder of the instants at which a line changes in a direction that is listened for."""

    def __init__(self, first_s: float, lines: Sequence[tuple[Changes, bool]]) -> None:
        """`lines`: changes of a line, and whether its rising or its falling edges count."""
        self.first_s = first_s
        self._lines = tuple(lines)
        self._looked_s = first_s
        self._found: list[float] = []

    def until(self, now_s: float) -> Sequence[float]:
        """Lines that change together give one instant."""
        if now_s > self._looked_s:
            self._found += sorted(
                {
                    instant_s
                    for changes, rising in self._lines
                    for instant_s, up in changes(self._looked_s, now_s)
                    if up is rising
                }
            )
            self._looked_s = now_s
        return self._found

    def known(self) -> Sequence[float]:
        return self._found


class HeldClock:
    """Finder of the clocks that an analogue pause trigger lets through, and the samples taken at them."""

    def __init__(
        self,
        times: SampleTimes,
        sampler: BlockSource,
        readings: Callable[[BlockSource, int, int], Any],
        hold: Hold,
    ) -> None:
        """`readings` of the trigger's channel by the unheld clock `times`, whose samples `sampler` gives."""
        self.first_s = times.first_s
        self.times = times
        self._sampler = sampler
        self._readings = readings
        self._hold = hold
        self._kept: list[int] = []
        self._instants: list[float] = []
        self._next = 0

    def renew(self, times: SampleTimes, sampler: BlockSource) -> None:
        """The world has changed: samples to come are made afresh."""
        self.times = times
        self._sampler = sampler

    def until(self, now_s: float) -> Sequence[float]:
        count = self.times.count(now_s)
        if count > self._next:
            held = self._hold.holds(np.asarray(self._readings(self._sampler, self._next, count)))
            kept = self._next + np.flatnonzero(~held)
            self._kept += kept.tolist()
            self._instants += self.times.at(kept).tolist()
            self._next = count
        return self._instants

    def known(self) -> Sequence[float]:
        return self._instants

    def codes(self, start: int, stop: int) -> NDArray[Any]:
        """Samples start … stop−1 of those that were let through, shape (channels, samples)."""
        kept = np.array(self._kept[start:stop], dtype=np.int64)
        if not len(kept):
            return self._sampler.codes(0, 0)
        first = int(kept[0])
        return self._sampler.codes(first, int(kept[-1]) + 1)[:, kept - first]
