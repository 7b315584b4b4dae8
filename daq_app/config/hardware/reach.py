"""How far a rigid wall may tilt before a sensor leaves its range: a check of the rig file only.

(Rotations are computed from recordings by daq_app.rocking, not here.)
"""

from __future__ import annotations

import math
from typing import Final

from daq_app.config.rig import Channel, Rig, Specimen, Vector3

LARGEST_LEVEL: Final = 0.40
"""θ0/α of level L4, the largest release of the campaign (Table 3.2)."""
_STEP: Final = 0.01


def moved(specimen: Specimen, point: Vector3, theta_rad: float) -> Vector3:
    """Where a point of the wall is when the wall has turned about its edge by `theta_rad`."""
    pivot = math.copysign(specimen.base_width_m / 2, theta_rad)
    dx, z = point[0] - pivot, point[2]
    cos, sin = math.cos(theta_rad), math.sin(theta_rad)
    return (pivot + dx * cos + z * sin, point[1], z * cos - dx * sin)


def expected_si(specimen: Specimen, channel: Channel, theta_rad: float) -> float:
    """What a slow displacement or tilt sensor shows at a rotation; 0 for the others."""
    place = moved(specimen, channel.position_m, theta_rad)
    if channel.family == "laser":
        axis = "xyz".index(channel.axis)
        return place[axis] - channel.position_m[axis]
    if channel.family == "lvdt":
        return place[2] - channel.position_m[2]
    if channel.family == "wire" and channel.anchor_m is not None:
        return math.dist(channel.anchor_m, channel.position_m) - math.dist(channel.anchor_m, place)
    if channel.family == "tiltmeter" and channel.axis == "x":
        return theta_rad
    return 0.0


def range_ends_at(rig: Rig, channel: Channel) -> float:
    """Largest |θ|/α, in steps of 0.01 up to 1, at which the channel is still within its range."""
    low, high = channel.range_si
    for step in range(1, 101):
        for side in (1.0, -1.0):
            theta = side * step * _STEP * rig.specimen.alpha0_rad
            if not low <= expected_si(rig.specimen, channel, theta) <= high:
                return (step - 1) * _STEP
    return 1.0
