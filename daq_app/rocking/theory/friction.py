"""How far a base slips between two impacts whose friction does not hold it while the wall is nearly upright.

A block that rocks on an edge pushes it outwards with p² R/g · sin(α − θ) cos(α − θ) of its weight: most while
it is nearly upright. Friction that holds less lets the edge slip below a rotation, and slows it beyond that.
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
    """The force along the floor that keeps the edge of a rocking block in place, over its weight, 1.

    It gives the centre of mass the acceleration that the block has at rest at this rotation.
    """
    left = alpha_rad - rotation_rad
    return p_rad_s**2 * r0_m / G_M_S2 * math.sin(left) * math.cos(left)


def slips_below(rotation_rad: float, peaks_rad: Floats, alpha_rad: float, p_rad_s: float) -> Slips:
    """Slips of half-cycles with these peaks (k,), by an edge that slips below a rotation.

    The motion is that of a block, to first order about upright (Housner 1963), and the slip does not act
    back on it. The edge is at rest after an impact.
    """
    alpha, p = alpha_rad, p_rad_s
    peaks = np.minimum(peaks_rad, 0.95 * alpha)
    half_s = np.arccosh(alpha / (alpha - peaks)) / p
    time_s = np.linspace(-1.0, 1.0, _STEPS + 1)[:, None] * half_s
    pushed = rotation_rad - alpha + (alpha - peaks) * np.cosh(p * time_s)
    step_s = 2.0 * half_s / _STEPS
    speed, slip = np.zeros(peaks.size), np.zeros(peaks.size)
    acceleration = np.zeros_like(time_s)
    for place in range(_STEPS):
        middle = 0.5 * (pushed[place] + pushed[place + 1])
        faster = np.maximum(speed + middle * step_s, 0.0)
        acceleration[place] = np.where((speed > 0.0) | (pushed[place] > 0.0), pushed[place], 0.0)
        slip += 0.5 * (speed + faster) * step_s
        speed = faster
    acceleration[-1] = np.maximum(pushed[-1], 0.0)
    return Slips(time_s, acceleration, speed, slip)
