"""What wires show of a wall that turns at impacts and stays turned (`impact_steps`, `corner_twist`)."""

from __future__ import annotations

import numpy as np

from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.rotation import shown_by_wires


def turn_share(run: RockingRun, *, of_base: bool) -> float:
    """What a turn of 1 rad makes of the wires' mean rotation (weights z²), rad, or of the base, m."""

    def share() -> float:
        y = np.array([wire.sensor.position_m[1] for wire in run.wires])
        return -shown_by_wires(run.wires, y, of_base=of_base)

    return run.cache.constant(("turn share", of_base), share)
