"""The wire map: shortening of a wire from the rotation of a rigid wall, and back, in closed form.

The wall turns about its edge at x = +b/2 (θ > 0) or −b/2 (θ < 0). In the (x, z) plane the point P on the wall
and the anchor A keep their distances ρ_P, ρ_A from that edge, so the length of the wire is
L² = Δy² + ρ_A² + ρ_P² − 2 ρ_A ρ_P cos(γ − θ), with γ the angle from P to A while the wall is upright: this is
√((d+Δx)²+Δz²) − d written about the edge, and its inverse is exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

_STEP_RAD = 1e-6


def wire_shortening(
    rotation_rad: ArrayLike, position_m: ArrayLike, anchor_m: ArrayLike, half_width_m: float
) -> Floats:
    """Shortening in m, (…, n), at rotations (n,) of wires from `position_m` to `anchor_m`, (…, 3) each."""
    theta = np.atleast_1d(np.asarray(rotation_rad, dtype=np.float64))
    position, anchor = (np.asarray(place, dtype=np.float64)[..., None] for place in (position_m, anchor_m))
    pivot = np.where(theta < 0.0, -half_width_m, half_width_m)
    arm_x, arm_z = position[..., 0, :] - pivot, position[..., 2, :]
    sin, cos = np.sin(theta), np.cos(theta)
    x = pivot + arm_x * cos + arm_z * sin
    z = arm_z * cos - arm_x * sin
    dy = anchor[..., 1, :] - position[..., 1, :]
    length = np.sqrt((anchor[..., 0, :] - x) ** 2 + dy**2 + (anchor[..., 2, :] - z) ** 2)
    return np.asarray(np.linalg.norm(anchor - position, axis=-2) - length)


def lever(position_m: ArrayLike, anchor_m: ArrayLike, half_width_m: float) -> Floats:
    """ds/dθ of wires in m/rad at upright, the mean of both sides, of shape (…)."""
    ends = wire_shortening((-_STEP_RAD, _STEP_RAD), position_m, anchor_m, half_width_m)
    return np.asarray((ends[..., 1] - ends[..., 0]) / (2.0 * _STEP_RAD))


def wire_rotation(
    shortening_m: Floats, position_m: ArrayLike, anchor_m: ArrayLike, half_width_m: float
) -> Floats:
    """Rotation in rad, (…, n), that each wire alone shows at shortenings (…, n); NaN where none explains one.

    Wires lead from `position_m` to `anchor_m`, (…, 3) each.
    """
    return WireInverse(position_m, anchor_m, half_width_m).rotation(shortening_m)


class WireInverse:
    """Shortening to rotation of wires from `position_m` to `anchor_m`, (…, 3) each.

    Only two pivots exist: everything that does not depend on the sample is known per side, and found once.
    """

    def __init__(self, position_m: ArrayLike, anchor_m: ArrayLike, half_width_m: float) -> None:
        position, anchor = (np.asarray(place, dtype=np.float64) for place in (position_m, anchor_m))
        pivots = np.array([half_width_m, -half_width_m])
        ax, px = anchor[..., 0, None] - pivots, position[..., 0, None] - pivots
        az, pz = anchor[..., 2, None], position[..., 2, None]
        dy = anchor[..., 1, None] - position[..., 1, None]
        self._squares = ax * ax + az * az + px * px + pz * pz + dy * dy
        self._products = 2.0 * np.sqrt((ax * ax + az * az) * (px * px + pz * pz))
        self._gammas = np.arctan2(ax, az) - np.arctan2(px, pz)
        self._direction = np.sign(lever(position, anchor, half_width_m))[..., None]
        self._length_m = np.linalg.norm(anchor - position, axis=-1)[..., None]

    def rotation(self, shortening_m: Floats) -> Floats:
        """Rotation in rad, (…, n), at shortenings (…, n)."""
        negative = shortening_m * self._direction < 0.0
        squares, products, gamma = (
            np.where(negative, values[..., 1:], values[..., :1])
            for values in (self._squares, self._products, self._gammas)
        )
        length = self._length_m - shortening_m
        # In place: new arrays of a whole record would cost as much as the arithmetic.
        opening = np.subtract(squares, np.multiply(length, length, out=length), out=squares)
        opening /= products
        with np.errstate(invalid="ignore"):
            np.arccos(opening, out=opening)
        return np.asarray(np.subtract(gamma, np.copysign(opening, gamma, out=opening), out=gamma))
