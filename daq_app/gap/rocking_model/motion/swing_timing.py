"""How late the accelerometers are against the reference rotation, from the motion between impacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray, independent_fraction
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import gridded, pseudo_inverse, straight_line
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun
from daq_app.gap.rocking_model.tolerances.motion import FREE_FROM_S, LEAST_INDEPENDENT
from daq_app.gap.rocking_model.tolerances.sensors import (
    ACCELEROMETER_SPREAD_M,
    DELAY_FORM,
    DELAY_WITHOUT_ONE,
    LATE_S,
)
from daq_app.gap.rocking_model.tolerances.walls import MIDDLE_OF_IMPACT_S

_ROUNDS = 3
_WALK = 3
"""Order of the polynomial that the zero of an accelerometer walks by while a wall rocks."""


def swing_delay(run: GapRun, grid: Grid, of_impacts_s: float | None) -> tuple[float, float] | None:
    """(delay, its variance), s, or None where it cannot be told; `of_impacts_s` is what the impacts show.

    At height z the specific force is z θ̈ − g sin θ. Extrapolated to z = 0 it is gravity alone, which
    changes with g θ̇, while two thirds up the wall (the centre of percussion) inertia takes all of that
    away. Calibrations, the pivot and a base that gives way do the same on the way up and on the way down; a
    delay changes sign at every peak. How an impact looks does not enter, and no second derivative either.
    """
    chosen = run.steady_accelerometers("x")
    if not grid.impact_s.size or not chosen:
        return None
    late = 0.0 if of_impacts_s is None else of_impacts_s - MIDDLE_OF_IMPACT_S
    delay: tuple[float, float] | None = None
    for _ in range(_ROUNDS):
        early = round(late * run.rate_hz) if abs(late) > LATE_S else 0
        delay = _in_step(run, grid, chosen, early)
        if delay is None or abs(delay[0] - early / run.rate_hz) < LATE_S:
            break
        late = delay[0]
    return delay


def _in_step(run: GapRun, grid: Grid, chosen: list[int], early: int) -> tuple[float, float] | None:
    """(delay, variance) from records that are taken `early` samples sooner."""
    foot = _Foot.of(run, grid, np.array([gridded(run, i, early) for i in chosen]), chosen)
    whole = None if foot is None else foot.delay(np.ones(len(chosen), dtype=bool))
    if foot is None or whole is None:
        return None
    delay, variance = whole
    for k in range(len(chosen)):
        without = foot.delay(np.arange(len(chosen)) != k)
        if without is not None:
            # The lowest one has most of the say. Where the others do not bear it out, nobody knows better.
            chance = DELAY_WITHOUT_ONE**2 * abs(without[1] - whole[1])
            variance = max(variance, whole[1] + (without[0] - delay) ** 2 - chance)
    undone = early / run.rate_hz
    return undone + delay, variance + (DELAY_FORM * undone) ** 2


@dataclass(frozen=True, slots=True)
class _Foot:
    """Accelerometers between impacts and what they show where they are extrapolated to the foot."""

    rows: FloatArray
    """(k, n) each accelerometer less gravity and its share of ω² about the edge, m/s²."""
    heights_m: FloatArray
    design: FloatArray
    """(n, m): a zero that walks, gravity, inertia of unequal calibrations, rate of gravity: a delay."""
    inverse: FloatArray
    """(m, n)"""

    @classmethod
    def of(cls, run: GapRun, grid: Grid, rows: FloatArray, chosen: list[int]) -> _Foot | None:
        free = (grid.time_s > FREE_FROM_S) & (grid.time_s < grid.impact_s[-1])
        pick = free & ~grid.near_impact & grid.valid
        theta, omega = grid.theta[pick], grid.omega[pick]
        gravity = -GRAVITY_M_S2 * np.sin(theta)
        zero = np.polynomial.legendre.legvander(grid.time_s[pick] / grid.impact_s[-1] * 2.0 - 1.0, _WALK)
        rate = GRAVITY_M_S2 * np.cos(theta) * omega
        design = np.column_stack([zero, gravity, grid.alpha[pick], rate])
        if len(design) < 20 * design.shape[1]:
            return None
        places = run.positions(chosen)
        arms = places[:, :1] - np.sign(theta) * run.survey.half_base_m
        beyond = rows[:, pick] - gravity + omega**2 * arms
        return cls(beyond, places[:, 2], design, pseudo_inverse(design))

    def delay(self, used: NDArray[np.bool_]) -> tuple[float, float] | None:
        """(delay, variance), s, by some of the accelerometers, (k,); None for too few or too near ones."""
        z = self.heights_m[used]
        if z.size < 3 or np.ptp(z) < ACCELEROMETER_SPREAD_M:
            return None
        difference = straight_line(z)[0] @ self.rows[used]
        coefficients = self.inverse @ difference
        left = difference - self.design @ coefficients
        fraction = max(independent_fraction(left), LEAST_INDEPENDENT)
        variance = float(left @ left) / (left.size - self.design.shape[1]) / fraction
        return float(coefficients[-1]), variance * float(self.inverse[-1] @ self.inverse[-1])
