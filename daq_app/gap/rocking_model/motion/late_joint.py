"""The joint of LVDTs that are late, put in step with the wires that the motion is read from instead.

What the joint shows beyond its own rotation (where the wall turns, how long its contact is) does not hang on
when it shows it: opening and rotation are late alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.motion_grid import MASK_S, Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, Rotation, coarse, sooner
from daq_app.gap.rocking_model.tolerances.sensors import MOST_LATE_S
from daq_app.rocking.geometry.parabola import vertex


@dataclass(frozen=True, slots=True)
class InStep:
    """A joint as late as the grid's rotation, the grid with the joint's own rotation, and samples to use."""

    joint: Rotation
    grid: Grid
    pick: NDArray[np.bool_]
    late_s: float
    """By how much it was put sooner."""


def lateness(mine: FloatArray, other: FloatArray) -> float:
    """Samples of the grid by which `mine` comes later than `other`, both (m,).

    It is where the correlation of the rates is largest, to which flat tops add nothing.
    """
    most = round(MOST_LATE_S * GRID_HZ)
    return _largest(_correlation(mine, other, most))


def common_lateness(mine: FloatArray, other: FloatArray, rate_hz: float) -> float:
    """Samples by which all of `mine` come later than `other`, both (k, m), whatever their signs and sizes."""
    most = round(MOST_LATE_S * rate_hz)
    shares = []
    for y, e in zip(mine, other, strict=True):
        if np.ptp(y) > 0.0 and np.ptp(e) > 0.0:
            power = float(np.gradient(y) @ np.gradient(y)) * float(np.gradient(e) @ np.gradient(e))
            shares.append(_correlation(y, e, most) ** 2 / power)
    return _largest(np.sum(shares, axis=0)) if shares else 0.0


def _correlation(mine: FloatArray, other: FloatArray, most: int) -> FloatArray:
    """Correlation of the rates for delays of −`most` to `most` samples."""
    inner = np.gradient(mine)[most : mine.size - most]
    return np.correlate(np.gradient(other), inner, "valid")[::-1]


def _largest(correlation: FloatArray) -> float:
    """Place of the maximum from the middle, by a parabola through it and its neighbours."""
    k, shift, bend = vertex(correlation, int(np.argmax(correlation)))
    return k - correlation.size // 2 + (shift if bend < 0.0 else 0.0)


def in_step(joint: Rotation, grid: Grid, rate_hz: float) -> InStep:
    """The joint put in step with a grid whose rotation is read from wires.

    Around impacts, where rotation and opening have corners, as much more is left out as the joint is late by,
    and everything after the last impact that is known.
    """
    late_s = lateness(coarse(joint.theta, rate_hz), grid.theta) / GRID_HZ
    early = round(late_s * rate_hz)
    theta, lift, twist = (sooner(row, early) for row in (joint.theta, joint.lift, joint.twist))
    moved = replace(joint, theta=theta, lift=lift, twist=twist)
    apart = grid.from_impact_s > MASK_S + abs(late_s)
    apart &= grid.time_s < grid.impact_s.max(initial=-np.inf)
    return InStep(moved, replace(grid, theta=coarse(moved.theta, rate_hz)), apart, early / rate_hz)
