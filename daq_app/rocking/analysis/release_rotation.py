"""θ0 by family, the best of them, and who is off."""

from __future__ import annotations

import math
from collections.abc import Mapping

from daq_app.rocking.analysis.preparation.fusion import best_value
from daq_app.rocking.analysis.preparation.gains import FamilyGains, hold_samples
from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.analysis.results import ValueWithSigma
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.levels import level_outlier
from daq_app.rocking.motion.swings import MotionTrack, steady_level

_NAMES = {"tiltmeters": "tiltmeters", "wires": "wires", "lvdts": "LVDTs"}


def theta0_by_family(
    signals: Signals, track: MotionTrack, gains: FamilyGains, bent_rad: float = 0.0
) -> dict[str, ValueWithSigma]:
    """θ0 over the last half second of the still hold (slow tiltmeters have settled), and the best.

    `bent_rad`: what a wall that bends adds to the zeros of wires and tiltmeters.
    """
    hold, rate = hold_samples(signals, track.held_until_s), signals.record.rate_hz
    zero = signals.settings.zero_sigma_rad
    bent_zero = math.hypot(zero, bent_rad)
    theta0: dict[str, ValueWithSigma] = {}
    tilts = signals.tilts_rad[:, hold]
    value = signals.geometry.tilt(tilts, track.theta0_rad)
    if math.isfinite(value):
        _, noise = steady_level(tilts.mean(axis=0), rate)
        theta0["tiltmeters"] = _level(value, math.hypot(noise, bent_zero), gains.tiltmeters)
    sigma = math.hypot(track.sigma_theta0_rad, bent_rad if signals.lead == "wires" else 0.0)
    theta0[signals.lead] = _level(track.theta0_rad, sigma, gains.of(signals.lead))
    others = {"wires": signals.wire_rotation_rad}
    if signals.joint is not None:
        others["lvdts"] = signals.joint.rotation_rad
    for name, rotation in others.items():
        value, noise = steady_level(rotation[hold], rate)
        if name != signals.lead and math.isfinite(value):
            own_zero = bent_zero if name == "wires" else zero
            theta0[name] = _level(value, math.hypot(noise, own_zero), gains.of(name))
    theta0["best"] = best_value(theta0)
    return theta0


def _level(value_rad: float, sigma_rad: float, gain_sigma: float) -> ValueWithSigma:
    """`sigma_rad` holds noise and zero; the gain's error, a share, comes to it."""
    return ValueWithSigma(value_rad, math.hypot(sigma_rad, gain_sigma * value_rad))


def levels_apart(theta0: Mapping[str, ValueWithSigma]) -> list[FamilyFinding]:
    """The family whose θ0 is off where the two others agree."""
    finding = level_outlier({_NAMES[name]: value.value for name, value in theta0.items() if name in _NAMES})
    return [] if finding is None else [finding]
