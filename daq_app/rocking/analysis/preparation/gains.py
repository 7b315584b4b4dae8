"""How well the gain of each family's rotation is known, from how its own sensors differ in the hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from daq_app.rocking.analysis.preparation.signals import Signals, TestTimes
from daq_app.rocking.families.channels.compared_channels import ComparedChannels
from daq_app.rocking.families.gain_error import CALIBRATION_SHARE, gain_sigma_of_mean
from daq_app.rocking.geometry.joint import BaseJoint

_DATUM_SHARE = 0.0005
"""Standard uncertainty of the wires' gain from the datum of their heights, common to all: 1 mm of 2 m,
assumed."""
_FACES_M = 0.002
"""Standard uncertainty of the distance of the faces that LVDTs stand on: rough stone is measured with a tape
(assumed). Walls of a stranger's laboratory were 1.7 mm wider or narrower than surveyed, rms, and θ0 by LVDTs
was off by as large a share."""
_PLACE_M = 0.001
"""Standard uncertainty of the place of an LVDT on its face, assumed. While one LVDT was expected to be no
further off than its calibration, θ0 by LVDTs held the truth in 93.3 % of 450."""
HOLD_S = (0.5, 0.02)
"""Levels of the hold are read over this span before the release: slow tiltmeters have settled."""
_PLANE = 3
"""Unknowns of the plane through the LVDTs."""


@dataclass(frozen=True, slots=True)
class FamilyGains:
    """Standard uncertainty of the gain of each family's rotation, as a share."""

    wires: float = CALIBRATION_SHARE
    lvdts: float = CALIBRATION_SHARE
    tiltmeters: float = CALIBRATION_SHARE

    def of(self, family: str) -> float:
        """That of ``wires`` or ``lvdts``, the families that a motion can be read from."""
        return self.lvdts if family == "lvdts" else self.wires


def hold_samples(signals: Signals, release_s: float) -> slice:
    """Samples of the hold that its level is read from."""
    start, stop = np.searchsorted(signals.time_s, [release_s - before for before in HOLD_S])
    return slice(int(start), int(stop))


def gains_of(signals: Signals, times: TestTimes, wires: ComparedChannels | None) -> FamilyGains:
    """What the wires' motion and the levels of LVDTs and tiltmeters in the hold say of their gains."""
    assert times.release_s is not None
    hold = hold_samples(signals, times.release_s)
    wires_sigma = CALIBRATION_SHARE
    if wires is not None:
        wires_sigma = wires.family_gain_sigma(signals.geometry.weights()[0])
    return FamilyGains(
        wires=math.hypot(wires_sigma, _DATUM_SHARE),
        lvdts=_lvdts(signals, hold),
        tiltmeters=_tiltmeters(signals, hold, times.hold_rad),
    )


def _lvdts(signals: Signals, hold: slice) -> float:
    """A gain or place that is off shows in the plane's misfit, as a share of the widest opening.

    Faces that are further apart than surveyed do not: all openings are as much wider.
    """
    distance = _FACES_M / signals.record.rig.specimen.base_width_m
    return math.hypot(_by_single_lvdts(signals, hold), distance)


def _by_single_lvdts(signals: Signals, hold: slice) -> float:
    ids = signals.record.family("lvdt")
    if signals.joint is None or hold.start >= hold.stop:
        return CALIBRATION_SHARE
    openings = signals.openings_m[:, hold].mean(axis=1)
    lost = {*signals.joint.suspects, *signals.joint.clipped}
    used = np.isfinite(openings) & np.array([channel_id not in lost for channel_id in ids])
    joint = BaseJoint.from_rig(signals.record.rig, ids)
    if min(joint.places_on_face(side, used) for side in (-1, 1)) < 2:
        return CALIBRATION_SHARE
    weights, widest = joint.rotation_weights(used), float(np.abs(openings[used]).max())
    sine = abs(float(weights @ openings[used]))
    if not sine or not widest:
        return CALIBRATION_SHARE
    misfit = joint.misfit(openings[used][:, None], used)[:, 0]
    prior = math.hypot(CALIBRATION_SHARE, _PLACE_M * sine / widest)
    return gain_sigma_of_mean(misfit / widest, weights * widest / sine, weights.size - _PLANE, prior)


def _tiltmeters(signals: Signals, hold: slice, reference_rad: float) -> float:
    """From the tiltmeters that count in the level near `reference_rad`."""
    levels = signals.geometry.tilt_levels(signals.tilts_rad[:, hold], reference_rad)
    if not levels.size or not levels.mean():
        return CALIBRATION_SHARE
    weights = np.full(levels.size, 1.0 / levels.size)
    return gain_sigma_of_mean(levels / levels.mean() - 1.0, weights, levels.size - 1.0)
