"""Accelerometers that look along z: what those along x and the rotation make of each of them.

A place at (x, z) of a wall that rocks about the edge b sgn θ shows −θ̈ (x − b sgn θ) − ω² z + g (cos θ − 1)
along its own upright: the specific force on a point of a rigid body. θ̈ is read from the accelerometers
along x, so that a gain of their whole family cancels here too. A delay of all does not: on which edge the
wall stands and how it leans is read from other sensors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.channel_shapes import Others, block_of, deviation
from daq_app.gap.rocking_model.inspection.channel_families import smoothed
from daq_app.gap.rocking_model.motion.crosstalk import crosstalk
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rigid_body import across_axes, lever_arm
from daq_app.gap.rocking_model.motion.rotation import straight_line
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun
from daq_app.gap.rocking_model.tolerances.inspection import SUSPECT, VERTICAL_OTHERS
from daq_app.gap.rocking_model.tolerances.sensors import CROSSTALK, MOUNT_RAD


def odd_vertical(runs: Sequence[GapRun], grids: Sequence[Grid], late_s: Sequence[float]) -> str | None:
    """The one accelerometer along z that disagrees with those along x while the others along z do not.

    `late_s`: how late the accelerometers of each run are.
    """
    sizes: dict[str, list[float]] = {}
    for run, grid, late in zip(runs, grids, late_s, strict=True):
        for name, beside in _vertical(run, grid, late).items():
            misfit = deviation(beside)
            # On one edge such a place hardly moves, so that a gain and a curvature look much alike here:
            # together they say what neither says alone.
            tolerance = np.diag(beside.tolerance("accelerometer") ** 2)
            square = misfit.values @ np.linalg.solve(misfit.covariance + tolerance, misfit.values)
            sizes.setdefault(name, []).append(float(np.sqrt(square)))
    usual = {name: float(np.median(values)) for name, values in sizes.items()}
    if len(usual) < 2:
        return None
    worst = max(usual, key=lambda name: usual[name])
    others = max(size for name, size in usual.items() if name != worst)
    odd = usual[worst] > SUSPECT["accelerometer"] and others < VERTICAL_OTHERS * usual[worst]
    return worst if odd else None


def vertical_block(run: GapRun, grid: Grid, name: str, late_s: float) -> Block | None:
    """The coefficients of one accelerometer along z as a block of features, as `channel_block` gives them."""
    beside = _vertical(run.including((name,)), grid, late_s).get(name)
    if beside is None:
        return None
    return block_of(name, "accelerometer", beside, ())


def _vertical(run: GapRun, grid: Grid, late_s: float) -> dict[str, Others]:
    """Every accelerometer along z beside its prediction."""
    along_x, along_z = run.steady_accelerometers("x"), run.steady_accelerometers("z")
    if len(along_x) < 4 or not along_z or grid.impact_s.size < 2:
        return {}
    heights = run.positions(along_x)[:, 2]
    weights = straight_line(heights)[1]
    signals = smoothed(run, along_x, late_s)
    turning = weights @ signals
    # Behind the last impact that can be told from its neighbours nobody knows on which edge the wall stands.
    pick = (grid.time_s > 0.0) & (grid.time_s < grid.impact_s[-1]) & ~grid.near_impact
    shown = np.sqrt(np.mean(signals**2, axis=1)) / (np.sqrt(np.mean(turning**2)) + 1e-300)
    spread = float(np.sqrt(1.0 + np.sum((weights * shown) ** 2)))
    leaked, turned = _imperfections(run, grid, along_x)
    compared = {}
    for i, measured in zip(along_z, smoothed(run, along_z, late_s), strict=True):
        lever = lever_arm(run.sensors[i], grid, run.survey.half_base_m)
        upright = GRAVITY_M_S2 * (np.cos(grid.theta) - 1.0) - grid.omega**2 * run.sensors[i].position_m[2]
        # Those of the accelerometers along x are in the prediction, as far as they look like turning.
        own_leaked, own_turned = _imperfections(run, grid, [i])
        rows = np.vstack(
            [own_leaked + lever * (weights @ leaked), own_turned, weights[:, None] * turned * lever]
        )
        compared[run.sensors[i].id] = Others(
            measured, upright - turning * lever, pick, spread, imperfections=rows
        )
    return compared


def _imperfections(run: GapRun, grid: Grid, places: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """What one sd of crosstalk and of a turned mount adds to each accelerometer, (k, m) each, m/s²."""
    return CROSSTALK * crosstalk(run, places), MOUNT_RAD * across_axes(run, grid, places)
