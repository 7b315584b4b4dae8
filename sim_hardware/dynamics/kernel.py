"""The event-driven integrator: half-cycles between impacts, pieces, impacts and peaks as tables.

Steps are Dormand–Prince 8(5,3); events (impact, turning point, thresholds of non-smooth terms) are
roots of the step's own interpolant, found by Newton's method.  A step never crosses a kink: it is
cut there, and the next one starts in the new branch.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics import pieces as pc
from sim_hardware.dynamics import terms
from sim_hardware.dynamics.step import interpolant, take_step
from sim_hardware.jit import kernel, part

# how a run ended
AT_REST: Final = 0
DURATION_OVER: Final = 1
OVERTURNED: Final = 2
TABLE_FULL: Final = 3
# columns of the impact table
I_TIME: Final = 0
I_BEFORE: Final = 1  # θ̇⁻, signed
I_AFTER: Final = 2  # θ̇⁺, signed
I_SIDE: Final = 3  # side that the wall came from
I_KIND: Final = 4  # 0 impact, 1 second impact of a bounce
N_IMPACT_COLUMNS: Final = 5
# columns of the peak table: time, θ (signed)
N_PEAK_COLUMNS: Final = 2

_IMPACT: Final = 0
_END: Final = 1
_OVER: Final = 2
_FULL: Final = 3
_NEVER: Final = 2.0


@part
def _root(row: NDArray[np.float64], first: int, target: float, low: float, high: float) -> float:
    """x in [low, high] where the polynomial equals `target`; the ends must bracket it."""
    f_low, f_high = pc.horner(row, first, low) - target, pc.horner(row, first, high) - target
    # speeds are nearly straight between the ends; a rotation is cut just beyond its root
    x = low + (high - low) * f_low / (f_low - f_high)
    if first == pc.ROTATION:
        x = high - f_high / pc.horner_slope(row, first, high)
    for _ in range(60):
        if not low < x < high:
            x = 0.5 * (low + high)
        f = pc.horner(row, first, x) - target
        if f == 0.0 or high - low < 4e-16:
            return x
        if (f < 0.0) == (f_low < 0.0):
            low = x
        else:
            high = x
        step = f / pc.horner_slope(row, first, x)
        if abs(step) < 1e-9:  # the next error is its square
            return x - step
        x -= step
    return x


@part
def _threshold(
    row: NDArray[np.float64], at: float, q0: float, low: float, high: float, q_low: float, q_high: float
) -> float:
    """x in (low, high] where q crosses `at`, or 2 if it does not; its own starting point is no crossing."""
    if at <= 0.0 or q0 == at or (q_low - at) * (q_high - at) >= 0.0:
        return _NEVER
    return _root(row, pc.ROTATION, at, low, high)


@part
def _eighth_root(x: float) -> float:
    return math.sqrt(math.sqrt(math.sqrt(x)))


@part
def _first_guess(q: float, v: float, c: NDArray[np.float64]) -> float:
    """Time to the impact of the linearised block, a little long so that the step reaches over it."""
    rate = math.sqrt(c[terms.C_STIFF])
    arm = max(c[terms.C_ALPHA], 1e-6)
    fall_from = q
    time = 0.0
    if v > 0.0:
        ratio = min(v / (rate * max(arm - q, 1e-6)), 0.999)
        if q == 0.0:
            return 1.02 * 2.0 * math.atanh(ratio) / rate + 1e-9
        time = math.atanh(ratio) / rate
        fall_from = arm - (arm - q) * math.sqrt(1.0 - ratio * ratio)
    fall = min(fall_from / arm, 0.999)
    return 1.02 * (time + math.acosh(1.0 / (1.0 - fall)) / rate) + 1e-9


@part
def _accepted_step(
    t: float,
    q: float,
    v: float,
    h: float,
    tolerance: float,
    c: NDArray[np.float64],
    kq: NDArray[np.float64],
    kv: NDArray[np.float64],
    scale_q: float,
    scale_v: float,
) -> tuple[float, float, float, float]:
    """(h, q, v, error) of the step of `h` or less whose error is within the tolerance; fills kq and kv."""
    kq[0] = v
    kv[0] = terms.acceleration(q, v, t, c)
    q1, v1, error = take_step(t, q, v, h, c, kq, kv, scale_q, scale_v)
    while error > tolerance and h > 1e-10:
        h *= max(0.2, 0.9 * _eighth_root(tolerance / error))
        q1, v1, error = take_step(t, q, v, h, c, kq, kv, scale_q, scale_v)
    return h, q1, v1, error


@part
def _first_kink(
    row: NDArray[np.float64], c: NDArray[np.float64], q: float, q1: float, x_turn: float, q_turn: float
) -> tuple[float, float]:
    """(x, q) of the first rotation in a step from q to q1 at which the moment has a kink; (1, −1) for none.

    The step turns back at `x_turn` and `q_turn`; it is looked through on either side of that.
    """
    x_end, on_kink = 1.0, -1.0
    slack = c[terms.C_SLACK] if c[terms.C_CABLE] > 0.0 else 0.0
    loose = c[terms.C_STAY_LOOSE] if c[terms.C_STAY] > 0.0 else 0.0
    for at in (c[terms.C_WINKLER], slack, loose):
        for leg in range(2):
            low, high = (0.0, x_turn) if leg == 0 else (x_turn, 1.0)
            q_low, q_high = (q, q_turn) if leg == 0 else (q_turn, q1)
            x = _threshold(row, at, q if leg == 0 else -1.0, low, high, q_low, q_high)
            if x < x_end:
                x_end, on_kink = x, at
    return x_end, on_kink


@part
def _scales(q: float, v: float, c: NDArray[np.float64]) -> tuple[float, float]:
    """(rotation, speed) that errors of a swing are measured against: what its energy at (q, v) can reach."""
    stiff = c[terms.C_STIFF] * max(math.sin(c[terms.C_ALPHA]), 1e-3)
    return max(q, v * v / (2.0 * stiff)), math.sqrt(v * v + 2.0 * stiff * q)


@part
def _cut_state(row: NDArray[np.float64], x: float, on_kink: float, stuck: bool) -> tuple[float, float]:
    """(q, v) where a step is cut: exactly on the kink, or exactly at rest where friction holds the wall."""
    q, v = pc.horner(row, pc.ROTATION, x), pc.horner(row, pc.VELOCITY, x)
    if on_kink > 0.0:
        q = on_kink
    elif stuck:
        v = 0.0
    return q, v


@part
def _next_size(h: float, x_end: float, error: float, tolerance: float) -> float:
    """Size of the step to try next: by the error of a whole step, or what a cut left of it."""
    growth = 5.0 if error == 0.0 else min(5.0, 0.9 * _eighth_root(tolerance / error))
    return h * growth if x_end == 1.0 else max(h * (1.0 - x_end), 0.1 * h) * 1.02


@part
def _swing(
    t: float,
    q: float,
    v: float,
    side: float,
    t_end: float,
    tolerance: float,
    c: NDArray[np.float64],
    pieces: NDArray[np.float64],
    n: int,
    out: NDArray[np.float64],
) -> tuple[int, int]:
    """One half-cycle; returns (how it ended, rows used). `out` = t, q, v at the end, t and q of the peak."""
    kq, kv = np.zeros(16), np.zeros(16)
    rising = v > 0.0 or (v == 0.0 and terms.acceleration(q, v, t, c) > 0.0)
    scale_q, scale_v = _scales(q, v, c)
    out[3], out[4] = t, q
    # p h = 0.22 meets a tolerance of 1e-11; the rest of the swing adapts
    h = min(_first_guess(q, v, c), 0.22 * _eighth_root(tolerance / 1e-11) / math.sqrt(c[terms.C_STIFF]))
    # Friction changes its sign where the wall turns, and a rope that is paid out goes slack there.
    turns = c[terms.C_COULOMB] != 0.0 or c[terms.C_HOLD] < 0.0
    kinked = c[terms.C_PLAIN] == 0.0
    while True:
        if n >= pieces.shape[0]:
            return _FULL, n
        terms.set_region(c, q, rising)
        h, q1, v1, error = _accepted_step(t, q, v, h, tolerance, c, kq, kv, scale_q, scale_v)
        row = pieces[n]
        n += 1
        interpolant(t, q, v, q1, v1, h, c, kq, kv, row, pc.ROTATION, pc.VELOCITY)
        row[pc.START], row[pc.SCALE], row[pc.SIDE] = t, h, side
        x_turn, q_turn, ended = 0.0, q, -1
        if rising and v1 <= 0.0:
            x_turn = _root(row, pc.VELOCITY, 0.0, 0.0, 1.0)
            q_turn = pc.horner(row, pc.ROTATION, x_turn)
        x_end, on_kink = _first_kink(row, c, q, q1, x_turn, q_turn) if kinked else (1.0, -1.0)
        if x_turn > 0.0 and x_turn <= x_end:
            rising = False
            out[3], out[4] = t + h * x_turn, q_turn
            if turns:
                x_end, on_kink = x_turn, -1.0
        if not rising and v1 > 0.0 and q1 > 0.0 and x_end == 1.0:
            rising = True
        if q1 <= 0.0 and x_end == 1.0:
            x_end, ended = _root(row, pc.ROTATION, 0.0, x_turn, 1.0), _IMPACT
        if t + h * x_end >= t_end:
            x_end, ended, on_kink = (t_end - t) / h, _END, -1.0
        if x_end < 1.0 or ended >= 0:
            q1, v1 = _cut_state(row, x_end, on_kink, turns and x_end == x_turn)
        for k in range(pc.ROTATION, pc.N_COLUMNS):
            row[k] *= side
        t += h * x_end
        q, v = q1, v1
        if q > 0.5 * math.pi:
            ended = _OVER
        if ended >= 0:
            out[0], out[1], out[2] = t, q, v
            return ended, n
        h = _next_size(h, x_end, error, tolerance)


@part
def _too_tired(q: float, v: float, rest_energy: float, rest_amplitude: float) -> bool:
    """Whether the energy at (q, v) would not lift the wall to the amplitude that counts as rest."""
    return q < rest_amplitude and 0.5 * v * v + rest_energy * q / rest_amplitude <= rest_energy


@part
def _fill_flat(pieces: NDArray[np.float64], n: int, t: float, q: float, v: float, side: float) -> int:
    """A row of constant velocity; returns the rows used."""
    row = pieces[n]
    row[:] = 0.0
    row[pc.START], row[pc.SCALE], row[pc.SIDE] = t, 1.0, side
    row[pc.ROTATION], row[pc.ROTATION + 1], row[pc.VELOCITY] = side * q, side * v, side * v
    return n + 1


@part
def _note_impact(
    row: NDArray[np.float64], t: float, before: float, after: float, side: float, kind: float
) -> None:
    row[I_TIME], row[I_BEFORE], row[I_AFTER] = t, before, after
    row[I_SIDE], row[I_KIND] = side, kind


@part
def _bounce(
    vector: NDArray[np.float64],
    r: float,
    speed: float,
    after: float,
    side: float,
    t: float,
    pieces: NDArray[np.float64],
    n: int,
    impacts: NDArray[np.float64],
) -> tuple[int, float, float]:
    """(rows used, time, q) at the second impact of a bounce, from whose flight the wall goes on with `after`.

    `impacts` (2, 5): the row of the first impact, whose speed after it is set here, and of the second.
    """
    first = speed * r ** vector[par.BOUNCE_SHARE]
    flight = vector[par.BOUNCE] * speed / par.BOUNCE_SPEED
    impacts[0, I_AFTER] = side * first
    n = _fill_flat(pieces, n, t, 0.0, first, side)
    t += flight
    _note_impact(impacts[1], t, side * first, side * after, side, 1.0)
    return n, t, first * flight


@kernel
def integrate(
    vector: NDArray[np.float64],
    deviates: NDArray[np.float64],
    pieces: NDArray[np.float64],
    impacts: NDArray[np.float64],
    peaks: NDArray[np.float64],
) -> tuple[int, int, int, int, float]:
    """Run one test; fills the tables.

    `vector` (N_PARAMETERS,); `deviates` standard normal deviates of r by impact (0 beyond its end);
    `pieces` (m, 19), `impacts` (k, 5), `peaks` (k, 2) are filled from the top.
    Returns rows used of each, how it ended (AT_REST …) and when (seconds from release).
    """
    both, rest_energy, out = np.zeros((2, terms.N_COEFFICIENTS)), np.zeros(2), np.zeros(5)
    t_end = vector[par.DURATION]
    theta0 = vector[par.THETA0]
    release_side = -1.0 if theta0 < 0.0 else 1.0
    side = release_side
    t, q, v = 0.0, abs(theta0), vector[par.OMEGA0]
    # of a type, not literals: parts would be compiled once for the literal 0 and again for other counts
    n, n_impacts, n_peaks = int(np.int64(0)), int(np.int64(0)), int(np.int64(0))
    for i in range(2):
        terms.setup(vector, 2.0 * i - 1.0, n_peaks, release_side, both[i])
        rest_energy[i] = terms.work_to(vector[par.REST_AMPLITUDE], both[i])
    terms.hold_back(vector, q, both[1 if side > 0.0 else 0])
    held = both[1 if side > 0.0 else 0, terms.C_HOLD]
    changes = vector[par.CRUSH_ALPHA] != 0.0 or vector[par.SLOW_RELEASE] != 0.0
    limit = min(impacts.shape[0] - 2, peaks.shape[0] - 1)
    while True:
        c = both[1 if side > 0.0 else 0]
        if n_peaks > 0 and _too_tired(q, v, rest_energy[1 if side > 0.0 else 0], vector[par.REST_AMPLITUDE]):
            return _fill_flat(pieces, n, t, 0.0, 0.0, 0.0), n_impacts, n_peaks, AT_REST, t
        ended, n = _swing(t, q, v, side, t_end, vector[par.TOLERANCE], c, pieces, n, out)
        t, q, v = out[0], out[1], out[2]
        peaks[n_peaks, 0], peaks[n_peaks, 1] = out[3], side * out[4]
        n_peaks += 1
        if ended == _FULL or n + 4 > pieces.shape[0] or n_impacts >= limit:
            return n, n_impacts, n_peaks, TABLE_FULL, t
        if ended != _IMPACT:
            n = _fill_flat(pieces, n, t, q, 0.0, side)
            return n, n_impacts, n_peaks, OVERTURNED if ended == _OVER else DURATION_OVER, t
        speed = max(-v, 0.0)
        deviate = deviates[n_peaks - 1] if n_peaks <= deviates.size else 0.0
        r = terms.restitution(vector, speed, side, n_peaks - 1, deviate)
        _note_impact(impacts[n_impacts], t, -side * speed, -side * r * speed, side, 0.0)
        n_impacts += 1
        q, v = 0.0, r * speed
        side = -side
        if changes:
            c = both[1 if side > 0.0 else 0]
            terms.setup(vector, side, n_peaks, release_side, c)
            if n_peaks == 1:
                terms.hold_on(vector, held, t, 0.0, -1.0, c)
        if vector[par.DWELL] > 0.0:
            n = _fill_flat(pieces, n, t, 0.0, 0.0, side)
            t += vector[par.DWELL]
        if vector[par.BOUNCE] > 0.0 and v > 0.0:
            n, t, q = _bounce(vector, r, speed, v, side, t, pieces, n, impacts[n_impacts - 1 : n_impacts + 1])
            n_impacts += 1
