"""What the wall does at an instant: rotation, displacement of its base, oscillators, floor."""

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
def base_displacement(theta: float, epoch: NDArray[np.float64]) -> tuple[float, float, float]:
    """(u_x, u_z, x of the pivot) of the middle of the base for a joint rotation.

    Sharp edge: rotation about (s u, 0).  Rounded edge: rolling on a circle of radius ρ.  Compliant
    joint: rotation about the neutral axis, against the joint compressed by the wall's own weight.
    """
    side = 1.0 if theta >= 0.0 else -1.0
    u = epoch[la.EP_RIGHT] if theta >= 0.0 else epoch[la.EP_LEFT]
    q = abs(theta)
    sin, versed = math.sin(q), 1.0 - math.cos(q)
    if epoch[la.EP_WINKLER] > 0.0:
        theta_c = epoch[la.EP_WINKLER]
        if q <= theta_c:
            return 0.0, 0.0, 0.0
        axis = u * (1.0 - 2.0 * math.sqrt(theta_c / q))
        return side * axis * versed, axis * sin + theta_c * u, side * u * (1.0 - math.sqrt(theta_c / q))
    rho = epoch[la.EP_EDGE]
    centre = u - rho
    return (
        side * (centre * versed + rho * (q - sin)),
        centre * sin + rho * versed,
        side * (centre + rho * sin),
    )


@part
def _oscillators(
    t: float, epoch: NDArray[np.float64], event: NDArray[np.float64], s: NDArray[np.float64]
) -> None:
    dt = t - event[la.EV_TIME]
    w, zeta = epoch[la.EP_MODE_W], epoch[la.EP_MODE_ZETA]
    if w > 0.0:
        y, rate = oscillator(event[la.EV_MODE], event[la.EV_MODE + 1], w, zeta, dt)
        s[la.ST_MODE] = y
        s[la.ST_MODE_ACC] = -2.0 * zeta * w * rate - w * w * y
    w, zeta = epoch[la.EP_TWIST_W], epoch[la.EP_TWIST_ZETA]
    if w > 0.0:
        y, rate = oscillator(event[la.EV_TWIST], event[la.EV_TWIST + 1], w, zeta, dt)
        s[la.ST_TWIST] += y
        s[la.ST_TWIST_ACC] += -2.0 * zeta * w * rate - w * w * y
        y, rate = oscillator(event[la.EV_YAW], event[la.EV_YAW + 1], w, zeta, dt)
        s[la.ST_YAW] = y
        s[la.ST_YAW_ACC] = -2.0 * zeta * w * rate - w * w * y


@kernel
def fill_states(
    times: NDArray[np.float64],
    pieces: NDArray[np.float64],
    events: NDArray[np.float64],
    epochs: NDArray[np.float64],
    states: NDArray[np.float64],
) -> None:
    """(n, N_STATE) states at `times`; events and epochs must have at least one row."""
    piece, event, epoch_row = -1, -1, -1
    for k in range(times.size):
        t = times[k]
        s = states[k]
        s[:] = 0.0
        piece = pc.find_piece(pieces, t, piece)
        event = last_at(events, t, event)
        epoch_row = last_at(epochs, t, epoch_row)
        epoch = epochs[max(epoch_row, 0)]
        theta = 0.0
        if piece >= 0:
            row = pieces[piece]
            x = (t - row[pc.START]) / row[pc.SCALE]
            theta = pc.horner(row, pc.ROTATION, x)
            s[la.ST_OMEGA] = pc.horner(row, pc.VELOCITY, x)
            s[la.ST_ALPHA] = pc.horner_slope(row, pc.VELOCITY, x) / row[pc.SCALE]
            s[la.ST_SIDE] = row[pc.SIDE]
        s[la.ST_THETA], s[la.ST_TOTAL], s[la.ST_EVENT] = theta, theta, event
        if theta != 0.0:
            s[la.ST_UX], s[la.ST_UZ], s[la.ST_PIVOT] = base_displacement(theta, epoch)
            s[la.ST_TWIST] = epoch[la.EP_TWIST_FOLLOW] * theta
            s[la.ST_TWIST_ACC] = epoch[la.EP_TWIST_FOLLOW] * s[la.ST_ALPHA]
            if epoch[la.EP_COMPLIANCE] > 0.0:
                # the moment changes sign at upright; the base follows over a tenth of a milliradian
                moment = math.sin(epoch[la.EP_ALPHA] - abs(theta)) / math.sin(epoch[la.EP_ALPHA])
                s[la.ST_TOTAL] += epoch[la.EP_COMPLIANCE] * moment * math.tanh(theta / 1e-4)
        if event >= 0:
            _oscillators(t, epoch, events[event], s)
            s[la.ST_UX] += events[event, la.EV_SLID]
        s[la.ST_SIN] = math.sin(theta)
        s[la.ST_SIN_TOTAL], s[la.ST_COS_TOTAL] = s[la.ST_SIN], math.cos(theta)
        if s[la.ST_TOTAL] != theta:
            s[la.ST_SIN_TOTAL], s[la.ST_COS_TOTAL] = math.sin(s[la.ST_TOTAL]), math.cos(s[la.ST_TOTAL])
        if epoch[la.EP_AMBIENT] != 0.0:
            s[la.ST_GROUND] = epoch[la.EP_AMBIENT] * math.sin(
                epoch[la.EP_AMBIENT_W] * t + epoch[la.EP_AMBIENT_PHASE]
            )


@kernel
def march(events: NDArray[np.float64], epochs: NDArray[np.float64], first: int) -> None:
    """Fill the oscillators' states and the slip so far of the events from `first` on, in order of time."""
    epoch_row = -1
    for i in range(first, events.shape[0]):
        row = events[i]
        epoch_row = last_at(epochs, row[la.EV_TIME], epoch_row)
        epoch = epochs[max(epoch_row, 0)]
        mode = twist = yaw = mode_rate = twist_rate = yaw_rate = slid = 0.0
        if i > 0:
            old = events[i - 1]
            dt = row[la.EV_TIME] - old[la.EV_TIME]
            w, z = epoch[la.EP_MODE_W], epoch[la.EP_MODE_ZETA]
            mode, mode_rate = oscillator(old[la.EV_MODE], old[la.EV_MODE + 1], w, z, dt)
            w, z = epoch[la.EP_TWIST_W], epoch[la.EP_TWIST_ZETA]
            twist, twist_rate = oscillator(old[la.EV_TWIST], old[la.EV_TWIST + 1], w, z, dt)
            yaw, yaw_rate = oscillator(old[la.EV_YAW], old[la.EV_YAW + 1], w, z, dt)
            slid = old[la.EV_SLID]
        jump = row[la.EV_JUMP]
        row[la.EV_MODE] = mode
        row[la.EV_MODE + 1] = mode_rate + epoch[la.EP_MODE_GAIN] * epoch[la.EP_MODE_W] * jump
        row[la.EV_TWIST], row[la.EV_TWIST + 1] = twist, twist_rate + epoch[la.EP_TWIST_KICK] * jump
        row[la.EV_YAW], row[la.EV_YAW + 1] = yaw, yaw_rate + epoch[la.EP_YAW_KICK] * jump
        row[la.EV_SLID] = slid + row[la.EV_SLIP]
