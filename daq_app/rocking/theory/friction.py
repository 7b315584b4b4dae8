"""How far a base slips between two impacts whose friction does not hold it while the wall is nearly upright.

A block that rocks on an edge pushes it outwards, most while it is nearly upright. Friction that holds less
lets the edge slip below a rotation, and slows it beyond that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import G_M_S2

Floats = NDArray[np.float64]

_STEPS: Final = 120
"""Number of steps of a half-cycle: with so many the slip is good to a per cent."""


@dataclass(frozen=True, slots=True)
class Slips:
    """Slips of half-cycles, (k,), of a base that accelerates by 1 m/s² for each rad below the rotation."""

    time_s: Floats
    """(steps + 1, k) times from the peak of each half-cycle, from its first impact to its last."""
    acceleration: Floats
    """(steps + 1, k) acceleration outwards at these times, rad."""
    end: Floats
    """Speed of the slip at the impact that ends the half-cycle, rad s."""
    slip: Floats
    """How far the base slips between the two impacts, rad s²."""


def push(rotation_rad: float, alpha_rad: float, p_rad_s: float, r0_m: float) -> float:
    """Coefficient of friction that keeps the edge of a rocking block in place, 1.

    Force along the floor over that on it, of a block at rest at this rotation: its centre of mass speeds up
    by p² R sin(α − θ) across the line to the edge.
    """
    left = alpha_rad - rotation_rad
    faster = p_rad_s**2 * r0_m / G_M_S2 * math.sin(left)
    return faster * math.cos(left) / (1.0 - faster * math.sin(left))


def slips_below(
    rotation_rad: float,
    peaks_rad: Floats,
    alpha_rad: float,
    p_rad_s: float,
    begin: Floats | float = 0.0,
) -> Slips:
    """Slips of half-cycles with these peaks (k,), by an edge that slips below a rotation.

    The motion is that of a block, to first order about upright (Housner 1963), and the slip does not act
    back on it. `begin` (k,): speed with which the impact leaves the edge, outwards, over the acceleration
    for each rad, rad s; 0 for one that friction holds at impacts.
    """
    alpha, p = alpha_rad, p_rad_s
    peaks = np.minimum(peaks_rad, 0.95 * alpha)
    half_s = np.arccosh(alpha / (alpha - peaks)) / p
    time_s = np.linspace(-1.0, 1.0, _STEPS + 1)[:, None] * half_s
    pushed = rotation_rad - alpha + (alpha - peaks) * np.cosh(p * time_s)
    speeds, way = _slides(pushed, 2.0 * half_s / _STEPS, np.zeros(peaks.size) + begin)
    acceleration = np.where((speeds > 0.0) | (pushed > 0.0), pushed, 0.0)
    acceleration[-1] = np.maximum(pushed[-1], 0.0)
    return Slips(time_s, acceleration, speeds[-1], way[-1])


def slips_as_it_rocks(
    below_rad: Floats, rotations_rad: Floats, step_s: float, begin: Floats
) -> tuple[Floats, Floats]:
    """Speed, rad s, and way, rad s², (n, k), of slips of a half-cycle with these rotations' sizes, (n,).

    The edge speeds up as in `slips_below`. `below_rad`, `begin`: (k,) rotation below which it slips, and the
    speed with which the impact leaves it, rad s.
    """
    return _slides(below_rad - rotations_rad[:, None], step_s, begin)


def _slides(pushed: Floats, step_s: Floats | float, begin: Floats) -> tuple[Floats, Floats]:
    """Speed and way, (n, k), of edges with these accelerations outwards, (n, k), as long as they slip."""
    faster = 0.5 * (pushed[1:] + pushed[:-1]) * step_s
    speeds, way = np.empty_like(pushed), np.zeros_like(pushed)
    speeds[0] = begin
    for place, more in enumerate(faster, start=1):
        speeds[place] = np.maximum(speeds[place - 1] + more, 0.0)
    way[1:] = np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * step_s, axis=0)
    return speeds, way
