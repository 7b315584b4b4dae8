"""Dynamic responses of sensors, integrated once on a fixed grid and looked up.

Grid points are ``k · FILTER_DT_S`` since power-on, so the result does not depend on who asks for
what.  Tables are made in chunks of one second from a state kept at each chunk's start; the state at
power-on is the response in equilibrium.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.jit import kernel
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.output import fill_ideal
from sim_hardware.sensors.scene import Scene
from sim_hardware.sensors.state import fill_states

_CHUNK: Final = 4000
_KEPT: Final = 24


@kernel
def _respond(
    kind: int,
    a: float,
    b: float,
    u: NDArray[np.float64],
    state: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Response to `u` (n + 1 grid values, straight between them): values and slopes (n + 1, 2).

    First order with time constant `a`, or second order with natural frequency `a` and damping `b`;
    `state` (2) is the start and becomes the end.
    """
    dt = la.FILTER_DT_S
    y, v = state[0], state[1]
    n = u.size - 1
    if kind != la.RESONANCE:
        decay = math.exp(-dt / a)
        for k in range(n):
            out[k, 0], out[k, 1] = y, (u[k] - y) / a
            slope = (u[k + 1] - u[k]) / dt
            # y follows u − a·slope exactly under a ramp
            y = u[k + 1] - a * slope + (y - u[k] + a * slope) * decay
        out[n, 0], out[n, 1] = y, (u[n] - y) / a
    else:
        wd = a * math.sqrt(max(1.0 - b * b, 1e-12))
        e, c, s = math.exp(-b * a * dt), math.cos(wd * dt), math.sin(wd * dt)
        for k in range(n):
            out[k, 0], out[k, 1] = y, v
            slope = (u[k + 1] - u[k]) / dt
            lag = 2.0 * b / a * slope
            p, q = y - (u[k] - lag), v - slope
            sine = (q + b * a * p) / wd
            y = u[k + 1] - lag + e * (p * c + sine * s)
            v = slope + e * (wd * (sine * c - p * s) - b * a * (p * c + sine * s))
        out[n, 0], out[n, 1] = y, v
    state[0], state[1] = y, v


class FilterBank:
    """Responses of the rows that have dynamics; row i of the tables belongs to ``rows[i]``."""

    def __init__(self, rows: NDArray[np.float64]) -> None:
        self._rows = rows
        self._states: list[NDArray[np.float64]] = []
        self._tables: OrderedDict[int, NDArray[np.float64]] = OrderedDict()

    def forget_from(self, time_s: float) -> None:
        """The scene changes from `time_s` on: what was integrated beyond it is void."""
        keep = max(math.floor(time_s / (_CHUNK * la.FILTER_DT_S) + 1e-9), 0)
        del self._states[keep + 1 :]
        for chunk in [c for c in self._tables if c >= keep]:
            del self._tables[chunk]

    def tables(self, scene: Scene, first_s: float, last_s: float) -> tuple[NDArray[np.float64], int]:
        """(rows, m, 2) values and slopes covering the span, and the grid index of their first column."""
        if not len(self._rows):
            return np.zeros((0, 2, 2)), 0
        span = _CHUNK * la.FILTER_DT_S
        low = max(int(first_s // span), 0)
        high = max(int(last_s // span), low)
        parts = [self._table(scene, chunk) for chunk in range(low, high + 1)]
        if len(parts) == 1:
            return parts[0], low * _CHUNK
        joined = np.concatenate([part[:, :-1] for part in parts[:-1]] + [parts[-1]], axis=1)
        return joined, low * _CHUNK

    def _table(self, scene: Scene, chunk: int) -> NDArray[np.float64]:
        if chunk in self._tables:
            self._tables.move_to_end(chunk)
            return self._tables[chunk]
        for missing in range(len(self._states) - 1 if self._states else 0, chunk):
            self._make(scene, missing)
        table = self._make(scene, chunk)
        self._tables[chunk] = table
        if len(self._tables) > _KEPT:
            self._tables.popitem(last=False)
        return table

    def _make(self, scene: Scene, chunk: int) -> NDArray[np.float64]:
        times: NDArray[np.float64] = (chunk * _CHUNK + np.arange(_CHUNK + 1.0)) * la.FILTER_DT_S
        states = np.empty((la.N_STATE, times.size))
        fill_states(times, scene.pieces, scene.events, scene.epochs, states)
        inputs = np.empty((len(self._rows), times.size))
        fill_ideal(self._rows, times, states, scene.events, scene.height_m, inputs)
        if not self._states:
            self._states.append(np.stack([inputs[:, 0], np.zeros(len(inputs))], axis=1))
        state = self._states[chunk].copy()
        out = np.empty((len(self._rows), times.size, 2))
        for i, row in enumerate(self._rows):
            kind, a, b = int(row[la.RW_FILTER]), row[la.RW_FILTER_A], row[la.RW_FILTER_B]
            _respond(kind, a, b, inputs[i], state[i], out[i])
        if len(self._states) == chunk + 1:
            self._states.append(state)
        return out
