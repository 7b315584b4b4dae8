"""Shapes on the grid in which the wall and its base differ from a rigid block: side, moment, slip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.motion_grid import SETTLING_S, Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.tolerances.sensors import PLAY_RAD
from sim_hardware.dynamics.parameters import SLIDE_SPEED

Term = tuple[float, str, Callable[[], FloatArray]]
"""Size of a shape, its name, and how it is made, (m,) on the grid."""
UPRIGHT_RAD = 1e-4
"""Rotation over which the reaction goes from one edge to the other."""


def side_of(theta: FloatArray) -> FloatArray:
    """Which edge carries the wall, −1 … 1: the mean of tanh(θ/0.1 mrad) over each interval of the grid.

    In the interval of an impact the wall is on both edges in turn. The sign of its mean rotation would
    be wrong there, and an explanatory variable with errors makes every coefficient too small.
    """
    half = np.maximum(0.5 * np.abs(np.gradient(theta)), 1e-3 * UPRIGHT_RAD)

    def integral(rotation: FloatArray) -> FloatArray:
        size = np.abs(rotation) / UPRIGHT_RAD
        return size + np.log1p(np.exp(-2.0 * size))

    return 0.5 * UPRIGHT_RAD / half * (integral(theta + half) - integral(theta - half))


def moment_shape(theta: FloatArray, alpha: float) -> FloatArray:
    """Overturning moment, (m,), over its largest value: sgn θ · sin(α − |θ|)/sin α, rounded at upright."""
    return np.asarray(side_of(theta) * np.sin(alpha - np.abs(theta)) / np.sin(alpha))


def with_play(values: FloatArray, plays: FloatArray) -> FloatArray:
    """What is read of values (m,) through each of some plays (k,) in their unit, (k, m).

    From the middle of a play on: the reading stays where the values turn back until the play is taken up,
    and follows half of it behind.
    """
    low, high = values - 0.5 * plays[:, None], values + 0.5 * plays[:, None]
    # Each sample keeps the reading before it between two ends, and so do several in a row: from the ends of
    # one sample on, those of twice as many follow each time.
    span = 1
    while span < values.size:
        ends = [np.clip(side[:, :-span], low[:, span:], high[:, span:]) for side in (low, high)]
        low[:, span:], high[:, span:] = ends
        span *= 2
    return np.asarray(np.clip(values[0], low, high))


def play_shape(theta: FloatArray) -> FloatArray:
    """What a small play adds to a reading of the rotation, (m,), over that play: −½ … ½."""
    return np.asarray((with_play(theta, np.array([PLAY_RAD]))[0] - theta) / PLAY_RAD)


def stepped_shape(grid: Grid, *, alternating: bool, power: int = 1) -> FloatArray:
    """Sum of the approach speeds of the impacts so far, with their signs or without, less its last value.

    The zero is at rest. The mean over each interval of the grid: in that of an impact only a part of it is
    after the step. With a `power` of 2 the squares of the speeds over `SLIDE_SPEED` are summed.
    """
    speeds = grid.approach if alternating else np.abs(grid.approach)
    speeds = speeds * (np.abs(grid.approach) / SLIDE_SPEED) ** (power - 1)
    return _after(grid) @ speeds - float(np.sum(speeds))


def turn_shape(grid: Grid, impact: int) -> FloatArray:
    """The approach speed of one impact, rad/s, without sign, from that impact on, (m,); 0 before."""
    return _after(grid)[:, impact] * abs(float(grid.approach[impact]))


def top_shape(grid: Grid, impact: int) -> FloatArray:
    """The same from the middle of the half-cycle after that impact on, (m,), rad/s."""
    middle_s = 0.5 * (grid.impact_s[impact] + grid.impact_s[impact + 1])
    return np.where(grid.time_s > middle_s, abs(float(grid.approach[impact])), 0.0)


def turning_shape(grid: Grid, *, alternating: bool) -> FloatArray:
    """What `stepped_shape` is ahead of a wall that takes a while to turn at each impact, (m,), rad/s.

    It slides about its corner for some hundredths of a second: with a time constant of `SETTLING_S` here.
    """
    speeds = grid.approach if alternating else np.abs(grid.approach)
    since_s = grid.time_s[:, None] - grid.impact_s[None, :]
    lacking: FloatArray = np.where(since_s > 0.0, np.exp(-np.maximum(since_s, 0.0) / SETTLING_S), 0.0)
    return lacking @ speeds


def _after(grid: Grid) -> FloatArray:
    """Share of each interval of the grid that is after each impact, (m, n)."""
    return np.clip((grid.time_s[:, None] - grid.impact_s[None, :]) * GRID_HZ + 0.5, 0.0, 1.0)
