"""Is the sample clock what it says? Compared with this computer's monotonic clock while sampling goes on.

Each reading says that between two instants of our clock the device had taken so many samples. From two
readings follow a lower and an upper bound of the rate that no delay of the reply can make wrong; they close
in as time goes by (a reply of 0.5 ms: ±25 ppm after 40 s). A device that counts in lumps, as they come over
its cable, widens the bounds by what is seen of that in the first seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from drivers import ClockReading

DRIFT_PPM: Final = 20.0
"""A clock that is proven to be further off than this is told: NI's own oscillators keep 50 ppm."""
_JUMP_S: Final = 0.05
"""Time that the clock stood still, or that ours did, from which on it is told."""
_SETTLED_S: Final = 0.5
"""A deficit that does not grow or shrink for so long, while samples come, will not be made up."""
_NEAR_S: Final = 60.0
_FAR_S: Final = 600.0
_FIRST_S: Final = 1.0
_LUMPS_S: Final = 5.0
_PROOFS: Final = 10
"""So many sharp readings in a row must prove a drift: one late lump of samples is no drift."""
_WRONG_SHARE: Final = 0.02


@dataclass(frozen=True, slots=True)
class ClockNews:
    """Something that the operator and the run must know."""

    name: str
    """rate, drift, stood_still or asleep"""
    sample: int
    text: str
    value: float
    """Samples per second, ppm, or seconds."""


