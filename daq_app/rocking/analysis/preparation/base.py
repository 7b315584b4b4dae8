"""Whether the wall slides or turns on its base, by the wires beside the rotation of the LVDTs."""

from __future__ import annotations

from daq_app.rocking.analysis.preparation.signals import Signals, TestTimes
from daq_app.rocking.families.base_steps import NO_STEPS, BaseSteps, base_steps
from daq_app.rocking.families.response import LATE_S, SLOW_S, Response


def base_of(signals: Signals, times: TestTimes, response: Response | None, *, leaping: bool) -> BaseSteps:
    """What the base does at impacts; nothing where wires and LVDTs differ by a delay of their own.

    `response`: how the wires follow the LVDTs, None where they are `leaping` and cannot be compared.
    """
    late = response is not None and (abs(response.delay_s) > LATE_S or abs(response.response_s) > SLOW_S)
    if signals.joint is None or late:
        return NO_STEPS
    wires, rotation = signals.geometry.wires, signals.joint.rotation_rad
    unexplained_m = signals.wires_m - wires.shortening(rotation)
    return base_steps(
        signals.time_s,
        rotation,
        unexplained_m / wires.shortening_per_shift()[:, None],
        wires.position_m[:, 1],
        times.impacts_s,
        leaping=leaping,
    )
