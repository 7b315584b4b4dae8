"""When nothing but the wall moves the accelerometers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.motion import KNOCK, KNOCK_S


def quiet(run: GapRun, grid: Grid) -> NDArray[np.bool_]:
    """Samples of the grid at which nothing rings in the accelerometers (steps on the floor, a knock)."""
    step = round(run.rate_hz / GRID_HZ)
    spread = np.zeros(grid.time_s.size)
    for i in run.indices("accelerometer"):
        if run.reads(i):
            cells = run.channels[i, : spread.size * step].reshape(spread.size, step)
            deviation = cells.std(axis=1)
            spread = np.maximum(spread, deviation / max(float(np.median(deviation[-60:])), 1e-12))
    loud = np.convolve(spread > KNOCK, np.ones(round(KNOCK_S * GRID_HZ)), "same") > 0
    return np.asarray(~loud)