class ClockWatch:
    """Feed it every reading, in order; `restart` after the tasks were started again."""

    def __init__(self, rate_hz: float, speed: float = 1.0) -> None:
        """`speed` is how much faster than real time a simulated device or a replay runs."""
        self._nominal_hz = rate_hz
        self._speed = speed
        self._expected = rate_hz * speed
        self._nominal = True
        """False once the device has been seen to take samples at another rate than it says."""
        self._told: set[str] = set()
        self.restart()

    def restart(self) -> None:
        """Forget the readings, not what was told."""
        self._far: ClockReading | None = None
        self._near: ClockReading | None = None
        self._middle: ClockReading | None = None
        """Up to which the first second looked like another rate: the next one tells a rate from a leap."""
        self._bounds = (0.0, float("inf"))
        self._lag_s = (-float("inf"), float("inf"))
        self._sharpest_s = float("inf")
        self._proofs = 0
        self._deficit: tuple[float, float, int] | None = None
        """Since when, how much, and after which sample: a lack of samples that may still be made up."""
        self._last_good = 0

    @property
    def drift_ppm(self) -> tuple[float, float]:
        """Bounds of how much the clock is fast; infinite until known."""
        return 1e6 * (self._bounds[0] / self._expected - 1.0), 1e6 * (self._bounds[1] / self._expected - 1.0)

    def take(self, reading: ClockReading) -> ClockNews | None:
        """What this reading shows for the first time."""
        if self._far is None or self._near is None:
            self._far = self._near = reading
            self._last_good = reading.samples
            return None
        young = reading.before_s - self._far.after_s < _FIRST_S
        sharper = reading.width_s < self._far.width_s
        if young and sharper and reading.follows(self._far, self._expected, _JUMP_S):
            self._far = self._near = reading  # a sharper reading to count from
            return None
        if "rate" not in self._told:
            return self._judge_rate(self._far, reading)
        news = self._judge_jump(self._near, reading)
        if news is None and self._deficit is None:
            if self._nominal:
                news = self._judge_drift(self._far, reading)
            elif not young:  # nobody knows what this clock should be: the longer it is seen, the better
                low, high = _rate_bounds(self._far, reading)
                self._expected = 0.5 * (low + high)
            if reading.before_s - self._near.after_s > _NEAR_S:
                self._near = reading
        return news

    def _judge_rate(self, far: ClockReading, reading: ClockReading) -> ClockNews | None:
        """Nobody's oscillator is off by 2 %: an external clock, a wrong setting, a device that runs fast.

        A clock that only stood still, or a computer that did, looks like that for one second, not for two.
        """
        since = self._middle or far
        if reading.before_s - since.after_s < _FIRST_S:
            if self._middle is None and reading.follows(far, self._expected, _JUMP_S):
                self._last_good = reading.samples
            return None
        low, high = _rate_bounds(since, reading)
        if high > (1 - _WRONG_SHARE) * self._expected and low < (1 + _WRONG_SHARE) * self._expected:
            self._told.add("rate")
            return None
        if self._middle is None:
            self._middle = reading
            return None
        before = _rate_bounds(far, self._middle)
        if high < (1 - _WRONG_SHARE) * before[0] or low > (1 + _WRONG_SHARE) * before[1]:
            self._far = self._near = self._middle  # two seconds that differ: the next one decides
            self._middle = reading
            return None
        self._told.add("rate")
        seen = 0.5 * (low + high)
        self._nominal, self._expected = False, seen
        self._far = self._near = reading
        return ClockNews(
            "rate",
            reading.samples,
            f"The device takes {seen / self._speed:.0f} samples a second where its clock says "
            f"{self._nominal_hz:g}: every time and r of this run would be wrong. Check the source of the "
            "sample clock (a simulated device that runs faster: say so with --speed)",
            seen,
        )

    def _judge_jump(self, near: ClockReading, reading: ClockReading) -> ClockNews | None:
        elapsed_least = reading.before_s - near.after_s
        elapsed_most = reading.after_s - near.before_s
        taken = reading.samples - near.samples
        surplus_s = taken / self._expected - elapsed_most
        if surplus_s > _JUMP_S:
            self._start_anew(reading)
            return ClockNews(
                "asleep",
                reading.samples,
                f"This computer stood still for {surplus_s:.1f} s while the device went on sampling. Switch "
                "off its sleep and energy saving",
                surplus_s,
            )
        missing_s = elapsed_least - taken / self._expected
        if missing_s <= _JUMP_S:
            self._deficit = None
            self._last_good = reading.samples
            return None
        now = reading.before_s
        if self._deficit is None or abs(missing_s - self._deficit[1]) > 0.1 * _JUMP_S + reading.width_s:
            self._deficit = (now, missing_s, self._last_good)
            return None
        since, missing_s, sample = self._deficit
        if now - since < _SETTLED_S:
            return None
        self._start_anew(reading)
        return ClockNews(
            "stood_still",
            sample,
            f"The sample clock stood still for {missing_s:.2f} s after sample {sample}: no sample is "
            "missing, but every later time is too small by that. Check the chassis and the clock's line; if "
            "the wall was moving, its times are not to be used",
            missing_s,
        )

    def _judge_drift(self, far: ClockReading, reading: ClockReading) -> ClockNews | None:
        elapsed_s = reading.before_s - far.after_s
        lag_s = reading.samples / self._expected
        if elapsed_s < _LUMPS_S:
            most, least = self._lag_s
            self._lag_s = max(most, lag_s - reading.after_s), min(least, lag_s - reading.before_s)
            self._sharpest_s = min(self._sharpest_s, reading.width_s)
            return None
        if reading.width_s > 2.0 * self._sharpest_s:
            return None
        lump = max(0.0, self._lag_s[0] - self._lag_s[1]) * self._expected
        self._bounds = _rate_bounds(far, reading, lump)
        fast, slow = self.drift_ppm[0] > DRIFT_PPM, self.drift_ppm[1] < -DRIFT_PPM
        self._proofs = self._proofs + 1 if fast or slow else 0
        if elapsed_s > _FAR_S:
            self._start_anew(reading)
        if self._proofs < _PROOFS or "drift" in self._told:
            return None
        self._told.add("drift")
        off = abs(self.drift_ppm[0] if fast else self.drift_ppm[1])
        word = "fast" if fast else "slow"
        return ClockNews(
            "drift",
            reading.samples,
            f"The sample clock runs {word} by at least {off:.0f} ppm against this computer's clock. Times "
            "are off by that share; r and θ0 are not. Have the device's clock checked if that matters",
            off if fast else -off,
        )

    def _start_anew(self, reading: ClockReading) -> None:
        self.restart()
        self._far = self._near = reading
        self._last_good = reading.samples


def _rate_bounds(first: ClockReading, second: ClockReading, lump: float = 0.0) -> tuple[float, float]:
    """(least, most) samples per second between two readings of a counter with steps of 1 and lumps."""
    taken = second.samples - first.samples
    least = max(second.before_s - first.after_s, 1e-9)
    return (taken - 1 - lump) / (second.after_s - first.before_s), (taken + 1 + lump) / least
