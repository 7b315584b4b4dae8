"""A base that friction does not hold: what wires show of it between impacts, over all runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import Wire, gridded, wall_rotation
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.walls import (
    FEWEST_WIRES,
    SHORTEST_SLIP_S,
    SLIP_GUARD_S,
    SLIP_WINDOW_S,
    SLIP_WINDOW_SHARE,
)
from daq_app.rocking.families.base.slip import BaseSlip, HalfCycleSlips, find_slip


def slip_of(runs: Sequence[GapRun], grids: Sequence[Grid]) -> BaseSlip | None:
    """The slip of the base of all runs; None where its wires show none, or are too few to tell."""
    parts = [part for run, grid in zip(runs, grids, strict=True) if (part := _seen(run, grid)) is not None]
    if not parts:
        return None
    survey = runs[0].survey
    return find_slip(HalfCycleSlips.joined(parts), survey.alpha_rad, survey.p_rad_s, survey.r0_m)


def slip_findings(slip: BaseSlip | None, runs: int) -> list[RunFinding]:
    """What one of the runs says of the slip: how far the base slips, or turns about one of its ends."""
    if slip is None:
        return []
    # It is found from all runs at once: what is said in every run is known only once.
    more, words = math.sqrt(runs), f"friction of {slip.friction:.2f}"
    if slip.turns:
        return [RunFinding("corner_twist@base", words, "rad", slip.turn_rad, more * slip.turn_sd_rad)]
    return [RunFinding("sliding@base", words, "m", slip.slip_m, more * slip.slip_sd_m)]


def base_motion(run: GapRun, grid: Grid) -> FloatArray | None:
    """What the wires show beside the grid's rotation, (3, m): motion of the base along x, m, an error of the
    rotation, rad, and a turn about the vertical, rad; None where they do not tell these apart.

    The line through the wires over their heights takes up what the rotation is off by. An analysis of r takes
    up gains of single wires instead (`rocking.families.base.steps`): it has one test, and every sample.
    """
    _, chosen = wall_rotation(run)
    _, y, z = run.positions(chosen).T
    design = shown_of_base(y, z)
    if len(chosen) < FEWEST_WIRES or np.linalg.matrix_rank(design) < design.shape[1]:
        return None
    return np.asarray(np.linalg.pinv(design) @ beyond_rigid(run, grid.theta, chosen))


def shown_of_base(y: FloatArray, z: FloatArray) -> FloatArray:
    """What wires at (y, z), (k,) each, show of a base that moves, a rotation and a turn, (k, 3)."""
    return np.column_stack([np.ones_like(y), z, y])


def beyond_rigid(run: GapRun, theta: FloatArray, chosen: Sequence[int]) -> FloatArray:
    """What wires show beyond those of a rigid wall at `theta`, (m,), rad, on still edges: (k, m), m."""
    ideal = [Wire(run.sensors[i], run.survey.half_base_m).shortening(theta) for i in chosen]
    return np.array([gridded(run, i) for i in chosen]) - np.array(ideal)


def _seen(run: GapRun, grid: Grid) -> HalfCycleSlips | None:
    """What the half-cycles of a run show; None where its wires do not tell slip, turn and rotation apart."""
    moved = base_motion(run, grid)
    if moved is None:
        return None
    rows = []
    for start_s, end_s, approach in zip(
        grid.impact_s[:-1], grid.impact_s[1:], grid.approach[:-1], strict=True
    ):
        if end_s - start_s < SHORTEST_SLIP_S:
            break
        window_s = min(SLIP_WINDOW_S, SLIP_WINDOW_SHARE * (end_s - start_s))
        after, before = grid.time_s - start_s - SLIP_GUARD_S, end_s - SLIP_GUARD_S - grid.time_s
        first, last = ((side > 0.0) & (side < window_s) for side in (after, before))
        inside = grid.theta[(after > 0.0) & (before > 0.0)]
        if not (first.any() and last.any() and grid.valid[first | last].all()):
            continue
        # The wall has crossed to the side that its speed points to.
        outwards = np.sign(approach)
        along, _, turn = outwards * (moved[:, last].mean(axis=1) - moved[:, first].mean(axis=1))
        rows.append((outwards, np.abs(inside).max(), abs(approach), along, turn))
    return HalfCycleSlips(*np.array(rows).T) if rows else None
