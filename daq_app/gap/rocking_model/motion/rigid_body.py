"""What an accelerometer fixed to a rigid wall shows that rocks about its edges ± b/2.

At height z with a lever arm a = x − (b/2) sgn θ about the edge: θ̈ z − ω² a − g sin θ along the wall's own x,
and −θ̈ a − ω² z + g (cos θ − 1) along its own z, the value at rest taken off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun, Sensor


def lever_arm(sensor: Sensor, grid: Grid, half_base_m: float) -> FloatArray:
    """Distance of a place from the edge that carries the wall, along x, (m,), m."""
    return sensor.position_m[0] - half_base_m * np.sign(grid.theta)


def across_axes(run: GapRun, grid: Grid, places: Sequence[int]) -> FloatArray:
    """What a mount turned by one radian adds to each accelerometer: the other axis's signal, (k, m), m/s²."""
    rows = []
    for place in places:
        sensor = run.sensors[place]
        arm, height = lever_arm(sensor, grid, run.survey.half_base_m), sensor.position_m[2]
        if sensor.axis == "z":
            rows.append(grid.alpha * height - grid.omega**2 * arm - GRAVITY_M_S2 * np.sin(grid.theta))
        else:
            fallen = GRAVITY_M_S2 * (np.cos(grid.theta) - 1.0)
            rows.append(fallen - grid.alpha * arm - grid.omega**2 * height)
    return np.array(rows)
