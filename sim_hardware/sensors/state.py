"""What the wall does at each instant: rotation, displacement of its base, oscillators, floor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim_hardware.dynamics import pieces as pc
from sim_hardware.jit import kernel, part
from sim_hardware.sensors import layout as la


@part
def last_at(table: NDArray[np.float64], t: float, hint: int) -> int:
    """Last row whose first column is ≤ t, or −1; fast when `hint` is near and below."""
    n = table.shape[0]
    i = hint
    if i < 0 or i >= n or table[i, 0] > t:
        low, high = -1, i if 0 <= i < n else n
        while high - low > 1:
            middle = (low + high) // 2
            if table[middle, 0] <= t:
                low = middle
            else:
                high = middle
        return low
    while i + 1 < n and table[i + 1, 0] <= t:
        i += 1
    return i


@part
def sine_cosine(x: float) -> tuple[float, float]:
    """(sin x, cos x) to machine precision; by series at the small angles of a rocking wall."""
    if abs(x) > 0.35:
        return math.sin(x), math.cos(x)
    y = x * x
    s = 1.0 / 6227020800.0 * y - 1.0 / 39916800.0
    s = ((((s * y + 1.0 / 362880.0) * y - 1.0 / 5040.0) * y + 1.0 / 120.0) * y - 1.0 / 6.0) * y
    c = 1.0 / 479001600.0 - 1.0 / 87178291200.0 * y
    c = ((((c * y - 1.0 / 3628800.0) * y + 1.0 / 40320.0) * y - 1.0 / 720.0) * y + 1.0 / 24.0) * y
    c = (c - 0.5) * y
    return x + x * s, 1.0 + c


@part
def oscillator(value: float, rate: float, w: float, zeta: float, dt: float) -> tuple[float, float]:
    """(value, rate) of a free damped oscillator `dt` later."""
    if w <= 0.0 or (value == 0.0 and rate == 0.0):
        return 0.0, 0.0
    decay = zeta * w
    if decay * dt > 40.0:
        return 0.0, 0.0
    wd = w * math.sqrt(1.0 - zeta * zeta)
    sine = (rate + decay * value) / wd
    e = math.exp(-decay * dt)
    c, s = math.cos(wd * dt), math.sin(wd * dt)
    y = e * (value * c + sine * s)
    return y, e * wd * (sine * c - value * s) - decay * y


@part
def base_displacement(
    theta: float, sin: float, cos: float, epochs: NDArray[np.float64], e: int
) -> tuple[float, float, float]:
    """(u_x, u_z, x of the pivot) of the middle of the base for a joint rotation.

    Sharp edge: rotation about (s u, 0).  Rounded edge: rolling on a circle of radius ρ.  Compliant
    joint: rotation about the neutral axis, against the joint compressed by the wall's own weight.
    """
    side, u = (1.0, epochs[e, la.EP_RIGHT]) if theta >= 0.0 else (-1.0, epochs[e, la.EP_LEFT])
    q, up, versed = abs(theta), abs(sin), 1.0 - cos
    theta_c, rho = epochs[e, la.EP_WINKLER], epochs[e, la.EP_EDGE]
    if theta_c > 0.0:
        if q <= theta_c:
            return 0.0, 0.0, 0.0
        root = math.sqrt(theta_c / q)
        axis = u * (1.0 - 2.0 * root)
        return side * axis * versed, axis * up + theta_c * u, side * u * (1.0 - root)
    if rho > 0.0:
        centre = u - rho
        rolled = centre * versed + rho * (q - up)
        return side * rolled, centre * up + rho * versed, side * (centre + rho * up)
    return side * u * versed, u * up, side * u


@part
def _oscillate(
    t: float,
    epochs: NDArray[np.float64],
    e: int,
    events: NDArray[np.float64],
    i: int,
    states: NDArray[np.float64],
    k: int,
) -> None:
    dt = t - events[i, la.EV_TIME]
    w, zeta = epochs[e, la.EP_MODE_W], epochs[e, la.EP_MODE_ZETA]
    if w > 0.0:
        y, rate = oscillator(events[i, la.EV_MODE], events[i, la.EV_MODE + 1], w, zeta, dt)
        states[la.ST_MODE, k] = y
        states[la.ST_MODE_ACC, k] = -2.0 * zeta * w * rate - w * w * y
    w, zeta = epochs[e, la.EP_TWIST_W], epochs[e, la.EP_TWIST_ZETA]
    if w > 0.0:
        y, rate = oscillator(events[i, la.EV_TWIST], events[i, la.EV_TWIST + 1], w, zeta, dt)
        states[la.ST_TWIST, k] += y
        states[la.ST_TWIST_ACC, k] += -2.0 * zeta * w * rate - w * w * y
        y, rate = oscillator(events[i, la.EV_YAW], events[i, la.EV_YAW + 1], w, zeta, dt)
        states[la.ST_YAW, k] = y
        states[la.ST_YAW_ACC, k] = -2.0 * zeta * w * rate - w * w * y


@part
def _joint(t: float, pieces: NDArray[np.float64], i: int, states: NDArray[np.float64], k: int) -> float:
    """Rotation, velocity and acceleration of the joint from piece `i`; returns the rotation."""
    scale = pieces[i, pc.SCALE]
    x = (t - pieces[i, pc.START]) / scale
    theta, omega, slope = pieces[i, pc.ROTATION + 7], pieces[i, pc.VELOCITY + 7], 0.0
    for m in range(6, -1, -1):
        theta = theta * x + pieces[i, pc.ROTATION + m]
        slope = slope * x + omega
        omega = omega * x + pieces[i, pc.VELOCITY + m]
    states[la.ST_OMEGA, k], states[la.ST_ALPHA, k] = omega, slope / scale
    return float(theta)


@kernel
def fill_states(
    times: NDArray[np.float64],
    pieces: NDArray[np.float64],
    events: NDArray[np.float64],
    epochs: NDArray[np.float64],
    states: NDArray[np.float64],
) -> None:
    """(N_STATE, n) states at `times`; events and epochs must have at least one row."""
    piece, event, e = (
        int(np.int64(-1)),
        int(np.int64(-1)),
        int(np.int64(-1)),
    )  # literals would compile parts twice
    states[:, :] = 0.0
    for k in range(times.size):
        t = times[k]
        piece = pc.find_piece(pieces, t, piece)
        event = last_at(events, t, event)
        e = max(last_at(epochs, t, e), 0)
        theta, sin, cos = 0.0, 0.0, 1.0
        if piece >= 0:
            theta = _joint(t, pieces, piece, states, k)
        if theta != 0.0:
            sin, cos = sine_cosine(theta)
            ux, uz, pivot = base_displacement(theta, sin, cos, epochs, e)
            states[la.ST_UX, k], states[la.ST_UZ, k], states[la.ST_PIVOT, k] = ux, uz, pivot
            states[la.ST_TWIST, k] = epochs[e, la.EP_TWIST_FOLLOW] * theta
            states[la.ST_TWIST_ACC, k] = epochs[e, la.EP_TWIST_FOLLOW] * states[la.ST_ALPHA, k]
        states[la.ST_SIN, k], states[la.ST_TOTAL, k] = sin, theta
        if theta != 0.0 and epochs[e, la.EP_COMPLIANCE] > 0.0:
            # the moment changes sign at upright; the base follows over a tenth of a milliradian
            alpha = epochs[e, la.EP_ALPHA]
            moment = math.sin(alpha - abs(theta)) / math.sin(alpha) * math.tanh(theta / 1e-4)
            states[la.ST_TOTAL, k] = theta + epochs[e, la.EP_COMPLIANCE] * moment
            sin, cos = sine_cosine(states[la.ST_TOTAL, k])
        states[la.ST_SIN_TOTAL, k], states[la.ST_COS_TOTAL, k] = sin, cos
        if event >= 0:
            _oscillate(t, epochs, e, events, event, states, k)
            states[la.ST_UX, k] += events[event, la.EV_SLID]
            states[la.ST_YAW, k] += events[event, la.EV_TURNED]
        if epochs[e, la.EP_AMBIENT] != 0.0:
            phase = epochs[e, la.EP_AMBIENT_W] * t + epochs[e, la.EP_AMBIENT_PHASE]
            states[la.ST_GROUND, k] = epochs[e, la.EP_AMBIENT] * math.sin(phase)


@kernel
def march(events: NDArray[np.float64], epochs: NDArray[np.float64]) -> None:
    """Fill the oscillators' states, and the slip and turn so far, of the events, in order of time."""
    e = int(np.int64(-1))
    for i in range(events.shape[0]):
        e = max(last_at(epochs, events[i, la.EV_TIME], e), 0)
        mode = twist = yaw = mode_rate = twist_rate = yaw_rate = slid = turned = 0.0
        if i > 0:
            old = events[i - 1]
            dt = events[i, la.EV_TIME] - old[la.EV_TIME]
            w, z = epochs[e, la.EP_MODE_W], epochs[e, la.EP_MODE_ZETA]
            mode, mode_rate = oscillator(old[la.EV_MODE], old[la.EV_MODE + 1], w, z, dt)
            w, z = epochs[e, la.EP_TWIST_W], epochs[e, la.EP_TWIST_ZETA]
            twist, twist_rate = oscillator(old[la.EV_TWIST], old[la.EV_TWIST + 1], w, z, dt)
            yaw, yaw_rate = oscillator(old[la.EV_YAW], old[la.EV_YAW + 1], w, z, dt)
            slid, turned = old[la.EV_SLID], old[la.EV_TURNED]
        row = events[i]
        jump = row[la.EV_JUMP]
        row[la.EV_MODE] = mode
        row[la.EV_MODE + 1] = mode_rate + epochs[e, la.EP_MODE_GAIN] * epochs[e, la.EP_MODE_W] * jump
        row[la.EV_TWIST], row[la.EV_TWIST + 1] = twist, twist_rate + epochs[e, la.EP_TWIST_KICK] * jump
        row[la.EV_YAW], row[la.EV_YAW + 1] = yaw, yaw_rate + epochs[e, la.EP_YAW_KICK] * jump
        row[la.EV_SLID] = slid + row[la.EV_SLIP]
        row[la.EV_TURNED] = turned + row[la.EV_TURN]
