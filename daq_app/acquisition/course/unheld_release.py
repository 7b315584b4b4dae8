"""A wall that rocks though it was never held still: a rope that broke, a hand that slipped.

The phase detector of the analysis begins with a steady hold, since a good test does. This watch says only
that the wall moves freely and when it rests again, so that such a release is recorded and ended as well.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from daq_app.rocking.motion.phases import PhaseEvent

_SMALLEST_SHARE: Final = 0.06
"""|θ|/α of the smallest fall that counts: the smallest hold that counts for the phase detector."""
_FREE_SHARE: Final = 0.5
"""Share of the speed of a fall from there, at upright, that a crossing must have. No hand lowers so fast."""
_QUIET_RAD_S: Final = 0.03
_QUIET_S: Final = 1.0


class UnheldReleaseWatch:
    """Feed it rotation and velocity while the phase detector waits; it answers with release, impact, rest."""

    def __init__(self, rig: Rig, rate_hz: float) -> None:
        alpha, p = rig.specimen.alpha0_rad, rig.specimen.p_rad_s
        fallen = math.cos(alpha - _SMALLEST_SHARE * alpha) - math.cos(alpha)
        self._speed_rad_s = _FREE_SHARE * p * math.sqrt(2.0 * fallen)
        self._rate_hz = rate_hz
        self._smallest_rad = _SMALLEST_SHARE * alpha
        self._last_rad = 0.0
        self._peak_rad = 0.0
        """Largest |θ| since the wall came through upright."""
        self._quiet_samples = 0
        self.rocks = False

    def reset(self) -> None:
        """A run has ended, or the phase detector has taken over."""
        self.rocks, self._quiet_samples, self._peak_rad = False, 0, 0.0

    def process(
        self, first_sample: int, rotation_rad: NDArray[np.float64], velocity_rad_s: NDArray[np.float64]
    ) -> tuple[PhaseEvent, ...]:
        """What happened in these samples, at most one crossing and one rest."""
        if not rotation_rad.size:
            return ()
        joined = np.concatenate(([self._last_rad], rotation_rad))
        self._last_rad = float(rotation_rad[-1])
        fast = (joined[:-1] * joined[1:] <= 0.0) & (np.abs(velocity_rad_s) > self._speed_rad_s)
        events = []
        place = int(np.argmax(fast)) if fast.any() else rotation_rad.size
        peak_rad = max(self._peak_rad, float(np.abs(joined[: place + 1]).max()))
        if fast.any() and (self.rocks or peak_rad >= self._smallest_rad):
            at = first_sample + place
            if not self.rocks:
                self.rocks = True
                text = "released without a steady hold before"
                events.append(self._event("release", at, float(rotation_rad[place]), text))
            events.append(self._event("impact", at, 0.0, "impact"))
        last = np.flatnonzero(joined[:-1] * joined[1:] <= 0.0)
        since = int(last[-1]) + 1 if last.size else 0
        peak_rad = 0.0 if last.size else self._peak_rad
        self._peak_rad = max(peak_rad, float(np.abs(joined[since:]).max()))
        quiet = bool((np.abs(velocity_rad_s) < _QUIET_RAD_S).all())
        self._quiet_samples = self._quiet_samples + rotation_rad.size if quiet else 0
        if self.rocks and self._quiet_samples >= _QUIET_S * self._rate_hz:
            at = first_sample + rotation_rad.size - self._quiet_samples
            events.append(self._event("rest", at, self._last_rad, "at rest"))
            self.reset()
        return tuple(events)

    @staticmethod
    def _event(kind: str, sample: int, rotation_rad: float, text: str) -> PhaseEvent:
        return PhaseEvent(kind, float(sample), sample, rotation_rad, text)
