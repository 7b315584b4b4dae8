"""θ0 by family, the best of them, and who is off."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Final

from daq_app.rocking.analysis.preparation.fusion import best_value
from daq_app.rocking.analysis.preparation.gains import FamilyGains, hold_samples
from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.analysis.results import ValueWithSigma
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.levels import level_outlier
from daq_app.rocking.motion.swings import MotionTrack, steady_level

NAMES: Final = {"tiltmeters": "tiltmeters", "wires": "wires", "lvdts": "LVDTs"}
"""The word for the reader by the key of `TestAnalysis.theta0_by_family`."""


def theta0_by_family(
    signals: Signals,
    track: MotionTrack,
    gains: FamilyGains,
    bent_rad: float = 0.0,
    unfit: Collection[str] = (),
) -> dict[str, ValueWithSigma]:
    """θ0 over the last half second of the still hold (slow tiltmeters have settled), and the best.

    `bent_rad`: what a wall that bends adds to the zeros of wires and tiltmeters. `unfit`: families, by the
    word for the reader, that the best has no part of.
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
    trusted = fit_levels(theta0, unfit)
    best = best_value(trusted)
    if math.isfinite(best.value):
        # What is wrong with a family that is left out moves its θ0 by as much as it differs from the others.
        for name in theta0.keys() - trusted.keys():
            shown = theta0[name]
            sigma = math.hypot(shown.sigma, shown.value - best.value)
            theta0[name] = ValueWithSigma(shown.value, sigma)
    theta0["best"] = best
    return theta0


def _level(value_rad: float, sigma_rad: float, gain_sigma: float) -> ValueWithSigma:
    """`sigma_rad` holds noise and zero; the gain's error, a share, comes to it."""
    return ValueWithSigma(value_rad, math.hypot(sigma_rad, gain_sigma * value_rad))


def fit_levels(theta0: Mapping[str, ValueWithSigma], unfit: Collection[str]) -> dict[str, ValueWithSigma]:
    """θ0 of the single families that are fit to be used."""
    return {name: value for name, value in theta0.items() if name in NAMES and NAMES[name] not in unfit}


def headline_of(theta0: Mapping[str, ValueWithSigma], lead: str, unfit: Collection[str]) -> ValueWithSigma:
    """θ0 of the test: that of the tiltmeters where they are fit, else that of the family that leads."""
    return fit_levels(theta0, unfit).get("tiltmeters", theta0[lead])


def levels_apart(theta0: Mapping[str, ValueWithSigma], unfit: Collection[str]) -> list[FamilyFinding]:
    """The family whose θ0 is off where the two others agree."""
    finding = level_outlier({NAMES[name]: v.value for name, v in fit_levels(theta0, unfit).items()})
    return [] if finding is None else [finding]
