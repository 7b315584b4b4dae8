"""The true quantity at each sensor, from the states of the wall: one function per family.

Each fills one sensor's row of the output; `row` is the sensor (layout RW_…), `states` (N_STATE, n)
belong to the ascending instants `times`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import G_M_S2
from sim_hardware.jit import part
from sim_hardware.sensors import layout as la


@part
def fill_opening(row: NDArray[np.float64], states: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Vertical opening of the joint at (x, y), m: u_z − x sin θ; (b/2 − x) sin θ for a sharp edge."""
    x, y = row[la.RW_X], row[la.RW_Y]
    for k in range(out.size):
        value = states[la.ST_UZ, k] - x * states[la.ST_SIN, k]
        out[k] = value + states[la.ST_TWIST, k] * y * (states[la.ST_PIVOT, k] - x)


@part
def fill_shortening(
    row: NDArray[np.float64], height: float, states: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """|A − P₀| − |A − P| of a wire from its anchor to the wall point, m."""
    x, y, z = row[la.RW_X], row[la.RW_Y], row[la.RW_Z]
    dx, dy, dz = x - row[la.RW_ANCHOR], y - row[la.RW_ANCHOR + 1], z - row[la.RW_ANCHOR + 2]
    before = dx * dx + dy * dy + dz * dz
    length = math.sqrt(before)
    bend = (z / height) ** 2
    for k in range(out.size):
        sin, versed = states[la.ST_SIN_TOTAL, k], 1.0 - states[la.ST_COS_TOTAL, k]
        moved_x = z * sin - x * versed + states[la.ST_UX, k] + bend * states[la.ST_MODE, k]
        moved_x += states[la.ST_TWIST, k] * y * z - states[la.ST_YAW, k] * y
        moved_y = states[la.ST_YAW, k] * x
        moved_z = states[la.ST_UZ, k] - z * versed - x * sin
        change = moved_x * (2.0 * dx + moved_x) + moved_y * (2.0 * dy + moved_y)
        change += moved_z * (2.0 * dz + moved_z)
        # the difference of two roots without cancellation
        out[k] = -change / (length + math.sqrt(before + change))


@part
def fill_displacement(
    row: NDArray[np.float64], height: float, states: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Displacement of the wall point (x, y, z) along the laser's axis, seen from the ground, m."""
    x, y, z, axis = row[la.RW_X], row[la.RW_Y], row[la.RW_Z], row[la.RW_AXIS]
    bend = (z / height) ** 2
    for k in range(out.size):
        sin, versed = states[la.ST_SIN_TOTAL, k], 1.0 - states[la.ST_COS_TOTAL, k]
        if axis == la.AXIS_X:
            value = z * sin - x * versed + states[la.ST_UX, k] + bend * states[la.ST_MODE, k]
            out[k] = value + states[la.ST_TWIST, k] * y * z - states[la.ST_YAW, k] * y
        elif axis == la.AXIS_Y:
            out[k] = states[la.ST_YAW, k] * x
        else:
            out[k] = states[la.ST_UZ, k] - z * versed - x * sin


@part
def fill_inclination(row: NDArray[np.float64], states: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Rotation at a tiltmeter before its slow response, rad; along y only its misalignment shows."""
    share = 1.0 if row[la.RW_AXIS] == la.AXIS_X else row[la.RW_CROSS]
    for k in range(out.size):
        out[k] = share * (states[la.ST_TOTAL, k] + states[la.ST_TWIST, k] * row[la.RW_Y])


@part
def fill_specific_force(
    row: NDArray[np.float64],
    times: NDArray[np.float64],
    events: NDArray[np.float64],
    height: float,
    states: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Acceleration less gravity along the wall-fixed axis, value upright at rest removed, m/s²."""
    x, y, z = row[la.RW_X], row[la.RW_Y], row[la.RW_Z]
    axis = row[la.RW_AXIS]
    bend = (z / height) ** 2
    for k in range(out.size):
        arm = x - states[la.ST_PIVOT, k]
        omega2, alpha = states[la.ST_OMEGA, k] ** 2, states[la.ST_ALPHA, k]
        sin, cos = states[la.ST_SIN_TOTAL, k], states[la.ST_COS_TOTAL, k]
        if axis == la.AXIS_X:
            value = alpha * z - omega2 * arm - G_M_S2 * sin + bend * states[la.ST_MODE_ACC, k]
            value += states[la.ST_TWIST_ACC, k] * y * z - states[la.ST_YAW_ACC, k] * y
            out[k] = value + states[la.ST_GROUND, k] * cos
        elif axis == la.AXIS_Z:
            value = -alpha * arm - omega2 * z + G_M_S2 * (cos - 1.0)
            out[k] = value + states[la.ST_GROUND, k] * sin
        else:
            out[k] = states[la.ST_YAW_ACC, k] * x
    _add_transients(row, times, events, out)


@part
def first_at(times: NDArray[np.float64], start: float) -> int:
    """First index whose time is not before `start`; NumPy's search takes a third of a second to compile."""
    low, high = int(np.int64(0)), times.size
    while low < high:
        middle = (low + high) // 2
        if times[middle] < start:
            low = middle + 1
        else:
            high = middle
    return low


@part
def _add_transients(
    row: NDArray[np.float64],
    times: NDArray[np.float64],
    events: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Velocity jumps of impacts spread over the contact, and the ringing that follows, m/s²."""
    axis, n = row[la.RW_AXIS], times.size
    if n == 0:
        return
    a1, w1, d1 = row[la.RW_RING], row[la.RW_RING + 1], row[la.RW_RING + 2]
    a2, w2, d2 = row[la.RW_RING + 3], row[la.RW_RING + 4], row[la.RW_RING + 5]
    reach = 0.0
    if axis == la.AXIS_X:
        reach = row[la.RW_Z]
    elif axis == la.AXIS_Z:
        reach = -row[la.RW_X]
    for i in range(events.shape[0]):
        start = events[i, la.EV_TIME]
        if start + la.RING_S < times[0]:
            continue
        if start > times[n - 1]:
            break
        loud = events[i, la.EV_INTENSITY]
        jump = 0.0
        if events[i, la.EV_SIDE] != 0.0:
            jump = (events[i, la.EV_AFTER] - events[i, la.EV_BEFORE]) * reach / la.PULSE_S
        k = first_at(times, start)
        while k < n and times[k] - start < la.RING_S:
            dt = times[k] - start
            ring = a1 * math.exp(-dt * d1) * math.sin(w1 * dt) + a2 * math.exp(-dt * d2) * math.sin(w2 * dt)
            out[k] += loud * ring
            if jump != 0.0 and dt < la.PULSE_S:
                out[k] += jump * (1.0 - math.cos(2.0 * math.pi * dt / la.PULSE_S))
            k += 1


@part
def fill_quantity(
    row: NDArray[np.float64],
    times: NDArray[np.float64],
    events: NDArray[np.float64],
    height: float,
    states: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """The true quantity, SI, before the sensor's own dynamics and faults."""
    family = row[la.RW_FAMILY]
    if family == la.LVDT:
        fill_opening(row, states, out)
    elif family == la.WIRE:
        fill_shortening(row, height, states, out)
    elif family == la.ACCELEROMETER:
        fill_specific_force(row, times, events, height, states, out)
    elif family == la.TILTMETER:
        fill_inclination(row, states, out)
    elif family == la.LASER:
        fill_displacement(row, height, states, out)
    else:
        out[:] = 0.0
