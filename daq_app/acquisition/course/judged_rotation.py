"""The one rotation that gauge, alarm and verdict of a pull are judged by."""

from __future__ import annotations

import math
from typing import Final

from daq_app.config.rig import Rig

STILL_RAD_S: Final = 2e-3
"""Below this speed the wall stands still for a tiltmeter; raising it lets a slow pull shift the level."""
_SETTLED_TIME_CONSTANTS: Final = 4.0
"""A first-order tiltmeter has come within 2 % of a step after four of its time constants."""
_FOLLOWS_S: Final = 0.5
"""Time constant with which the level follows the settled tiltmeters; raising it shows less of their noise."""


class JudgedRotation:
    """Movement from the wires, level from the tiltmeters.

    Wires follow at once and drift; tiltmeters are true and slow: during a pull they show what was a third of
    a second ago. So the wires are moved to the tiltmeters' level once the wall has stood still long enough.
    """

    def __init__(self, rig: Rig) -> None:
        slowest = [c.time_constant_s for c in rig.channels if c.family == "tiltmeter"]
        self._settles_s = _SETTLED_TIME_CONSTANTS * max(slowest, default=0.0)
        self._still_s = 0.0
        self._level_rad = 0.0

    def of_block(
        self, wires_rad: float, fastest_rad_s: float, tilt_rad: float, duration_s: float, *, free: bool
    ) -> float:
        """Rotation (rad) after a block of `duration_s`.

        `wires_rad` is the wires' at its end, `fastest_rad_s` the largest speed in it, `tilt_rad` the
        tiltmeters' mean over it. `free`: the wall rocks, or rests after it; the level is left alone then.
        Where one family is missing (NaN) the other is the answer.
        """
        if not math.isfinite(wires_rad):
            return tilt_rad
        if not math.isfinite(tilt_rad):
            return wires_rad
        still = not free and abs(fastest_rad_s) < STILL_RAD_S
        self._still_s = self._still_s + duration_s if still else 0.0
        if self._still_s > self._settles_s:
            share = -math.expm1(-duration_s / _FOLLOWS_S)
            self._level_rad += share * (tilt_rad - wires_rad - self._level_rad)
        return wires_rad + self._level_rad
