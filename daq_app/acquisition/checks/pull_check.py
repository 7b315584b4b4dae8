"""The pull test: pull the wall a little, and every channel must say the same rotation.

It finds what no channel shows at rest: a sensor wired the wrong way round, two plugs exchanged, a
loose wire, a wrong sensitivity.  The reference is the median over all channels that can tell the
rotation alone, so a few faulty ones do not move it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.checks.check_model import Finding, SensorCheck, Verdict
from daq_app.config.rig import Channel, Rig
from daq_app.config.units import G_M_S2
from daq_app.rocking.geometry.kinematics import RotationGeometry, WireGeometry

Floats = NDArray[np.float64]

LEAST_PULL_RAD: Final = 4e-3
"""Smaller pulls do not tell polarity from noise on all families."""
TOLERANCE: Final = {"wire": 0.06, "lvdt": 0.15, "tiltmeter": 0.06, "accelerometer": 0.5}
"""Largest relative disagreement with the common rotation; LVDTs see the joint crush as well."""
_STILL: Final = 0.15
"""A response below this share of the expected one is none."""
_JUDGED_NOISES: Final = 6.0
"""A channel is judged when it should move by more than this many times its noise."""


class PullTooSmall(ValueError):
    """The wall was not pulled far enough to judge by."""


def expected_change(rig: Rig, rotation_rad: float) -> Floats:
    """(n_channels,) change of every channel from upright to a steady rotation, SI.

    LVDT: opening at its place for a rigid rotation about the edge; wire: shortening by its true
    geometry; tiltmeter: the rotation (x axis) or nothing; accelerometer that responds to DC: the
    component of gravity; IEPE accelerometer: nothing; auxiliary channels: nothing that is known.
    """
    half = rig.specimen.base_width_m / 2.0
    wires = rig.of_family("wire")
    shortening = dict(
        zip((w.id for w in wires), WireGeometry.of(wires, half).shortening(rotation_rad)[:, 0], strict=True)
    )
    return np.array(
        [_expected(channel, rotation_rad, half, shortening.get(channel.id, 0.0)) for channel in rig.channels]
    )


def _expected(channel: Channel, theta: float, half_m: float, shortening_m: float) -> float:
    match channel.family:
        case "lvdt":
            arm = half_m - channel.position_m[0] if theta > 0 else half_m + channel.position_m[0]
            return arm * math.sin(abs(theta))
        case "wire":
            return shortening_m
        case "tiltmeter":
            return theta if channel.axis == "x" else 0.0
        case _:
            if channel.measurement == "iepe" or channel.auxiliary:
                return 0.0
            # Specific force (acceleration − gravity): gravity turns towards −x in the wall's frame.
            components = {"x": -math.sin(theta), "y": 0.0, "z": math.cos(theta) - 1.0}
            return G_M_S2 * components[channel.axis]


def common_rotation(rig: Rig, change: Floats) -> float:
    """Median rotation of all channels that can tell it alone; `PullTooSmall` below `LEAST_PULL_RAD`."""
    geometry = RotationGeometry.from_rig(rig)
    row = {channel.id: index for index, channel in enumerate(rig.channels)}
    wires = change[[row[name] for name in geometry.wires.ids]]
    signed = list(geometry.wires.rotation_of_each(wires[:, None])[:, 0])
    signed += [change[row[name]] for name in geometry.tilt_ids]
    signed = [value for value in signed if math.isfinite(value)]
    side = 1.0 if np.median(signed) >= 0 else -1.0
    half = rig.specimen.base_width_m / 2.0
    for channel in rig.of_family("lvdt"):
        arm = half - side * channel.position_m[0]
        if arm > half:
            signed.append(side * math.asin(max(-1.0, min(1.0, change[row[channel.id]] / arm))))
    rotation = float(np.median(signed))
    if abs(rotation) < LEAST_PULL_RAD:
        raise PullTooSmall(
            f"The wall turned by {1e3 * abs(rotation):.1f} mrad only; pull it to at least "
            f"{1e3 * LEAST_PULL_RAD:.0f} mrad, hold it still and take the pull test again."
        )
    return rotation


def check_pull(rig: Rig, check: SensorCheck, change: Floats) -> SensorCheck:
    """`check` with what the pull test adds.

    `change` (n_channels,) is the mean of each channel while pulled minus its mean upright, SI.
    Raises `PullTooSmall`.
    """
    rotation = common_rotation(rig, change)
    expected = expected_change(rig, rotation)
    updated = list(check.channels)
    suspects = []
    for index, channel in enumerate(rig.channels):
        old = [f for f in check.channels[index].findings if not f.code.startswith("pull-")]
        already_bad = any(finding.verdict is Verdict.NO_GO for finding in old)
        ratio, finding = _judge(channel, change[index], expected[index], rotation, rig)
        if finding is not None:
            suspects.append(index)
            if not already_bad:
                old.append(finding)
        updated[index] = replace(check.channels[index], findings=tuple(old), pull_ratio=ratio)
    for first, second in _swapped(rig, change, expected, suspects):
        for index, other in ((first, second), (second, first)):
            kept = [f for f in updated[index].findings if not f.code.startswith("pull-")]
            name = rig.channels[other].id
            text = f"Looks exchanged with {name}: each shows what the other should. Swap the plugs."
            updated[index] = replace(
                updated[index], findings=(*kept, Finding("pull-swapped", Verdict.NO_GO, text))
            )
    return replace(check, channels=tuple(updated), pull_rotation_rad=rotation)


def _judge(
    channel: Channel, change: float, expected: float, rotation: float, rig: Rig
) -> tuple[float | None, Finding | None]:
    """(measured over expected or None, what is wrong or None)."""
    if channel.measurement == "iepe" or channel.auxiliary:
        return None, None
    # The pivot of a real wall moves inwards by centimetres: the near face closes a little.
    slack = 0.15 * rig.specimen.base_width_m * abs(math.sin(rotation)) if channel.family == "lvdt" else 0.0
    noise = _JUDGED_NOISES * channel.noise_si
    shown = f"{1e3 * abs(rotation):.1f} mrad"
    if abs(expected) < noise + slack:
        if abs(change - expected) > 2.0 * noise + 2.0 * slack + 0.1 * abs(_scale(channel, rotation, rig)):
            text = f"Moves although the pull to {shown} should leave it in place. Check its place and wiring."
            return None, Finding("pull-moves", Verdict.NO_GO, text)
        return None, None
    ratio = change / expected
    allowed = TOLERANCE[channel.family] + (noise + slack) / abs(expected)
    if abs(ratio - 1.0) <= allowed:
        return ratio, None
    if abs(ratio + 1.0) <= allowed:
        text = (
            f"Wrong polarity: it moves the wrong way in the pull to {shown}. Turn its wires or set polarity."
        )
        return ratio, Finding("pull-polarity", Verdict.NO_GO, text)
    if abs(ratio) < _STILL:
        text = f"Does not move in the pull to {shown}. Check that it is fixed to the wall and plugged in."
        return ratio, Finding("pull-still", Verdict.NO_GO, text)
    text = (
        f"Shows {ratio:.2f} times the rotation of the others ({shown}). Check sensitivity, anchor and place."
    )
    return ratio, Finding("pull-disagrees", Verdict.NO_GO, text)


def _scale(channel: Channel, rotation: float, rig: Rig) -> float:
    """How much the most exposed channel of the family would move, SI."""
    arm = rig.specimen.base_width_m if channel.family == "lvdt" else rig.specimen.height_m
    if channel.family == "tiltmeter":
        return rotation
    return arm * rotation if channel.family != "accelerometer" else G_M_S2 * rotation


def _swapped(rig: Rig, change: Floats, expected: Floats, suspects: list[int]) -> list[tuple[int, int]]:
    """Pairs of suspects of one family where each shows what the other should."""
    pairs = []
    free = list(suspects)
    for first in suspects:
        if first not in free:
            continue
        for second in free:
            one, two = rig.channels[first], rig.channels[second]
            if second <= first or one.family != two.family:
                continue
            slack = 0.15 * float(np.max(np.abs(expected[[first, second]]))) + _JUDGED_NOISES * one.noise_si
            different = abs(expected[first] - expected[second]) > 1.2 * slack
            crossed = max(abs(change[first] - expected[second]), abs(change[second] - expected[first]))
            if different and crossed < slack:
                pairs.append((first, second))
                free.remove(first)
                free.remove(second)
                break
    return pairs
