"""Free forms for restoring and loss: what no named effect says of the swings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.pivots import wear_growth
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.vector import HalfCycles, half_cycle_table
from sim_hardware.dynamics import parameters as par

_MIDDLE = 0.1
"""Peak, as a share of α, whose damping a growth with the amplitude leaves as it is."""
_ZETA_STEP = 1e-4
_RADIUS_STEP_M = 1e-3
_LOSS_STEP = 1e-4
_FREE_TIMES = {"free_restoring": "", "free_dissipation": "way", "free_geometry": "side"}
"""How the times of a free form go with the half-cycle, by its name; empty for one that is the same in all."""


def free_times(run: RockingRun, values: Mapping[str, float]) -> FloatArray | float:
    """Free forms of the probes: time features as piecewise linear functions of the peak."""
    forms = [form for form in _FREE_TIMES if f"{form}.t0" in values]
    if not forms:
        return 0.0
    total = np.zeros(len(run.places))
    basis = run.cache.constant("free basis", lambda: _free_basis(run))
    for form in forms:
        knots = np.array([values.get(f"{form}.t{i}", 0.0) for i in range(9)])
        first = knots[3 * basis.kind + basis.low]
        at_peak = first + (knots[3 * basis.kind + basis.low + 1] - first) * basis.share
        total += at_peak * (getattr(basis, _FREE_TIMES[form]) if _FREE_TIMES[form] else 1.0)
    return total


@dataclass(frozen=True, slots=True)
class _FreeBasis:
    """Where on a free form each time feature is, (T,) each."""

    kind: NDArray[np.intp]
    """Part of the half-cycle: upper, lower, turning."""
    low: NDArray[np.intp]
    """Knot below the peak."""
    share: FloatArray
    """Share of the way from that knot to the next."""
    way: FloatArray
    """1 in a fall, −1 in a rise, 0 over the top and across an impact."""
    side: FloatArray
    """1 at x > 0, −1 at x < 0, 0 across an impact."""


def _free_basis(run: RockingRun) -> _FreeBasis:
    count = run.swings.levels.shape[1]
    ka, a, kb, b = run.places.T
    falls = (a < count) & (b < count)
    turning = (ka != kb) | ((a >= count) & (b < count))
    nearer = np.where(falls, b, a - count)
    kind = np.where(turning, 2, np.clip(nearer, 1, 2) - 1)
    peaks = run.swings.peak_rad[ka]
    place = np.interp(np.abs(peaks) / run.survey.alpha_rad, (0.0, 0.15, 0.4), (0.0, 1.0, 2.0))
    low = np.minimum(place.astype(int), 1)
    way = np.where(turning, 0.0, np.where(falls, 1.0, -1.0))
    side = np.where(ka == kb, np.sign(peaks), 0.0)
    return _FreeBasis(kind, low, place - low, way, side)


def departed(run: RockingRun, values: Mapping[str, float], cycles: HalfCycles) -> FloatArray:
    """The table of half-cycles, (n, 5 + 2F), with first steps away from the forms of loss, edges and wear.

    To first order, which is all that a score test asks.
    """
    forms = (_uneven_loss, _uneven_edges, _unsteady_wear)
    return cycles.table + sum(form(run, values, cycles) for form in forms)


def _uneven_loss(run: RockingRun, values: Mapping[str, float], cycles: HalfCycles) -> FloatArray | float:
    """What an equivalent damping of each half-cycle's own adds, (n, 5 + 2F).

    What it takes from a half-cycle shows in its times and in the speeds at its ends, so in r as well.
    """
    growth, side = values.get("loss_growth.zeta", 0.0), values.get("loss_side.zeta", 0.0)
    if growth == 0.0 and side == 0.0:
        return 0.0
    true = cycles.true
    zeta = growth * np.log(np.abs(true) / (_MIDDLE * run.survey.alpha_rad)) + side * np.sign(true)
    damped_more, damped_less = (_moved(run, cycles, par.ZETA, step) for step in (_ZETA_STEP, -_ZETA_STEP))
    return zeta[:, None] * (damped_more - damped_less) / (2.0 * _ZETA_STEP)


def _uneven_edges(run: RockingRun, values: Mapping[str, float], cycles: HalfCycles) -> FloatArray | float:
    """What an edge at x > 0 adds that is round, where the other is as much sharper, (n, 5 + 2F)."""
    radius = values.get("uneven_edges.rho", 0.0)
    if radius == 0.0:
        return 0.0
    rolling = _moved(run, cycles, par.EDGE_RADIUS, _RADIUS_STEP_M) - cycles.table
    return np.sign(cycles.true)[:, None] * rolling * (radius / _RADIUS_STEP_M)


def _unsteady_wear(run: RockingRun, values: Mapping[str, float], cycles: HalfCycles) -> FloatArray | float:
    """What edges add that wear as a power of the number of impacts, (n, 5 + 2F).

    What the steady wear of CRUSH_ALPHA adds to each half-cycle goes with the number before it already.
    """
    loss = values.get("wear_power.loss", 0.0)
    if loss == 0.0:
        return 0.0
    impacts = run.impacts_before + np.arange(len(cycles.true))
    steady = (_moved(run, cycles, par.CRUSH_ALPHA, _LOSS_STEP) - cycles.table) / _LOSS_STEP
    return loss * wear_growth(impacts)[:, None] * steady


def _moved(run: RockingRun, cycles: HalfCycles, index: int, step: float) -> FloatArray:
    """The table with one of the simulator's parameters moved by a step."""
    vector = cycles.vector.copy()
    vector[index] += step
    return half_cycle_table(run, vector, cycles.true, cycles.levels)
