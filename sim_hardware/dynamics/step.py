"""One Dormand–Prince 8(5,3) step of the folded equation, and its interpolant as polynomials.

Coefficients: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, DOP853; SciPy has the
same ones behind an import that takes longer than this whole module. Rotation and speed are scalars, so a step
costs no allocation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics.terms import acceleration
from sim_hardware.jit import part

N_STAGES: Final = 12
_N_ALL: Final = 16
TABLE: Final = np.loadtxt(Path(__file__).with_name("dop853.txt"))
"""Rows as the file's head says."""
_A: Final = np.ascontiguousarray(TABLE[:_N_ALL])
_B: Final = TABLE[_N_ALL, :N_STAGES].copy()
_C: Final = TABLE[_N_ALL + 1].copy()
_E3: Final = TABLE[_N_ALL + 2, : N_STAGES + 1].copy()
_E5: Final = TABLE[_N_ALL + 3, : N_STAGES + 1].copy()
_D: Final = np.ascontiguousarray(TABLE[_N_ALL + 4 :])


@part
def take_step(
    t: float,
    q: float,
    v: float,
    h: float,
    c: NDArray[np.float64],
    kq: NDArray[np.float64],
    kv: NDArray[np.float64],
    scale_q: float,
    scale_v: float,
) -> tuple[float, float, float]:
    """(q, v, error) after `h`; stages are left in `kq` and `kv` (16), of which 0 must be set before.

    The error is relative to the scales (Hairer's norm of the two embedded formulas).
    """
    for i in range(1, N_STAGES):
        dq = 0.0
        dv = 0.0
        for j in range(i):
            dq += _A[i, j] * kq[j]
            dv += _A[i, j] * kv[j]
        kq[i] = v + h * dv
        kv[i] = acceleration(q + h * dq, kq[i], t + _C[i] * h, c)
    dq = 0.0
    dv = 0.0
    for j in range(N_STAGES):
        dq += _B[j] * kq[j]
        dv += _B[j] * kv[j]
    q1 = q + h * dq
    v1 = v + h * dv
    kq[N_STAGES] = v1
    kv[N_STAGES] = acceleration(q1, v1, t + h, c)
    e3q = e3v = e5q = e5v = 0.0
    for j in range(N_STAGES + 1):
        e3q += _E3[j] * kq[j]
        e3v += _E3[j] * kv[j]
        e5q += _E5[j] * kq[j]
        e5v += _E5[j] * kv[j]
    e5 = (e5q / scale_q) ** 2 + (e5v / scale_v) ** 2
    e3 = (e3q / scale_q) ** 2 + (e3v / scale_v) ** 2
    if e5 == 0.0 and e3 == 0.0:
        return q1, v1, 0.0
    return q1, v1, h * e5 / np.sqrt(2.0 * (e5 + 0.01 * e3))


@part
def _lift(out: NDArray[np.float64], first: int, add: float, complement: bool) -> None:
    """Add a constant to the polynomial in ``out[first:first+8]`` and multiply it by x, or by 1 − x."""
    out[first] += add
    if complement:
        for m in range(first + 7, first, -1):
            out[m] -= out[m - 1]
    else:
        for m in range(first + 7, first, -1):
            out[m] = out[m - 1]
        out[first] = 0.0


@part
def _to_powers(
    y0: float, y1: float, h: float, k: NDArray[np.float64], out: NDArray[np.float64], first: int
) -> None:
    """Write the interpolant of one component as powers of x = (t − t₀)/h into ``out[first:first+8]``."""
    d3 = d4 = d5 = d6 = 0.0
    for j in range(_N_ALL):
        d3 += _D[0, j] * k[j]
        d4 += _D[1, j] * k[j]
        d5 += _D[2, j] * k[j]
        d6 += _D[3, j] * k[j]
    rise = y1 - y0
    bend = h * k[0] - rise
    out[first : first + 8] = 0.0
    _lift(out, first, h * d6, False)
    _lift(out, first, h * d5, True)
    _lift(out, first, h * d4, False)
    _lift(out, first, h * d3, True)
    _lift(out, first, 2.0 * rise - h * (k[N_STAGES] + k[0]), False)
    _lift(out, first, bend, True)
    _lift(out, first, rise, False)
    out[first] += y0


@part
def interpolant(
    t: float,
    q: float,
    v: float,
    q1: float,
    v1: float,
    h: float,
    c: NDArray[np.float64],
    kq: NDArray[np.float64],
    kv: NDArray[np.float64],
    row: NDArray[np.float64],
    first_q: int,
    first_v: int,
) -> None:
    """Powers of q and v over the step just taken, after the three extra stages."""
    for i in range(N_STAGES + 1, _N_ALL):
        dq = 0.0
        dv = 0.0
        for j in range(i):
            dq += _A[i, j] * kq[j]
            dv += _A[i, j] * kv[j]
        kq[i] = v + h * dv
        kv[i] = acceleration(q + h * dq, kq[i], t + _C[i] * h, c)
    _to_powers(q, q1, h, kq, row, first_q)
    _to_powers(v, v1, h, kv, row, first_v)
