"""Positions of sensors that a file may state and a wall can hardly have: warnings with the numbers.

What no wall can have (more than a metre outside) is a problem of the file (`daq_app.config.checks`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from daq_app.config.planning.plan import PlanNote
from daq_app.config.rig import Channel, Family, Rig, names

BRACKET_M = 0.02
"""How far from the surface that it is fixed to a sensor's point may lie: a bracket (assumed)."""
ABOVE_JOINT_M = 0.1
"""Height of an LVDT's point above the base joint, from which the bending of the wall is in its reading."""
STEEPEST = math.sin(math.radians(45))
"""Share of a wire's length that lies across the rocking motion, from which it hardly sees it."""


def geometry_notes(rig: Rig) -> Iterator[PlanNote]:
    """Warnings, one for each way in which sensors stand oddly."""
    half, length, height = rig.specimen.base_width_m / 2, rig.specimen.length_m / 2, rig.specimen.height_m
    lvdts = [c for c in rig.of_family("lvdt") if c.axis == "z"]
    yield from _off(
        lvdts,
        lambda c: abs(abs(c.position_m[0]) - half),
        BRACKET_M,
        lambda far: (
            f"stand up to {far * 1e3:.0f} mm off the faces of the wall (x = ±{half:.3f} m); the rotation "
            "comes out wrong by as much as x is"
        ),
    )
    yield from _off(
        lvdts,
        lambda c: abs(c.position_m[2]),
        ABOVE_JOINT_M,
        lambda far: (
            f"stand up to {far:.2f} m above the base joint (z = 0): the wall's bending is in their reading"
        ),
    )
    if len(lvdts) >= 2 and len({round(c.position_m[0], 3) for c in lvdts}) < 2:
        yield PlanNote(
            "warning",
            names(lvdts),
            f"all stand at x = {lvdts[0].position_m[0]:.3f} m: openings on one face alone cannot "
            "tell rotation from sinking. Place LVDTs on both faces",
        )
    on_wall: tuple[Family, ...] = ("wire", "accelerometer", "tiltmeter")
    for family in on_wall:
        fixed = rig.of_family(family)
        yield from _off(
            fixed,
            lambda c: max(c.position_m[2] - height, -c.position_m[2]),
            BRACKET_M,
            lambda far: (
                f"are fixed up to {far:.2f} m beyond the wall, which reaches from z = 0 to {height:.2f} m"
            ),
        )
        yield from _off(
            fixed,
            lambda c: abs(c.position_m[0]) - half,
            10 * BRACKET_M,
            lambda far: f"are fixed up to {far:.2f} m in front of the wall's faces (x = ±{half:.3f} m)",
        )
    yield from _off(
        [channel for channel in rig.channels if not channel.auxiliary],
        lambda c: abs(c.position_m[1]) - length,
        BRACKET_M,
        lambda far: f"stand up to {far:.2f} m beyond the ends of the wall (y = ±{length:.2f} m)",
    )
    yield from _steep(rig)


def _off(
    channels: Sequence[Channel],
    distance_m: Callable[[Channel], float],
    tolerance_m: float,
    words: Callable[[float], str],
) -> Iterator[PlanNote]:
    odd = [channel for channel in channels if distance_m(channel) > tolerance_m]
    if odd:
        far = max(distance_m(channel) for channel in odd)
        yield PlanNote("warning", names(odd), f"{words(far)}. Check position_m")


def _steep(rig: Rig) -> Iterator[PlanNote]:
    steep = []
    for wire in rig.of_family("wire"):
        if wire.anchor_m is not None:
            across = math.hypot(*(wire.anchor_m[k] - wire.position_m[k] for k in (1, 2)))
            if across > STEEPEST * math.dist(wire.anchor_m, wire.position_m):
                steep.append(wire)
    if steep:
        yield PlanNote(
            "warning",
            names(steep),
            "run at more than 45° to the rocking motion (x), of which they see the smaller part. "
            "Check anchor_m",
        )
