"""Half-cycles from given turning points: the motion on either side of each peak, without impacts.

Between two impacts nothing is random: from the peak, the equation of motion gives the fall to the
impact that follows and, run backwards, the rise from the impact before. A fit that starts at the
measured peaks therefore never has to guess the scatter of r, and its errors do not accumulate.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import pieces as pc
from sim_hardware.dynamics import terms
from sim_hardware.dynamics.kernel import _root, _swing
from sim_hardware.jit import kernel, part

# columns of the result
FALL_S: Final = 0  # from the peak (the release, in row 0) to the impact
RISE_S: Final = 1  # from the impact before to the peak; 0 in row 0
SPEED_OUT: Final = 2  # |θ̇| at the impact that ends the half-cycle
SPEED_IN: Final = 3  # |θ̇| after the impact that began it; 0 in row 0
PEAK: Final = 4  # |θ| at the turning point; differs from the start only where row 0 has a velocity
FIRST_CROSSING: Final = 5  # then F times of the fall and F of the rise, s from the peak
_LIMIT_S: Final = 20.0
_PASSES: Final = 8  # over when a slow release begins …
_SAME_S: Final = 1e-7  # … which is known once it moves by less


@part
def _crossings(
    pieces: NDArray[np.float64],
    used: int,
    end: float,
    start: float,
    side: float,
    levels: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Times from `start` at which |θ| falls through each of `levels`; NaN where it does not."""
    for k in range(levels.size):
        out[k] = np.nan
        for i in range(used):
            row = pieces[i]
            stop = pieces[i + 1, pc.START] if i + 1 < used else end
            x = (stop - row[pc.START]) / row[pc.SCALE]
            if x <= 0.0:
                continue
            if side * pc.horner(row, pc.ROTATION, x) < levels[k]:
                if side * pc.horner(row, pc.ROTATION, 0.0) >= levels[k]:
                    at = _root(row, pc.ROTATION, side * levels[k], 0.0, x)
                    out[k] = row[pc.START] + row[pc.SCALE] * at - start
                break


@part
def _reverse(vector: NDArray[np.float64], time: float, out: NDArray[np.float64]) -> None:
    """The vector under which time runs backwards from `time`."""
    out[:] = vector
    for index in par.ODD_IN_TIME:
        out[index] = -vector[index]
    out[par.AMBIENT_PHASE] = vector[par.AMBIENT_PHASE] + 4.0 * math.pi * vector[par.AMBIENT_HZ] * time


@part
def _way(
    vector: NDArray[np.float64],
    start: tuple[float, float, float, float],
    levels: NDArray[np.float64],
    c: NDArray[np.float64],
    pieces: NDArray[np.float64],
    crossings: NDArray[np.float64],
) -> tuple[float, float, float]:
    """(s, rad/s, rad): how long the way from `start` to upright takes, |θ̇| there, |θ| at the turning point.

    `start`: (s, |θ|, its rate, side). `crossings` (F,) become the times at which `levels` are passed.
    """
    t, q, v, side = start
    end = np.zeros(5)
    _, used = _swing(t, q, v, side, t + _LIMIT_S, vector[par.TOLERANCE], c, pieces, 0, end)
    _crossings(pieces, used, end[0], t, side, levels, crossings)
    return end[0] - t, max(-end[2], 0.0), end[4]


@kernel
def half_cycles(
    vector: NDArray[np.float64],
    times: NDArray[np.float64],
    rotations: NDArray[np.float64],
    levels: NDArray[np.float64],
    release_side: float,
    first_is_release: bool,
    out: NDArray[np.float64],
) -> None:
    """Fill `out` (n, 5 + 2F) from peaks at `times` (n,), s from release, with signed `rotations` (n,).

    `levels` (n, F) are |θ| at which crossing times are wanted. Row k is the half-cycle after k
    impacts. With `first_is_release` row 0 starts as the vector says (initial velocity, slow release)
    and has no rise.
    """
    c = np.zeros(terms.N_COEFFICIENTS)
    pieces = np.empty((400, pc.N_COLUMNS))
    back = vector.copy()
    first_rise = FIRST_CROSSING + levels.shape[1]
    held, later = 0.0, 0.0
    for k in range(times.size):
        side = -1.0 if rotations[k] < 0.0 else 1.0
        q, t, row = abs(rotations[k]), times[k], out[k]
        released = first_is_release and k == 0
        terms.setup(vector, side, k, release_side, c)
        if released:
            terms.hold_back(vector, q, c)
            held = c[terms.C_HOLD]
        start = (t, q, vector[par.OMEGA0] if released else 0.0, side)
        falls = row[FIRST_CROSSING:first_rise]
        row[FALL_S], row[SPEED_OUT], row[PEAK] = _way(vector, start, levels[k], c, pieces, falls)
        if released:
            row[RISE_S], row[SPEED_IN] = 0.0, 0.0
            row[first_rise:] = 0.0
            continue
        _reverse(vector, t, back)
        # Nobody sees when a slow release begins: the first half-cycle after it says how long before its time.
        for _ in range(_PASSES if k == 1 and held > 0.0 else 1):
            before = later
            terms.setup(back, side, k, release_side, c)
            if k == 1:
                terms.hold_on(vector, held, 0.0, later, t, c)
            row[RISE_S], row[SPEED_IN], _ = _way(back, start, levels[k], c, pieces, row[first_rise:])
            later = out[0, FALL_S] + row[RISE_S] - t if k == 1 else later
            if abs(later - before) < _SAME_S:
                break
