"""Crosstalk: what a channel shows of the one that is scanned before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.rotation import gridded
from daq_app.gap.rocking_model.records import GapRun, Sensor
from daq_app.gap.rocking_model.tolerances.sensors import CROSSTALK


@dataclass(frozen=True, slots=True)
class Leak:
    """What is known of the share that channels show of the one that is scanned before them, 1."""

    share: float = 0.0
    sd: float = CROSSTALK


UNKNOWN_LEAK: Final = Leak()
"""What the table says where no channel tells it."""


def crosstalk(run: GapRun, places: Sequence[int]) -> FloatArray:
    """What a full crosstalk would add to each of these channels, (k, m) on the grid, SI.

    Equal volts: by the sensitivities, or where these are not known by the ranges. Zero for the first channel,
    where neither is known, and where the channel before did not read.
    """
    rows = []
    for place in places:
        row = np.zeros(gridded(run, place).size)
        before = run.before(place)
        scale = _same_volts(run.sensors[place], run.sensors[before])
        if before >= 0 and np.isfinite(scale) and run.reads(before):
            row = scale * gridded(run, before)
        rows.append(row)
    return np.array(rows)


def _same_volts(own: Sensor, before: Sensor) -> float:
    """SI of a channel per SI of the one before it, for one voltage."""
    scale = own.si_per_reading / before.si_per_reading
    if np.isfinite(scale):
        return scale
    spans = [sensor.range_si[1] - sensor.range_si[0] for sensor in (own, before)]
    return spans[0] / spans[1]
