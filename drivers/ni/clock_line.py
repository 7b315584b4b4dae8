"""Where the sample clock stood and stands, by this computer's monotonic clock.

Tasks that had to be started again count from zero; this line says which sample their first one would have
been, had the old tasks gone on, and how well that is known.
"""

from __future__ import annotations

from typing import Final

from drivers.protocol import ClockReading

_SPAN_S: Final = 1.0
"""Least time between two readings that tell that a clock keeps its nominal rate."""
_OTHER_RATE_SPAN_S: Final = 3.0
"""And that it has another one: not said after the first late reply."""
_ADOPT_S: Final = 0.3
"""A new line counts once it has run straight for so long: a count that is only held up does not grow."""
_OFF_S: Final = 0.03
_PLAUSIBLE: Final = 0.01
"""Share by which a clock may be off its nominal rate before what was seen counts for more (an external
clock; a simulated device that runs faster than real time)."""
_OSCILLATOR: Final = 1e-4
"""Share by which an oscillator that keeps its nominal rate may be off."""


class ClockLine:
    """Feed it the readings; it keeps a straight line of samples against time.

    The line survives what is no clock: late replies, samples held up on the way, a count that leaps because
    one of the two clocks stood still. Only a new line that lasts replaces it.
    """

    def __init__(self, rate_hz: float) -> None:
        self._nominal_hz = rate_hz
        self._rate_hz: float | None = None
        self._rate_error = _OSCILLATOR
        self._first: ClockReading | None = None
        self._last: ClockReading | None = None
        self._middle: ClockReading | None = None
        """Until the rate is known: where the first half of the readings so far ends."""
        self._other: ClockReading | None = None
        """Where another line may have begun."""
        self._sure: ClockReading | None = None
        """The newest count that was not held up on its way."""
        self._behind: ClockReading | None = None
        """Since when counts stay behind that one, by less than makes another line."""

    def add(self, reading: ClockReading) -> None:
        """Readings come in order of time."""
        if self._first is None or self._last is None:
            self._first = self._last = self._sure = reading
        elif self._rate_hz is None or reading.follows(self._last, self.rate_hz, _OFF_S):
            self._other = None
            self._last = reading
            self._look_at_rate()
            self._look_for_delay(reading)
        elif self._other is None or not reading.follows(self._other, self.rate_hz, _OFF_S):
            self._other = reading
        elif _age(self._other, reading) >= _ADOPT_S:
            self._first, self._last, self._other = self._other, reading, None
            self._sure, self._behind = reading, None

    @property
    def rate_hz(self) -> float:
        """Samples per second of our clock: the nominal rate, unless the device is seen to differ clearly."""
        return self._rate_hz or self._nominal_hz

    def sample_at(self, before_s: float, after_s: float) -> tuple[int, float] | None:
        """The sample of an instant between the two, and the uncertainty in seconds; None without readings."""
        sure = self._sure
        if sure is None:
            return None
        passed_s = 0.5 * (before_s + after_s) - 0.5 * (sure.before_s + sure.after_s)
        uncertain_s = 0.5 * (after_s - before_s) + 0.5 * sure.width_s + self._rate_error * passed_s
        if self._behind is not None:  # held up, or the clock has just stood still: nobody knows yet
            uncertain_s += self._lag_s(sure, self._behind)
        return round(sure.samples + passed_s * self.rate_hz), uncertain_s

    def _look_for_delay(self, reading: ClockReading) -> None:
        """A count comes late from a chassis that is about to go; one that stays behind is the clock's."""
        assert self._sure is not None
        if self._lag_s(self._sure, reading) <= 0.0:
            self._sure, self._behind = reading, None
        elif self._behind is None or self._lag_s(self._behind, reading) > 0.0:
            self._behind = reading
        elif _age(self._behind, reading) >= _ADOPT_S:
            self._sure, self._behind = reading, None

    def _lag_s(self, earlier: ClockReading, reading: ClockReading) -> float:
        """Seconds by which a count is certainly behind the line through an earlier one."""
        taken_s = (reading.samples - earlier.samples) / self.rate_hz
        return reading.before_s - earlier.after_s - taken_s - self._rate_error * _age(earlier, reading)

    def _look_at_rate(self) -> None:
        assert self._first is not None and self._last is not None
        span_s = _age(self._first, self._last)
        if span_s < _SPAN_S:
            return
        seen = _slope(self._first, self._last)
        if abs(seen / self._nominal_hz - 1.0) <= _PLAUSIBLE:
            self._rate_hz, self._rate_error = self._nominal_hz, _OSCILLATOR
        elif self._rate_hz is None:
            self._look_for_another_rate(self._first, self._last, span_s)
        elif abs(seen / self._rate_hz - 1.0) < _PLAUSIBLE:
            self._take_rate(seen, self._first, self._last)

    def _look_for_another_rate(self, first: ClockReading, last: ClockReading, span_s: float) -> None:
        """Only a rate that both halves of the readings show: one leap of a clock shows none."""
        if self._middle is None:
            if span_s >= 0.5 * _OTHER_RATE_SPAN_S:
                self._middle = last
        elif span_s >= _OTHER_RATE_SPAN_S:
            early, late = _slope(first, self._middle), _slope(self._middle, last)
            if abs(late / early - 1.0) <= _PLAUSIBLE:
                self._take_rate(_slope(first, last), first, last)
            else:
                self._first, self._middle = self._middle, None

    def _take_rate(self, rate_hz: float, first: ClockReading, last: ClockReading) -> None:
        self._rate_hz = rate_hz
        self._rate_error = 0.5 * (first.width_s + last.width_s) / _age(first, last)


def _slope(earlier: ClockReading, later: ClockReading) -> float:
    return (later.samples - earlier.samples) / _age(earlier, later)


def _age(earlier: ClockReading, later: ClockReading) -> float:
    return 0.5 * (later.before_s + later.after_s - earlier.before_s - earlier.after_s)
