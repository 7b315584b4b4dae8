"""The axis of a tiltmeter across the motion: a wall that rocks on its long edges does not turn about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.response import first_order
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import coarse, zeroed
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import MOUNT_SD, TURNED


def second_axis(runs: Sequence[GapRun], grids: Sequence[Grid]) -> list[list[RunFinding]]:
    """Findings of the second axes that follow the rotation by more than a mount is turned, run by run.

    No effect explains them: another signal gets into that channel, or the instrument is badly mounted.
    """
    findings: list[list[RunFinding]] = [[] for _ in runs]
    for place in runs[0].indices("tiltmeter", "y"):
        shares = [_share(run, grid, place) for run, grid in zip(runs, grids, strict=True)]
        if abs(float(np.median(shares))) <= TURNED:
            continue
        key = f"crossed@{runs[0].sensors[place].id}"
        for row, share in zip(findings, shares, strict=True):
            row.append(RunFinding(key, "share of the rotation", "1", abs(share), MOUNT_SD))
    return findings


def _share(run: GapRun, grid: Grid, place: int) -> float:
    """Share of the rotation, as the sensor's own response shows it, in the second axis."""
    values = zeroed(run, place)
    if not np.all(np.isfinite(values)):
        return 0.0
    slow: FloatArray = first_order(grid.theta, run.sensors[place].time_constant_s)
    columns = np.column_stack([slow, np.ones_like(slow), grid.time_s])
    measured = coarse(values, run.rate_hz)
    return float(np.linalg.lstsq(columns, measured, rcond=None)[0][0])
