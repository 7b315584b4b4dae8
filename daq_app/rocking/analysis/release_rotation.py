"""θ0 by family, the best of them, and who is off."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from daq_app.rocking.analysis.fusion import best_value, level
from daq_app.rocking.analysis.results import ValueWithSigma
from daq_app.rocking.analysis.signals import Signals
from daq_app.rocking.families import words
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.motion.swings import MotionTrack

_NAMES = {"tiltmeters": "tiltmeters", "wires": "wires", "lvdts": "LVDTs"}
_APART = 0.01
"""θ0 of a family off the other two by more than this share is named: three times what calibration leaves."""
_APART_RAD = 2e-4


def theta0_by_family(signals: Signals, track: MotionTrack, gain_sigma: float) -> dict[str, ValueWithSigma]:
    """θ0 over the last half second of the hold (slow tiltmeters have settled), and the best."""
    start, stop = np.searchsorted(signals.time_s, [track.release.time_s - 0.5, track.release.time_s - 0.02])
    scale = abs(track.theta0_rad)
    found: dict[str, ValueWithSigma] = {}
    if signals.tilts_rad.shape[0]:
        value = signals.geometry.tilt(signals.tilts_rad[:, start:stop], track.theta0_rad)
        noise = signals.geometry.tilt_noise_rad / math.sqrt(
            max(signals.tilts_rad.shape[0] * (stop - start), 1)
        )
        if math.isfinite(value):
            found["tiltmeters"] = level(np.full(10, value), scale, noise)
    found[signals.lead] = level(np.full(10, track.theta0_rad), scale, track.sigma_theta0_rad, gain_sigma)
    wires = level(signals.wire_rotation_rad[start:stop], scale, track.sigma_theta0_rad)
    if signals.lead != "wires" and math.isfinite(wires.value):
        found["wires"] = wires
    if signals.joint is not None and signals.lead != "lvdts":
        lvdts = level(signals.joint.rotation_rad[start:stop], scale, signals.lvdt_noise_rad)
        if math.isfinite(lvdts.value):
            found["lvdts"] = lvdts
    found["best"] = best_value(found)
    return found


def levels_apart(signals: Signals, theta0: Mapping[str, ValueWithSigma]) -> list[FamilyFinding]:
    """The family whose θ0 is off where the two others agree."""
    values = {name: theta0[name].value for name in _NAMES if name in theta0}
    if len(values) < 3:
        return []
    for name, value in values.items():
        others = [other for key, other in values.items() if key != name]
        middle = sum(others) / 2.0
        limit = max(_APART * abs(middle), _APART_RAD)
        if abs(others[0] - others[1]) < 0.5 * abs(value - middle) and abs(value - middle) > limit:
            return [words.level(_NAMES[name], value - middle, value / middle - 1.0)]
    return []
