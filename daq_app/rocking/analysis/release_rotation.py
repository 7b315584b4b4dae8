"""θ0 by family, the best of them, and who is off."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Final

from scipy.signal import lfilter

from daq_app.rocking.analysis.preparation.fusion import best_value
from daq_app.rocking.analysis.preparation.gains import FamilyGains, hold_samples
from daq_app.rocking.analysis.preparation.signals import Signals
from daq_app.rocking.analysis.results import ValueWithSigma
from daq_app.rocking.families.finding import FamilyFinding
from daq_app.rocking.families.levels import level_outlier
from daq_app.rocking.motion.swings import MotionTrack, hold_level, steady_level

NAMES: Final = {"tiltmeters": "tiltmeters", "wires": "wires", "lvdts": "LVDTs"}
"""The word for the reader by the key of `TestAnalysis.theta0_by_family`."""
_TIME_CONSTANTS: Final = 6.0
"""Time constants of the tiltmeters, 1, over which their response to the rotation is followed before their
levels are read. What the rotation was before that has a share of 0.2 % in a level. Lowering the number leaves
sway in θ0 by tiltmeters."""


def theta0_by_family(
    signals: Signals,
    track: MotionTrack,
    gains: FamilyGains,
    bent_rad: float = 0.0,
    unfit: Collection[str] = (),
) -> dict[str, ValueWithSigma]:
    """θ0, the rotation that the wall is let go from, by each family, and the best.

    Tiltmeters are read over the last half second of the still hold. What the wall sways by from there to the
    release is that of the family that leads, for they are too slow to show it.

    `bent_rad`: what a wall that bends adds to the zeros of wires and tiltmeters. `unfit`: families, by the
    word for the reader, that the best has no part of.
    """
    hold, rate = hold_samples(signals, track.held_until_s), signals.record.rate_hz
    settings = signals.settings
    zero = settings.zero_sigma_rad
    bent_zero = math.hypot(zero, bent_rad)
    theta0: dict[str, ValueWithSigma] = {}
    tilts = signals.tilts_rad[:, hold]
    value = signals.geometry.tilt(tilts, track.theta0_rad)
    if math.isfinite(value):
        _, noise = steady_level(tilts.mean(axis=0), rate)
        sway, sway_noise = (0.0, 0.0) if NAMES[signals.lead] in unfit else _sway(signals, track, hold)
        sigma = math.hypot(noise, sway_noise, bent_zero)
        theta0["tiltmeters"] = _level(value + sway, sigma, gains.tiltmeters)
    sigma = math.hypot(track.sigma_theta0_rad, bent_rad if signals.lead == "wires" else 0.0)
    theta0[signals.lead] = _level(track.theta0_rad, sigma, gains.of(signals.lead))
    others = {"wires": signals.wire_rotation_rad}
    if signals.joint is not None:
        others["lvdts"] = signals.joint.rotation_rad
    for name, rotation in others.items():
        own = replace(settings, zero_sigma_rad=bent_zero if name == "wires" else zero)
        value, sigma = hold_level(signals.time_s, rotation, track.held_until_s, own)
        if name != signals.lead and math.isfinite(value):
            theta0[name] = _level(value, sigma, gains.of(name))
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


def _sway(signals: Signals, track: MotionTrack, hold: slice) -> tuple[float, float]:
    """What the rotation moves by from what tiltmeters show over `hold` to the release, and its sigma.

    The mean is that of the rotation of the family that leads, with the time constant of the tiltmeters.
    """
    rig, rate = signals.record.rig, signals.record.rate_hz
    time_constant_s = max(
        rig.channel(name).time_constant_s for name in signals.record.family("tiltmeter", "x")
    )
    start = max(0, hold.start - round(_TIME_CONSTANTS * time_constant_s * rate))
    followed = signals.bridged_rad[start : hold.stop]
    if time_constant_s > 0.0:
        kept = math.exp(-1.0 / (time_constant_s * rate))
        followed = followed[0] + lfilter([1.0 - kept], [1.0, -kept], followed - followed[0])
    exact = replace(signals.settings, zero_sigma_rad=0.0)
    _, noise = hold_level(signals.time_s, signals.rotation_rad, track.held_until_s, exact)
    moved = track.theta0_rad - float(followed[hold.start - start :].mean())
    return (moved, noise) if math.isfinite(moved) and math.isfinite(noise) else (0.0, 0.0)


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
