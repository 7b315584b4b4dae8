"""Whether the wall slides or turns on its base, by the wires beside the rotation of the LVDTs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from daq_app.rocking.analysis.preparation.signals import Signals, TestTimes
from daq_app.rocking.families.base.slip import BaseSlip, find_slip
from daq_app.rocking.families.base.steps import NO_STEPS, BaseSteps, base_steps, between_impacts
from daq_app.rocking.families.response import LATE_S, SLOW_S, Response
from daq_app.rocking.record import TestRecord

_SMALLEST_M: Final = 2e-4
"""Largest slip of a test that is named. Lowering it names what moves r by less than it scatters."""


@dataclass(frozen=True, slots=True)
class Base:
    """What the base does at impacts, and between them where friction does not hold it."""

    steps: BaseSteps = NO_STEPS
    slip: BaseSlip | None = None

    @property
    def moves(self) -> bool:
        """Whether the wires go with a base that slides, so that they do not show the wall alone."""
        return self.steps.slide_m > 0.0 or self.slip is not None


STILL: Final = Base()


def base_of(
    record: TestRecord, signals: Signals, times: TestTimes, response: Response | None, *, leaping: bool
) -> Base:
    """What the base does; nothing where wires and LVDTs differ by a delay of their own.

    `response`: how the wires follow the LVDTs, None where they are `leaping` and cannot be compared.
    """
    late = response is not None and (abs(response.delay_s) > LATE_S or abs(response.response_s) > SLOW_S)
    if signals.joint is None or late:
        return STILL
    wires, rotation = signals.geometry.wires, signals.joint.rotation_rad
    unexplained_m = (signals.wires_m - wires.shortening(rotation)) / wires.shortening_per_shift()[:, None]
    shown = (signals.time_s, rotation, unexplained_m, wires.position_m[:, 1], times.impacts_s)
    between = between_impacts(*shown)
    slip = None
    if between is not None:
        specimen = record.rig.specimen
        slip = find_slip(between, specimen.alpha0_rad, specimen.p_rad_s, specimen.r0_m)
    if slip is not None and slip.slip_m < _SMALLEST_M:
        slip = None
    return Base(base_steps(*shown, leaping=leaping), slip)
