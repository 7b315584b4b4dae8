"""Sample index ↔ simulated time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_hardware.faults.model import ClockChange


class SampleTimes:
    """A clock that never ends: straight pieces between changes of its rate."""

    def __init__(self, first_s: float, rate_hz: float, changes: Sequence[ClockChange] = ()) -> None:
        self.first_s = first_s
        self.rate_hz = rate_hz
        self._changes = tuple(changes)
        edges = {first_s}
        for change in changes:
            edges.update(t for t in (change.start_s, change.end_s) if first_s < t < np.inf)
        times = np.array(sorted(edges))
        rates = np.full(len(times), rate_hz)
        for change in changes:
            inside = (times >= change.start_s) & (times < change.end_s)
            rates[inside] *= change.factor
        self._times = times
        self._rates = rates
        counts = np.concatenate(([0.0], np.cumsum(np.diff(times) * rates[:-1])))
        self._counts = counts
        self._moving = rates > 0

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Instant of each sample; inf where the clock has stopped for good."""
        if len(self._times) == 1 and self._moving[0]:
            return self.first_s + index / float(self._rates[0])
        piece = np.clip(np.searchsorted(self._counts, index, side="right") - 1, 0, None)
        rates = self._rates[piece]
        with np.errstate(divide="ignore", invalid="ignore"):
            out = self._times[piece] + np.where(rates > 0, (index - self._counts[piece]) / rates, np.inf)
        return np.where(index == self._counts[piece], self._times[piece], out)

    def later(self, delay_s: float) -> SampleTimes:
        """The same clock, each sample later by a delay."""
        return SampleTimes(self.first_s + delay_s, self.rate_hz, self._changes)

    def from_sample(self, index: int) -> SampleTimes:
        """The same clock, counted from a later sample."""
        return SampleTimes(self.time_of(index), self.rate_hz, self._changes)

    def time_of(self, index: int) -> float:
        return float(self.at(np.array([index]))[0])

    def count(self, now_s: float) -> int:
        """Samples taken up to and including `now_s`."""
        if now_s < self.first_s:
            return 0
        piece = int(np.searchsorted(self._times, now_s, side="right")) - 1
        position = self._counts[piece] + (now_s - self._times[piece]) * self._rates[piece]
        return int(np.floor(position + 1e-6)) + 1


class PulseTimes(SampleTimes):
    """Starts of pulses whose periods come one after the other, and then again from the first one."""

    def __init__(self, first_s: float, periods_s: NDArray[np.float64], skipped: int = 0) -> None:
        """`skipped` pulses of the train from `first_s` on are not counted."""
        super().__init__(first_s, 1.0 / float(np.mean(periods_s)))
        self._periods_s = np.asarray(periods_s, dtype=np.float64)
        self._starts_s = np.concatenate(([0.0], np.cumsum(self._periods_s)))
        self._skipped = skipped

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        turn, place = np.divmod(np.asarray(index) + self._skipped, len(self._periods_s))
        return np.asarray(self.first_s + turn * self._starts_s[-1] + self._starts_s[place])

    def later(self, delay_s: float) -> SampleTimes:
        return PulseTimes(self.first_s + delay_s, self._periods_s, self._skipped)

    def from_sample(self, index: int) -> SampleTimes:
        return PulseTimes(self.first_s, self._periods_s, self._skipped + index)

    def count(self, now_s: float) -> int:
        if now_s < self.first_s:
            return 0
        turn, rest_s = divmod(now_s - self.first_s + 1e-6 * float(self._periods_s.min()), self._starts_s[-1])
        begun = int(turn) * len(self._periods_s) + int(np.searchsorted(self._starts_s, rest_s, side="right"))
        return max(begun - self._skipped, 0)


class BurstTimes(SampleTimes):
    """A clock that gives the same number of samples after each of its triggers."""

    def __init__(self, bursts: Sequence[SampleTimes], samples: int) -> None:
        """`bursts` in order, none beginning before the one before has had its `samples`."""
        super().__init__(bursts[0].first_s, bursts[0].rate_hz)
        self.bursts = tuple(bursts)
        self.samples = samples

    @property
    def end_s(self) -> float:
        """Instant of the last sample of the last burst."""
        return self.bursts[-1].time_of(self.samples - 1)

    def then(self, burst: SampleTimes) -> BurstTimes:
        """The same clock with one more burst."""
        return BurstTimes((*self.bursts, burst), self.samples)

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Instant of each sample; inf for samples whose trigger has not come."""
        number, place = np.divmod(np.asarray(index), self.samples)
        out = np.full(number.shape, np.inf)
        for i in np.unique(number[number < len(self.bursts)]):
            out[number == i] = self.bursts[i].at(place[number == i])
        return out

    def later(self, delay_s: float) -> SampleTimes:
        return BurstTimes([burst.later(delay_s) for burst in self.bursts], self.samples)

    def from_sample(self, index: int) -> SampleTimes:
        """The same clock, counted from the burst that the sample belongs to."""
        return BurstTimes(self.bursts[index // self.samples :] or self.bursts[-1:], self.samples)

    def count(self, now_s: float) -> int:
        return sum(min(burst.count(now_s), self.samples) for burst in self.bursts)
