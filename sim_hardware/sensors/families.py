"""The true quantity at each sensor, from the state of the wall: one function per family."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import G_M_S2
from sim_hardware.jit import part
from sim_hardware.sensors import layout as la


@part
def opening(row: NDArray[np.float64], s: NDArray[np.float64]) -> float:
    """Vertical opening of the joint at (x, y), m: u_z − x sin θ; (b/2 − x) sin θ for a sharp edge."""
    value = s[la.ST_UZ] - row[la.RW_X] * s[la.ST_SIN]
    return float(value + s[la.ST_TWIST] * row[la.RW_Y] * (s[la.ST_PIVOT] - row[la.RW_X]))


@part
def shortening(row: NDArray[np.float64], height: float, s: NDArray[np.float64]) -> float:
    """|A − P₀| − |A − P| of a wire from its anchor to the wall point, m."""
    x, y, z = row[la.RW_X], row[la.RW_Y], row[la.RW_Z]
    sin, cos = s[la.ST_SIN_TOTAL], s[la.ST_COS_TOTAL]
    dx0, dy0, dz0 = x - row[la.RW_ANCHOR], y - row[la.RW_ANCHOR + 1], z - row[la.RW_ANCHOR + 2]
    moved_x = x * (cos - 1.0) + z * sin + s[la.ST_UX] + s[la.ST_TWIST] * y * z - s[la.ST_YAW] * y
    moved_x += s[la.ST_MODE] * (z / height) ** 2
    moved_z = z * (cos - 1.0) - x * sin + s[la.ST_UZ]
    moved_y = s[la.ST_YAW] * x
    before = dx0 * dx0 + dy0 * dy0 + dz0 * dz0
    change = moved_x * (2.0 * dx0 + moved_x) + moved_y * (2.0 * dy0 + moved_y)
    change += moved_z * (2.0 * dz0 + moved_z)
    # the difference of two roots without cancellation
    return float(-change / (math.sqrt(before) + math.sqrt(before + change)))


@part
def _transients(row: NDArray[np.float64], events: NDArray[np.float64], t: float, last: int) -> float:
    """Velocity jumps of impacts spread over the contact, and the ringing that follows, m/s²."""
    total = 0.0
    axis = row[la.RW_AXIS]
    i = last
    while i >= 0:
        e = events[i]
        dt = t - e[la.EV_TIME]
        if dt > la.RING_S:
            break
        if dt < la.PULSE_S and e[la.EV_SIDE] != 0.0:
            jump = 0.0
            if axis == la.AXIS_X:
                jump = (e[la.EV_AFTER] - e[la.EV_BEFORE]) * row[la.RW_Z]
            elif axis == la.AXIS_Z:
                jump = -(e[la.EV_AFTER] - e[la.EV_BEFORE]) * row[la.RW_X]
            total += jump / la.PULSE_S * (1.0 - math.cos(2.0 * math.pi * dt / la.PULSE_S))
        for m in range(la.RW_RING, la.RW_RING + 6, 3):
            total += e[la.EV_INTENSITY] * row[m] * math.exp(-dt * row[m + 2]) * math.sin(row[m + 1] * dt)
        i -= 1
    return total


@part
def specific_force(
    row: NDArray[np.float64], events: NDArray[np.float64], height: float, t: float, s: NDArray[np.float64]
) -> float:
    """Acceleration less gravity along the wall-fixed axis, value upright at rest removed, m/s²."""
    x, y, z = row[la.RW_X], row[la.RW_Y], row[la.RW_Z]
    arm = x - s[la.ST_PIVOT]
    omega, alpha = s[la.ST_OMEGA], s[la.ST_ALPHA]
    bend = (z / height) ** 2 * s[la.ST_MODE_ACC]
    axis = row[la.RW_AXIS]
    value = 0.0
    if axis == la.AXIS_X:
        value = alpha * z - omega * omega * arm - G_M_S2 * s[la.ST_SIN_TOTAL] + bend
        value += s[la.ST_TWIST_ACC] * y * z - s[la.ST_YAW_ACC] * y + s[la.ST_GROUND] * s[la.ST_COS_TOTAL]
    elif axis == la.AXIS_Z:
        value = -alpha * arm - omega * omega * z + G_M_S2 * (s[la.ST_COS_TOTAL] - 1.0)
        value += s[la.ST_GROUND] * s[la.ST_SIN_TOTAL]
    else:
        value = s[la.ST_YAW_ACC] * x
    if s[la.ST_EVENT] >= 0.0:
        value += _transients(row, events, t, int(s[la.ST_EVENT]))
    return float(value)


@part
def inclination(row: NDArray[np.float64], s: NDArray[np.float64]) -> float:
    """Rotation at a tiltmeter before its slow response, rad; along y only its misalignment shows."""
    value = s[la.ST_TOTAL] + s[la.ST_TWIST] * row[la.RW_Y]
    if row[la.RW_AXIS] != la.AXIS_X:
        value *= row[la.RW_CROSS]
    return float(value)


@part
def quantity(
    row: NDArray[np.float64], events: NDArray[np.float64], height: float, t: float, s: NDArray[np.float64]
) -> float:
    """The true quantity, SI, before the sensor's own dynamics and faults."""
    family = row[la.RW_FAMILY]
    if family == la.LVDT:
        return opening(row, s)
    if family == la.WIRE:
        return shortening(row, height, s)
    if family == la.ACCELEROMETER:
        return specific_force(row, events, height, t, s)
    if family == la.TILTMETER:
        return inclination(row, s)
    return 0.0
