"""Crosstalk: what a channel shows of the one that is scanned before it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.motion.rotation import coarse, gridded
from daq_app.gap.rocking_model.records import GapRun


def crosstalk(run: GapRun, places: Sequence[int]) -> FloatArray:
    """What a full crosstalk would add to each of these channels, (k, m) on the grid, SI.

    The channel scanned before in shares of its range, times the range of the channel itself: equal volts.
    Zero for the first channel, where a range is not known, and where the channel before did not read.
    """
    rows = []
    for place in places:
        row = np.zeros(coarse(run.channels[place], run.rate_hz).size)
        own, before = run.sensors[place], run.sensors[place - 1]
        spans = [s.range_si[1] - s.range_si[0] for s in (own, before)]
        if place > 0 and np.all(np.isfinite(spans)) and np.all(np.isfinite(run.channels[place - 1])):
            row = spans[0] / spans[1] * gridded(run, place - 1)
        rows.append(row)
    return np.array(rows)
