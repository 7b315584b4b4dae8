"""LVDTs that do not show what the others of their face do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.families import unfit_words
from daq_app.rocking.families.channels.compared_channels import (
    ChannelMeans,
    ComparedChannels,
    DeviationKind,
    compare_channels,
)
from daq_app.rocking.families.finding import FamilyFinding

_LEAST: Final[Mapping[DeviationKind, float]] = {"gain": 0.03, "late": 4e-3, "drift": 4e-4}
"""Deviation from the other LVDTs of the face that is named: a share, s, and rad of the rotation that one LVDT
alone would show. Calibration and place leave 0.5 %; less moves r by nothing. Raising them lets one LVDT of
many doubt the wall; lowering them names sound ones."""
_STANDS_OUT: Final = 5.0
"""The same over the median deviation of the others."""
_FEWEST: Final = 5
"""LVDTs of a face from which one can be told from the others."""


def odd_lvdts(signals: Signals, motion: slice) -> list[FamilyFinding]:
    """The LVDT of each face that deviates far more than the others, if there is one; it is left out."""
    joint = signals.joint
    if joint is None:
        return []
    rig = signals.record.rig
    ids = signals.record.family("lvdt")
    found = []
    for side in (-1.0, 1.0):
        rows = [
            row
            for row, name in enumerate(ids)
            if name not in joint.clipped and side * rig.channel(name).position_m[0] > 0.0
        ]
        if len(rows) < _FEWEST:
            continue
        of_each = signals.openings_m[rows, motion] / rig.specimen.base_width_m
        means = ChannelMeans.of(of_each, signals.record.rate_hz)
        if means is None:
            continue
        along_m = np.array([rig.channel(ids[row]).position_m[1] for row in rows])
        odd = _odd(compare_channels(means, along_m / rig.specimen.base_width_m))
        if odd is not None:
            place, kind, size = odd
            found.append(unfit_words.odd_lvdt(ids[rows[place]], kind, size))
    return found


def _odd(compared: ComparedChannels) -> tuple[int, DeviationKind, float] | None:
    """Place, kind and size of the largest deviation beyond its limit; None where there is none."""
    shown = {"gain": compared.gain, "late": compared.lag_s, "drift": compared.drift_rad}
    worst: tuple[float, tuple[int, DeviationKind, float]] | None = None
    for kind, least in _LEAST.items():
        apart = shown[kind] - np.median(shown[kind])
        place = int(np.argmax(np.abs(apart)))
        size = float(apart[place])
        rest = float(np.median(np.abs(np.delete(apart, place))))
        over = abs(size) / least
        if abs(size) > max(least, _STANDS_OUT * rest) and (worst is None or over > worst[0]):
            worst = over, (place, kind, size)
    return None if worst is None else worst[1]
