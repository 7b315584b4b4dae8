"""Signals in which a ring-down may show: bending and turning of the wall, beyond its rigid rotation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Shares
from daq_app.gap.rocking_model.motion.impact_timing import acceleration_delay
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, Rotation, coarse, gridded, wall_rotation
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, RING_LATE_S, SPREAD_ALONG_M
from daq_app.gap.rocking_model.tolerances.walls import (
    ACCELERATION_MASK_S,
    DISPLACEMENT_MASK_S,
    MIDDLE_OF_IMPACT_S,
)


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal in which a ring-down may show, on the grid, shape (m,)."""

    family: str
    values: FloatArray
    pick: NDArray[np.bool_]
    shares: Shares
    undone_s: float = 0.0
    """Delay that was undone."""
    unequal: FloatArray | None = None
    """What calibrations that differ by one sd make of it, (m,)."""


def ring_signals(
    run: GapRun, joint: Rotation, grid: Grid, height_m: float
) -> tuple[list[Signal], list[Signal]]:
    """Signals of bending, in metres (m/s²) of the wall's top, and of turning: slopes along the length.

    Wires and accelerometers show both, the joint what turns.
    """
    bending: list[Signal] = []
    turning: list[Signal] = []

    def shapes(y: FloatArray, z: FloatArray) -> list[tuple[list[Signal], FloatArray]]:
        turns = [(turning, y)] if float(np.ptp(y)) > SPREAD_ALONG_M else []
        return [(bending, (z / height_m) ** 2), *turns]

    rows, wires = wall_rotation(run)
    if len(rows) >= 3:
        _, y, z = run.positions(wires).T
        beyond = z[:, None] * (coarse(rows, run.rate_hz) - grid.theta)
        pick = _between_late(grid, beyond, z)
        for signals, shape in shapes(y, z):
            weights = shape / (shape @ shape)
            signals.append(Signal("wire", weights @ beyond, pick, _shares(weights, y, z, height_m)))
    chosen = run.steady_accelerometers("x")
    if len(chosen) >= 3:
        _, y, z = run.positions(chosen).T
        seen = accelerations(run, grid, chosen)
        for signals, shape in shapes(y, z):
            shares = _shares(shape / (shape @ shape), y, z, height_m)
            signals.append(_of_accelerometers(seen, shape, z, shares))
    if len(joint.used) >= 8:
        pick = _between(grid, DISPLACEMENT_MASK_S) & grid.valid
        turning.append(Signal("lvdt", coarse(joint.twist, run.rate_hz), pick, Shares(twist=1.0)))
    return bending, turning


def _shares(weights: FloatArray, y: FloatArray, z: FloatArray, height_m: float) -> Shares:
    """What a weighted sum of channels at (y, z), each (n,), shows of each motion along x."""
    return Shares(
        rotation=float(weights @ z),
        bend=float(weights @ (z / height_m) ** 2),
        yaw=-float(weights @ y),
        twist=float(weights @ (y * z)),
    )


@dataclass(frozen=True, slots=True)
class Accelerations:
    """`beyond`: (n, m) beyond those of a rigid wall; `pick`: (m,) the samples between impacts to be used.

    `mean`: (m,) per metre of height, as measured.
    """

    beyond: FloatArray
    mean: FloatArray
    pick: NDArray[np.bool_]
    undone_s: float


def _of_accelerometers(seen: Accelerations, shape: FloatArray, z: FloatArray, shares: Shares) -> Signal:
    """The share of a shape over the accelerometers; unequal calibrations have some of every motion's."""
    size = shape @ shape
    unequal = CALIBRATION * float(np.linalg.norm(shape * z) / size) * seen.mean
    return Signal("accelerometer", shape @ seen.beyond / size, seen.pick, shares, seen.undone_s, unequal)


def accelerations(run: GapRun, grid: Grid, chosen: Sequence[int]) -> Accelerations:
    """What accelerometers (their places) show beyond a rigid wall, put in step with the rotation.

    Late accelerometers show the shock of an impact beyond the samples that are left out for it.
    """
    seen = acceleration_delay(run, grid)
    late = seen[0] - MIDDLE_OF_IMPACT_S if seen is not None else 0.0
    late = late if abs(late) > RING_LATE_S else 0.0
    early = round(late * run.rate_hz)
    z = run.positions(chosen)[:, 2]
    measured = np.array([gridded(run, i, early) for i in chosen])
    beyond = measured - z[:, None] * grid.alpha + GRAVITY_M_S2 * np.sin(grid.theta)
    pick = _between(grid, ACCELERATION_MASK_S + abs(late))
    return Accelerations(beyond, z @ measured / (z @ z), pick, early / run.rate_hz)


def _between_late(grid: Grid, beyond: FloatArray, heights: FloatArray) -> NDArray[np.bool_]:
    """Samples to use of wires, (n, m) beyond a rigid wall: the corner of an impact lasts twice their delay.

    What a slow sensor makes of a corner depends on the form of its response, which nobody knows so well.
    """
    pick = (grid.time_s > 0.0) & (grid.time_s < grid.rest_s)
    speed = grid.omega[pick]
    late = -float(heights @ (beyond[:, pick] @ speed)) / float(heights @ heights) / float(speed @ speed)
    return _between(grid, DISPLACEMENT_MASK_S + (2.0 * abs(late) if abs(late) > RING_LATE_S else 0.0))


def _between(grid: Grid, mask_s: float) -> NDArray[np.bool_]:
    """Samples between impacts, from the first impact until the swings end."""
    if grid.impact_s.size < 2:
        return np.zeros(grid.time_s.size, dtype=bool)
    after = grid.time_s[:, None] - grid.impact_s[None, :]
    near = np.any((after > -0.5 * mask_s - 1.0 / GRID_HZ) & (after < mask_s), axis=1)
    inside = (grid.time_s > grid.impact_s[0]) & (grid.time_s < grid.impact_s[-1])
    return np.asarray(inside & ~near)
