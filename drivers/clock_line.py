"""Where the sample clock stood and stands, by this computer's monotonic clock.

Tasks that had to be started again count from zero; this line says which sample their first one would have
been, had the old tasks gone on, and how well that is known.
"""

from __future__ import annotations

from drivers.protocol import ClockReading

_TRUSTED_SPAN_S = 2.0
_PLAUSIBLE = 0.01
"""Share by which a clock may be off its nominal rate before what was seen counts for more (an external
clock; a simulated device that runs faster than real time)."""


class ClockLine:
    """Feed it the readings; it keeps the first, the last and the sharpest of the last ones."""

    def __init__(self, rate_hz: float) -> None:
        self._nominal_hz = rate_hz
        self._first: ClockReading | None = None
        self._last: ClockReading | None = None

    def add(self, reading: ClockReading) -> None:
        """Readings come in order of time."""
        if self._first is None:
            self._first = reading
        # A late reply is no sharp reading; an old sharp one is better for a while.
        if self._last is None or _width(reading) <= 2.0 * _width(self._last) + 0.01 * _age(
            self._last, reading
        ):
            self._last = reading

    @property
    def rate_hz(self) -> float:
        """Samples per second of our clock: the nominal rate, unless the device is seen to differ clearly."""
        if self._first is None or self._last is None:
            return self._nominal_hz
        span = _age(self._first, self._last)
        if span < _TRUSTED_SPAN_S:
            return self._nominal_hz
        seen = (self._last.samples - self._first.samples) / span
        return seen if abs(seen / self._nominal_hz - 1.0) > _PLAUSIBLE else self._nominal_hz

    def sample_at(self, before_s: float, after_s: float) -> tuple[int, float] | None:
        """The sample of an instant between the two, and the uncertainty in seconds; None without readings."""
        last = self._last
        if last is None:
            return None
        middle = 0.5 * (before_s + after_s) - 0.5 * (last.before_s + last.after_s)
        uncertain_s = 0.5 * (after_s - before_s) + 0.5 * _width(last)
        return round(last.samples + middle * self.rate_hz), uncertain_s


def _width(reading: ClockReading) -> float:
    return reading.after_s - reading.before_s


def _age(earlier: ClockReading, later: ClockReading) -> float:
    return 0.5 * (later.before_s + later.after_s - earlier.before_s - earlier.after_s)
