"""Pivots that are not where the survey has them, as wires and the joint show them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.differences import of_shapes
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import Term, side_of
from daq_app.gap.rocking_model.motion.rotation import pivots_off

_MIDDLE_OF_WEAR = 100.0
"""Impacts after which a wear that goes with another power of their number is as large as a steady one."""


def wear_growth(impacts: ArrayLike) -> FloatArray:
    """How a wear c N^q of edges departs at first from a steady one, per (q − 1) and term: ln(N/N₀)."""
    return np.asarray(np.log(np.maximum(impacts, 1.0) / _MIDDLE_OF_WEAR))


def pivots(run: RockingRun, values: Mapping[str, float]) -> tuple[float, float]:
    """(distance of the pivots from the middle beyond the survey's, half its difference right to left), m."""
    half, alpha = values["half_base"], values["alpha"]
    tall = half / np.tan(alpha)
    faster = wear_growth(run.impacts_before) * values.get("wear_power.loss", 0.0)
    wear = 0.01 * run.impacts_before * (values.get("crushing.loss", 0.0) + faster)
    worn = half - tall * np.tan(alpha * (1.0 - wear))
    inwards = half - run.survey.half_base_m - values.get("pivot_shift.a", 0.0) - worn
    inwards -= values.get("rounded_edge.rho", 0.0)
    unequal = values["uneven"] + values.get("alpha_asymmetry.delta", 0.0)
    apart = unequal * tall / np.cos(alpha) ** 2
    return inwards, apart - values.get("uneven_edges.rho", 0.0)


def turned_by(run: RockingRun, values: Mapping[str, float], theta: FloatArray, name: str) -> FloatArray:
    """What such pivots add to rotations `theta`, rad, of any shape, that are read from the wires.

    `name` is that of the rotations, which are always the same of one run.
    """
    inwards, apart = pivots(run, values)
    each = run.cache.constant(("pivots of", name), lambda: pivots_off(run.wires, theta)[0])
    further = inwards + apart * np.sign(theta)
    if "winkler.theta_c" in values:
        further = further + _on_springs(values, theta)
    return np.asarray(further * each)


def _on_springs(values: Mapping[str, float], theta: FloatArray) -> FloatArray:
    """How much further out, m, a wall on springs turns than on edges, at rotations of any shape, rad."""
    theta_c = values["winkler.theta_c"]
    return -2.0 * values["half_base"] * np.sqrt(theta_c / np.maximum(np.abs(theta), theta_c))


def travel(run: RockingRun, block: Block, values: Mapping[str, float], of_base: bool) -> FloatArray:
    """What pivots that are not where the survey has them make of the wires' rotation (rad) or base (m).

    The base travels along x by Δu (1 − cos θ), and the wall rises by Δu sin|θ|, which a wire shows as far
    as it slopes by then: left out, a shifted pivot looks like some sliding and a gain of the wires.
    """
    theta = run.grid.theta
    inwards, apart = pivots(run, values)
    each = run.cache.constant("pivots", lambda: pivots_off(run.wires, theta))[of_base]
    shapes: tuple[Term, ...] = (
        (inwards, "travel", lambda: each),
        (apart, "lopsided travel", lambda: side_of(theta) * each),
    )
    coefficients = of_shapes(run, block, shapes)
    if "winkler.theta_c" in values:
        coefficients += block.coefficients(_on_springs(values, theta) * each)
    return coefficients
