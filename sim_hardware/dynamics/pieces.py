"""Motion as polynomials in time: the form in which every trajectory is stored and evaluated.

A trajectory is a table of pieces.  Row i holds for ``START[i] ≤ t < START[i+1]``; with
``x = (t − start)/scale`` the rotation is Σ coef[k] xᵏ and so is the velocity, each of degree 7.
Before the first row its value at x = 0 holds, with no velocity.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.jit import kernel, part

START: Final = 0
SCALE: Final = 1
SIDE: Final = 2  # ±1 while rocking on that side; the sign of θ elsewhere
ROTATION: Final = 3  # first of 8 coefficients
VELOCITY: Final = 11  # first of 8 coefficients
N_COLUMNS: Final = 19


@part
def horner(row: NDArray[np.float64], first: int, x: float) -> float:
    """Polynomial of degree 7 at x in [0, 1]; its coefficients start at column `first` of `row`, (19,)."""
    value = row[first + 7]
    for k in range(6, -1, -1):
        value = value * x + row[first + k]
    return float(value)


@part
def horner_slope(row: NDArray[np.float64], first: int, x: float) -> float:
    """Derivative by x of the same polynomial."""
    value = 7.0 * row[first + 7]
    for k in range(6, 0, -1):
        value = value * x + k * row[first + k]
    return float(value)


@part
def find_piece(pieces: NDArray[np.float64], t: float, hint: int) -> int:
    """Row of `pieces` (m, 19) that holds at `t`, s, or −1 before the first; fast when `hint` is near."""
    n = pieces.shape[0]
    i = hint
    if i < 0 or i >= n or pieces[i, START] > t:
        low, high = -1, i if 0 <= i < n else n
        while high - low > 1:
            middle = (low + high) // 2
            if pieces[middle, START] <= t:
                low = middle
            else:
                high = middle
        return low
    while i + 1 < n and pieces[i + 1, START] <= t:
        i += 1
    return i


@part
def _rotation_only(
    pieces: NDArray[np.float64], times: NDArray[np.float64], rotation: NDArray[np.float64]
) -> None:
    """θ alone, with the coefficients of the piece kept at hand from one time to the next."""
    i, start, end, rate = int(np.int64(-1)), np.inf, -np.inf, 1.0
    c0 = c1 = c2 = c3 = c4 = c5 = c6 = c7 = 0.0
    for k in range(times.size):
        t = times[k]
        if not start <= t < end:
            i = find_piece(pieces, t, i)
            row = pieces[max(i, 0)]
            start = row[START] if i >= 0 else -np.inf
            end = pieces[i + 1, START] if i + 1 < pieces.shape[0] else np.inf
            rate = 1.0 / row[SCALE] if i >= 0 else 0.0
            c0, c1, c2, c3 = row[ROTATION], row[ROTATION + 1], row[ROTATION + 2], row[ROTATION + 3]
            c4, c5, c6, c7 = row[ROTATION + 4], row[ROTATION + 5], row[ROTATION + 6], row[ROTATION + 7]
        if rate == 0.0:
            rotation[k] = c0
            continue
        x = (t - start) * rate
        y = x * x
        low = (c0 + c1 * x) + (c2 + c3 * x) * y
        high = (c4 + c5 * x) + (c6 + c7 * x) * y
        rotation[k] = low + high * (y * y)


@kernel
def evaluate(
    pieces: NDArray[np.float64],
    times: NDArray[np.float64],
    rotation: NDArray[np.float64],
    velocity: NDArray[np.float64],
    acceleration: NDArray[np.float64],
) -> None:
    """Fill θ, θ̇, θ̈ (n,), rad and s, at `times` (n,); an output of length 0 is left out."""
    want_velocity, want_acceleration = velocity.size > 0, acceleration.size > 0
    if not want_velocity and not want_acceleration:
        _rotation_only(pieces, times, rotation)
        return
    i = int(np.int64(-1))
    for k in range(times.size):
        t = times[k]
        i = find_piece(pieces, t, i)
        if i < 0:
            rotation[k] = pieces[0, ROTATION]
            if want_velocity:
                velocity[k] = 0.0
            if want_acceleration:
                acceleration[k] = 0.0
            continue
        row = pieces[i]
        x = (t - row[START]) / row[SCALE]
        rotation[k] = horner(row, ROTATION, x)
        if want_velocity:
            velocity[k] = horner(row, VELOCITY, x)
        if want_acceleration:
            acceleration[k] = horner_slope(row, VELOCITY, x) / row[SCALE]


def constant_piece(start_s: float, rotation_rad: float) -> NDArray[np.float64]:
    """One row: at rest at `rotation_rad` from `start_s` on."""
    row = np.zeros(N_COLUMNS)
    row[START], row[SCALE], row[ROTATION] = start_s, 1.0, rotation_rad
    row[SIDE] = np.sign(rotation_rad)
    return row
