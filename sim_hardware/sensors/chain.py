"""The sensor chain: a scene at the wall in, electrical values at the terminals out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig
from sim_hardware.sensors import layout as la
from sim_hardware.sensors.effects import Wiring, apply_sensor_effects
from sim_hardware.sensors.filters import FilterBank
from sim_hardware.sensors.noise import key_of
from sim_hardware.sensors.output import fill_electrical, fill_ideal, fill_instants
from sim_hardware.sensors.rows import blank_row, channel_index, number_tables, sensor_rows, special_rows
from sim_hardware.sensors.scene import Scene
from sim_hardware.sensors.state import fill_states

_NO_TABLES: Final = np.zeros((0, 2, 2))
_NO_EFFECTS: Final[Mapping[str, Mapping[str, float]]] = {}


class SensorChain:
    """All sensors of a rig, with their offsets, noise and faults from a seed.

    The value at a terminal is a function of the scene and of time: whatever pieces it is asked for
    in, the same samples are the same numbers.
    """

    def __init__(self, rig: Rig, seed: int, effects: Mapping[str, Mapping[str, float]] = _NO_EFFECTS) -> None:
        """`effects`: ``name@target`` → parameters; `ValueError` in words for one that is unknown."""
        self.rig = rig
        self.seed = seed
        wiring = Wiring(sensor_rows(rig, seed), np.arange(len(rig.channels)))
        apply_sensor_effects(wiring, rig.channels, effects, seed)
        self._filters = FilterBank(number_tables(wiring.rows))
        self._rows = wiring.rows
        self._sensor_at = wiring.sensor_at
        self._keys = np.array([key_of(seed, channel.id) for channel in rig.channels], dtype=np.uint64)
        self._place = channel_index(rig.channels)
        self._selections: dict[
            tuple[str, ...], tuple[NDArray[np.float64], NDArray[np.uint64], list[int]]
        ] = {}

    def forget_from(self, time_s: float) -> None:
        """The scene has changed from `time_s` on."""
        self._filters.forget_from(time_s)

    def states(self, scene: Scene, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N_STATE, n) of the wall (sim_hardware.sensors.layout)."""
        times = np.ascontiguousarray(times_s, dtype=np.float64)
        states = np.empty((la.N_STATE, times.size))
        fill_states(times, scene.pieces, scene.events, scene.epochs, states)
        return states

    def quantities(self, scene: Scene, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(channels, n) true quantities in SI, rig order: no response, no fault, no noise."""
        times = np.ascontiguousarray(times_s, dtype=np.float64)
        out = np.empty((len(self._rows), times.size))
        fill_ideal(self._rows, times, self.states(scene, times), scene.events, scene.height_m, out)
        return out

    def volts(
        self, scene: Scene, terminals: Sequence[str], times_s: NDArray[np.float64], *, noisy: bool = True
    ) -> NDArray[np.float64]:
        """(terminals, n) electrical values at ascending `times_s` (s since power-on).

        Volts; for native LVDTs volts per volt of excitation.  A terminal that the rig does not use
        floats near 0 V.
        """
        times = np.ascontiguousarray(times_s, dtype=np.float64)
        rows, keys, special = self._select(tuple(terminals))
        out = np.empty((len(rows), times.size))
        if not times.size:
            return out
        plain = np.ones(len(rows), dtype=np.bool_)
        plain[special] = False
        if plain.all():
            self._fill(scene, rows, keys, times, times, noisy, out)
            return out
        if plain.any():
            part = np.empty((int(plain.sum()), times.size))
            self._fill(scene, rows[plain], keys[plain], times, times, noisy, part)
            out[plain] = part
        for i in special:
            instants = np.empty(times.size)
            fill_instants(rows[i], keys[i], times, instants)
            seen = instants - rows[i, la.RW_DELAY]
            part = out[i : i + 1]
            self._fill(scene, rows[i : i + 1], keys[i : i + 1], instants, seen, noisy, part)
        return out

    def _fill(
        self,
        scene: Scene,
        rows: NDArray[np.float64],
        keys: NDArray[np.uint64],
        instants: NDArray[np.float64],
        seen: NDArray[np.float64],
        noisy: bool,
        out: NDArray[np.float64],
    ) -> None:
        tables, first = _NO_TABLES, 0
        if np.any(rows[:, la.RW_TABLE] >= 0.0):
            tables, first = self._filters.tables(scene, float(seen.min()), float(seen.max()))
        states, height = self.states(scene, seen), scene.height_m
        fill_electrical(rows, keys, instants, seen, states, scene.events, height, tables, first, noisy, out)

    def _select(
        self, terminals: tuple[str, ...]
    ) -> tuple[NDArray[np.float64], NDArray[np.uint64], list[int]]:
        """Rows and noise keys of the sensors behind `terminals`, and which rows are special."""
        known = self._selections.get(terminals)
        if known is None:
            rows = np.empty((len(terminals), la.N_ROW))
            keys = np.empty(len(terminals), dtype=np.uint64)
            for i, terminal in enumerate(terminals):
                place = self._place.get(terminal)
                if place is None:
                    rows[i], keys[i] = blank_row(), key_of(self.seed, terminal)
                else:
                    sensor = self._sensor_at[place]
                    rows[i], keys[i] = self._rows[sensor], self._keys[sensor]
            known = (rows, keys, [int(i) for i in np.flatnonzero(special_rows(rows))])
            self._selections[terminals] = known
        return known
