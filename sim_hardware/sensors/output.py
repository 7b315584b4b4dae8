"""From the true quantity to the electrical value: response, faults, noise, range."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.jit import kernel, part
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.families import fill_quantity
from sim_hardware.sensors.noise import deviate, share

_NO_TABLES: Final = np.zeros((0, 2, 2))


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
def _respond(
    row: NDArray[np.float64],
    instants: NDArray[np.float64],
    table: NDArray[np.float64],
    first: int,
    out: NDArray[np.float64],
) -> None:
    """Replace the true quantity by the sensor's response, or take the low-passed part away from it."""
    high_pass = row[la.RW_FILTER] == la.HIGH_PASS
    for k in range(out.size):
        value = filtered(table, first, instants[k] - row[la.RW_DELAY])
        out[k] = out[k] - value if high_pass else value


@part
def _distort(row: NDArray[np.float64], instants: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Faults that few sensors have: sag and misalignment of a wire, drift, hum."""
    sag, quadratic, hum = row[la.RW_SAG], row[la.RW_QUADRATIC], row[la.RW_HUM]
    dx, dy = row[la.RW_X] - row[la.RW_ANCHOR], row[la.RW_Y] - row[la.RW_ANCHOR + 1]
    dz = row[la.RW_Z] - row[la.RW_ANCHOR + 2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    for k in range(out.size):
        value = out[k]
        if sag != 0.0:
            value += sag * (length**3 - (length - value) ** 3)
        value += quadratic * value * value + row[la.RW_DRIFT] * instants[k]
        if hum != 0.0:
            value += hum * math.sin(row[la.RW_HUM_W] * instants[k] + row[la.RW_HUM_PHASE])
        out[k] = value


@part
def _seen_at(row: NDArray[np.float64], key: np.uint64, t: float) -> float:
    """Instant of the wall that a sample at `t` shows: clock error, stuck sensor, drop-outs."""
    t = min(t * row[la.RW_CLOCK], row[la.RW_STUCK])
    if row[la.RW_DROP_SHARE] > 0.0:
        k = np.int64(math.floor(t / row[la.RW_DROP_S] + 1e-9))
        if share(key ^ np.uint64(0x5851F42D4C957F2D), k) < row[la.RW_DROP_SHARE]:
            t = k * row[la.RW_DROP_S]
    return float(t)


@part
def _finish(
    row: NDArray[np.float64],
    key: np.uint64,
    instants: NDArray[np.float64],
    noisy: bool,
    out: NDArray[np.float64],
) -> None:
    """Gain, zero, noise, steps, range of the sensor, and its electrical scale."""
    gain, offset, noise = row[la.RW_GAIN], row[la.RW_OFFSET], row[la.RW_NOISE]
    low, high, quantum = row[la.RW_LOW], row[la.RW_HIGH], row[la.RW_QUANTUM]
    slope, zero = row[la.RW_SLOPE], row[la.RW_ZERO]
    if noisy:
        for k in range(out.size):
            out[k] = out[k] * gain + offset + noise * deviate(key, instants[k])
    else:
        for k in range(out.size):
            out[k] = out[k] * gain + offset
    if quantum > 0.0:
        for k in range(out.size):
            out[k] = math.floor(out[k] / quantum + 0.5) * quantum
    for k in range(out.size):
        out[k] = min(max(out[k], low), high) * slope + zero


@kernel
def fill_instants(
    row: NDArray[np.float64], key: np.uint64, times: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """(n,) instants that a sensor's samples show, before delay."""
    for k in range(times.size):
        out[k] = _seen_at(row, key, times[k])


@kernel
def fill_electrical(
    rows: NDArray[np.float64],
    keys: NDArray[np.uint64],
    instants: NDArray[np.float64],
    seen: NDArray[np.float64],
    states: NDArray[np.float64],
    events: NDArray[np.float64],
    height: float,
    tables: NDArray[np.float64],
    table_first: int,
    noisy: bool,
    out: NDArray[np.float64],
) -> None:
    """(rows, n) electrical values.

    `instants` (n,) hold for all rows; `states` belong to `seen` = instants − delay, so rows of one
    call share the delay.  `tables` (k, m, 2) holds the dynamic responses.
    """
    for i in range(rows.shape[0]):
        row, line, table = rows[i], out[i], int(rows[i, la.RW_TABLE])
        if table < 0 or row[la.RW_FILTER] == la.HIGH_PASS:
            fill_quantity(row, seen, events, height, states, line)
        if table >= 0:
            _respond(row, instants, tables[table], table_first, line)
        curved = row[la.RW_SAG] != 0.0 or row[la.RW_QUADRATIC] != 0.0
        if curved or row[la.RW_DRIFT] != 0.0 or row[la.RW_HUM] != 0.0:
            _distort(row, instants, line)
        _finish(row, keys[i], instants, noisy, line)


def fill_ideal(
    rows: NDArray[np.float64],
    times: NDArray[np.float64],
    states: NDArray[np.float64],
    events: NDArray[np.float64],
    height: float,
    out: NDArray[np.float64],
) -> None:
    """(rows, n) true quantities, SI, of the states at ascending `times`.

    They are what sensors without response, faults and scale give: a kernel of their own would compile every
    family of sensors a second time.
    """
    plain = rows.copy()
    plain[
        :, [la.RW_SAG, la.RW_QUADRATIC, la.RW_DRIFT, la.RW_HUM, la.RW_QUANTUM, la.RW_OFFSET, la.RW_ZERO]
    ] = 0.0
    plain[:, [la.RW_GAIN, la.RW_SLOPE]] = 1.0
    plain[:, la.RW_LOW], plain[:, la.RW_HIGH], plain[:, la.RW_TABLE] = -np.inf, np.inf, -1.0
    keys = np.zeros(len(rows), dtype=np.uint64)
    fill_electrical(plain, keys, times, times, states, events, height, _NO_TABLES, 0, False, out)
