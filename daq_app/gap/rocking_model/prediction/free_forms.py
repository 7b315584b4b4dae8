"""Free forms for restoring and loss: what no named effect says of the swings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.vector import half_cycle_table
from sim_hardware.dynamics import parameters as par

_MIDDLE = 0.1
"""Peak, as a share of α, whose damping a growth with the amplitude leaves as it is."""
_ZETA_STEP = 1e-4


def free_times(run: RockingRun, values: Mapping[str, float]) -> FloatArray | float:
    """Free forms of the probes: time features as piecewise linear functions of the peak."""
    restoring, loss = "free_restoring.t0" in values, "free_dissipation.t0" in values
    if not (restoring or loss):
        return 0.0
    total = np.zeros(len(run.places))
    kind, low, share, direction = run.cache.constant("free basis", lambda: _free_basis(run))
    if restoring:
        knots = np.array([values[f"free_restoring.t{i}"] for i in range(9)])
        first = knots[3 * kind + low]
        total += first + (knots[3 * kind + low + 1] - first) * share
    if loss:
        knots = np.array([values[f"free_dissipation.t{i}"] for i in range(6)] + [0.0] * 3)
        first = knots[3 * kind + low]
        total += direction * (first + (knots[3 * kind + low + 1] - first) * share)
    return total


def _free_basis(run: RockingRun) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
    """Per time feature: part of the half-cycle (upper, lower, turning), knot, share, fall or rise."""
    count = run.swings.levels.shape[1]
    ka, a, kb, b = run.places.T
    falls = (a < count) & (b < count)
    turning = (ka != kb) | ((a >= count) & (b < count))
    nearer = np.where(falls, b, a - count)
    kind = np.where(turning, 2, np.clip(nearer, 1, 2) - 1)
    size = np.abs(run.swings.peak_rad[ka]) / run.survey.alpha_rad
    place = np.interp(size, (0.0, 0.15, 0.4), (0.0, 1.0, 2.0))
    low = np.minimum(place.astype(int), 1)
    direction = np.where(turning, 0.0, np.where(falls, 1.0, -1.0))
    return kind, low, place - low, direction


def with_uneven_loss(
    run: RockingRun,
    values: Mapping[str, float],
    vector: FloatArray,
    true: FloatArray,
    levels: FloatArray,
    table: FloatArray,
) -> FloatArray:
    """The table of half-cycles, (n, 5 + 2F), with an equivalent damping of each half-cycle's own.

    To first order, which is all that a score test asks. What such a loss takes from a half-cycle shows in its
    times and in the speeds at its ends, so in r as well.
    """
    growth, side = values.get("loss_growth.zeta", 0.0), values.get("loss_side.zeta", 0.0)
    if growth == 0.0 and side == 0.0:
        return table
    zeta = growth * np.log(np.abs(true) / (_MIDDLE * run.survey.alpha_rad)) + side * np.sign(true)
    ahead, behind = vector.copy(), vector.copy()
    ahead[par.ZETA] += _ZETA_STEP
    behind[par.ZETA] -= _ZETA_STEP
    damped_more, damped_less = (half_cycle_table(run, v, true, levels) for v in (ahead, behind))
    moved: FloatArray = table + zeta[:, None] * (damped_more - damped_less) / (2.0 * _ZETA_STEP)
    return moved
