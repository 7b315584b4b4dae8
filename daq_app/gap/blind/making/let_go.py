"""How visible it is that a wall is not simply let go at rest.

A push towards upright looks like a release some milliseconds earlier, and a rope that gives way slowly like a
later one. When a wall is let go is known from its fall alone, and from which rotation within what the hold
shows: both are refitted, and what the push or the rope leaves of that is what can be seen.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from daq_app.gap.blind.world.arrays import FloatArray
from daq_app.gap.blind.world.events.mechanics import build
from daq_app.gap.blind.world.events.motion import Followed, integrate
from daq_app.gap.blind.world.wall import Wall

LET_GO: Final = {"initial_velocity", "slow_release"}
"""Effects that are nothing but another start of the fall."""
_STEP_RAD: Final = 1e-4
_SCALES: Final = np.array([1e-3, 1e-5])
"""Units of the search: in them it counts the time, s, and the rotation, rad, at which the wall is let go."""


def left_by_a_release_at_rest(motion: Followed, wall: Wall, time_s: FloatArray) -> FloatArray:
    """Rotation (n,), rad, at rising times (n,), s, which no release at rest explains; 0 from the impact on.

    The wall falls as a rigid block. Time and rotation of its release are those of the least squares.
    """
    release = replace(motion.release, omega0=0.0)
    wider = replace(release, theta0=release.theta0 + _STEP_RAD)
    at_rest, from_wider = (integrate(build(wall, {}, start), start) for start in (release, wider))
    last_s = 0.9 * min(motion.impacts[0].time, at_rest.impacts[0].time)
    falling_s = time_s[time_s < last_s]
    seen = motion.sample(falling_s)[0]

    def left(x: FloatArray) -> FloatArray:
        shifted_s = falling_s - _SCALES[0] * x[0]
        rotation = at_rest.sample(shifted_s)[0]
        per_rad = (from_wider.sample(shifted_s)[0] - rotation) / _STEP_RAD
        return np.asarray(seen - rotation - _SCALES[1] * x[1] * per_rad)

    best = least_squares(left, np.zeros(2), diff_step=1e-3, x_scale=1.0)
    return np.concatenate([best.fun, np.zeros(time_s.size - falling_s.size)])
