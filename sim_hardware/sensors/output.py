"""From the true quantity to the electrical value: response, faults, noise, range."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim_hardware.jit import kernel, part
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.families import quantity
from sim_hardware.sensors.noise import deviate, share


@part
def filtered(table: NDArray[np.float64], first: int, t: float) -> float:
    """Value at `t` of a response known with its slope on the grid, by Hermite's cubic."""
    position = t / la.FILTER_DT_S - first
    k = min(max(math.floor(position), 0), table.shape[0] - 2)
    x = min(max(position - k, 0.0), 1.0)
    y0, y1 = table[k, 0], table[k + 1, 0]
    m0, m1 = table[k, 1] * la.FILTER_DT_S, table[k + 1, 1] * la.FILTER_DT_S
    d = y1 - y0
    return float(y0 + x * (m0 + x * (3.0 * d - 2.0 * m0 - m1 + x * (m0 + m1 - 2.0 * d))))


@part
def distorted(row: NDArray[np.float64], value: float, t: float) -> float:
    """Static faults: sag and misalignment of a wire, gain, offset, drift, hum."""
    if row[la.RW_SAG] != 0.0:
        dx, dy = row[la.RW_X] - row[la.RW_ANCHOR], row[la.RW_Y] - row[la.RW_ANCHOR + 1]
        dz = row[la.RW_Z] - row[la.RW_ANCHOR + 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        value += row[la.RW_SAG] * (length**3 - (length - value) ** 3)
    value = value * (row[la.RW_GAIN] + row[la.RW_QUADRATIC] * value)
    value += row[la.RW_OFFSET] + row[la.RW_DRIFT] * t
    if row[la.RW_HUM] != 0.0:
        value += row[la.RW_HUM] * math.sin(row[la.RW_HUM_W] * t + row[la.RW_HUM_PHASE])
    return float(value)


@part
def seen_at(row: NDArray[np.float64], key: np.uint64, t: float) -> float:
    """Instant of the wall that a sample at `t` shows: clock error, drop-outs, delay."""
    t = t * row[la.RW_CLOCK]
    if t > row[la.RW_STUCK]:
        t = row[la.RW_STUCK]
    if row[la.RW_DROP_SHARE] > 0.0:
        k = np.int64(math.floor(t / row[la.RW_DROP_S]))
        if share(key ^ np.uint64(0x5851F42D4C957F2D), k) < row[la.RW_DROP_SHARE]:
            t = k * row[la.RW_DROP_S]
    return float(t)


@kernel
def fill_ideal(
    rows: NDArray[np.float64],
    times: NDArray[np.float64],
    states: NDArray[np.float64],
    events: NDArray[np.float64],
    height: float,
    out: NDArray[np.float64],
) -> None:
    """(rows, n) true quantities, SI, of states at `times`."""
    for i in range(rows.shape[0]):
        row = rows[i]
        for k in range(times.size):
            out[i, k] = quantity(row, events, height, times[k], states[k])


@kernel
def fill_instants(
    row: NDArray[np.float64], key: np.uint64, times: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """(n,) instants that a sensor's samples show, before delay."""
    for k in range(times.size):
        out[k] = seen_at(row, key, times[k])


@kernel
def fill_electrical(
    rows: NDArray[np.float64],
    keys: NDArray[np.uint64],
    instants: NDArray[np.float64],
    states: NDArray[np.float64],
    events: NDArray[np.float64],
    height: float,
    tables: NDArray[np.float64],
    table_first: int,
    noisy: bool,
    out: NDArray[np.float64],
) -> None:
    """(rows, n) electrical values.

    `instants` (n,) hold for all rows; `states` belong to ``instants − delay``, so rows of one call
    share the delay.  `tables` (k, m, 2) holds the dynamic responses.
    """
    for i in range(rows.shape[0]):
        row, key = rows[i], keys[i]
        response, table = row[la.RW_FILTER], int(row[la.RW_TABLE])
        slope, zero, noise = row[la.RW_SLOPE], row[la.RW_ZERO], row[la.RW_NOISE] if noisy else 0.0
        low, high, quantum, delay = row[la.RW_LOW], row[la.RW_HIGH], row[la.RW_QUANTUM], row[la.RW_DELAY]
        for k in range(instants.size):
            t = instants[k]
            seen = t - delay
            value = 0.0
            if response == la.NO_FILTER or response == la.HIGH_PASS:
                value = quantity(row, events, height, seen, states[k])
                if response == la.HIGH_PASS:
                    value -= filtered(tables[table], table_first, seen)
            else:
                value = filtered(tables[table], table_first, seen)
            value = distorted(row, value, t)
            if noise > 0.0:
                value += noise * deviate(key, t)
            if quantum > 0.0:
                value = math.floor(value / quantum + 0.5) * quantum
            out[i, k] = min(max(value, low), high) * slope + zero
