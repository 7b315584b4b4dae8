"""From the core's named values to the simulator's parameter vector."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import G_M_S2
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import shooting
from sim_hardware.dynamics.effects import MOTION_EFFECTS

TOLERANCE = 1e-10
"""Local error of the integrator, relative to the half-cycle: times good to nanoseconds."""
_OF_IMPACTS = (par.R_SLOPE, par.R_SLOPE_SPEED, par.R_ASYMMETRY, par.CRUSH_R, par.UNEVEN_IMPACT)
_BESIDE = ("flexible_wall", "yaw", "twist", "sliding", "sliding_on", "corner_twist")
"""Effects that do not move the rotation of the joint."""
_INDEX = {
    f"{spec.name}.{p.name}": p.index
    for spec in MOTION_EFFECTS
    for p in spec.parameters
    if p.index >= 0 and p.index not in _OF_IMPACTS and spec.name not in _BESIDE
}
_DEFAULTS = {
    spec.name: [
        (f"{spec.name}.{p.name}", p.index, p.default)
        for p in spec.parameters
        if p.default is not None and p.index >= 0
    ]
    for spec in MOTION_EFFECTS
}
PROBE_SPEEDS = (0.0, 0.1, 0.2, 0.3, 0.45)
"""Knots of the free r(v), rad/s."""
_SLOPES = ("restitution_slope.k", "sliding.slope", "sliding_on.slope")
_RESTITUTION = (0.05, 1.2)
"""Ends between which a fit may try coefficients of restitution: far beyond what walls have."""
_MIDDLE_SPEED = 0.36
"""Share of p α: the mean speed of the impacts of a run. About it a curvature of r(v) has neither value nor
slope, so that the priors of r and of its slope say nothing of it."""


def kernel_vector(run: RockingRun, values: Mapping[str, float]) -> FloatArray:
    """Parameter vector of the simulator's half-cycles, which know no impact and so no r."""
    vector = np.zeros(par.N_PARAMETERS)
    alpha = values["alpha"]
    vector[par.ALPHA], vector[par.P] = alpha, values["p"]
    vector[par.R0] = values["half_base"] / math.sin(alpha)
    vector[par.RESTITUTION] = 1.0
    vector[par.TOLERANCE] = TOLERANCE
    vector[par.REST_AMPLITUDE] = par.REST_AMPLITUDE_RAD
    vector[par.DURATION] = 1e9
    vector[par.IMPACTS_BEFORE] = run.impacts_before
    for key, index in _INDEX.items():
        value = values.get(key)
        if value is None:
            continue
        for other, place, default in _DEFAULTS[key.rpartition(".")[0]]:
            if other not in values:
                vector[place] = default
        vector[index] = value
    vector[par.OMEGA0] += values["omega0"] + values.get("initial_velocity.own", 0.0)
    vector[par.BASE_TILT] += values["lean"]
    vector[par.ALPHA_ASYMMETRY] += values["uneven"]
    vector[par.COULOMB] += values.get("loss_power.mu", 0.0)
    return vector


@dataclass(frozen=True, slots=True)
class HalfCycles:
    """The simulator's half-cycles from the peaks of a run."""

    vector: FloatArray
    """Parameter vector of the simulator."""
    true: FloatArray
    """(n,) peaks, rad."""
    levels: FloatArray
    """(n, F) rotations at which they are timed, rad."""
    table: FloatArray
    """(n, 5 + 2F)."""


def half_cycle_table(run: RockingRun, vector: FloatArray, true: FloatArray, levels: FloatArray) -> FloatArray:
    """The simulator's half-cycles from the peaks `true` (n,), rad, timed at `levels` (n, F): (n, 5 + 2F)."""
    table = np.empty((true.size, shooting.FIRST_CROSSING + 2 * levels.shape[1]))
    side = 1.0 if run.swings.peak_rad[0] > 0 else -1.0
    shooting.half_cycles(vector, run.swings.peak_s, true, levels, side, True, table)
    return table


def _curvature(run: RockingRun, values: Mapping[str, float], speeds: FloatArray) -> FloatArray | float:
    """What the departures from a straight r(v) add."""
    power, square = values.get("slope_power.c", 0.0), values.get("slope_square.c", 0.0)
    if power == square == 0.0:
        return 0.0
    middle = _MIDDLE_SPEED * run.survey.p_rad_s * run.survey.alpha_rad
    off = speeds - middle
    return power * (speeds * np.log(np.maximum(speeds, 1e-6) / middle) - off) + square * off**2


def _uneven_impact(values: Mapping[str, float]) -> float:
    """What an impact that ends a swing to +x takes beyond the mean of both sides, relative to r.

    As `sim_hardware.dynamics.terms.uneven_impact`, with a share of each effect's own.
    """
    lever = values.get("eccentric_mass.e", 0.0) * values.get("eccentric_mass.plastic", 0.0)
    unequal = values.get("alpha_asymmetry.delta", 0.0) * values.get("alpha_asymmetry.plastic", 0.0)
    if lever == unequal == 0.0:
        return 0.0
    alpha, p = values["alpha"], values["p"]
    lever -= unequal * values["half_base"] / (math.sin(alpha) * math.cos(alpha))
    return 2.0 * lever * p * p * math.sin(alpha) / G_M_S2


def restitution_of(
    run: RockingRun,
    values: Mapping[str, float],
    speeds: FloatArray,
    sides: FloatArray,
    impacts: NDArray[np.intp],
) -> FloatArray:
    """r of each impact, (k,), as the simulator's impact rule has it, plus free forms.

    `speeds` before the impacts, rad/s; `sides` that the wall comes from, ±1; `impacts` counted from 0.
    """
    slope = values["r_slope"] + sum(values.get(key, 0.0) for key in _SLOPES)
    r = values["r"] + slope * (speeds - 0.2)
    r = r + _curvature(run, values, speeds)
    r = r + sides * (values["r_sides"] + values.get("restitution_asymmetry.d", 0.0))
    r = r * (1.0 - sides * _uneven_impact(values))
    if "free_restitution.k0" in values:
        knots = [values[f"free_restitution.k{i}"] for i in range(len(PROBE_SPEEDS))]
        r = r + np.interp(speeds, PROBE_SPEEDS, knots) + sides * values["free_restitution.side"]
        r = r + values["free_restitution.order"] * impacts / 10.0
    r = r * (1.0 - values.get("restitution_wear.loss", 0.0) * 0.01 * (run.impacts_before + impacts))
    return np.clip(r, *_RESTITUTION)
