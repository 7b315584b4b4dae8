"""What devices put out, and where it is seen again: analogue outputs and digital lines over time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
_KEPT: Final = 4096
"""Changes that a terminal remembers: late readers see the past as it was."""


@dataclass(frozen=True, slots=True)
class Player:
    """A generation at one terminal."""

    values: Callable[[Values], Values]
    """Values put out at instants; NaN before the output has begun."""
    steps: Callable[[float, float], Values]
    """Instants, after one and up to another, at which the value may change."""


class Loopback:
    """Levels of output terminals: held values, and the generations that run at present."""

    def __init__(self) -> None:
        self._held: dict[str, tuple[list[float], list[float]]] = {}
        self._players: dict[str, Player] = {}

    def hold(self, terminal: str, time_s: float, value: float) -> None:
        """The terminal has this value from now on."""
        times, values = self._held.setdefault(terminal, ([], []))
        times.append(time_s)
        values.append(value)
        if len(times) > _KEPT:
            del times[0], values[0]

    def play(self, terminal: str, player: Player) -> None:
        """A generation drives the terminal until `stop`."""
        self._players[terminal] = player

    def stop(self, terminal: str, time_s: float) -> None:
        """The generation ends; the terminal keeps its last value."""
        player = self._players.pop(terminal, None)
        if player is not None:
            steps = player.steps(-np.inf, time_s)[-_KEPT:]
            for instant, value in zip(steps, player.values(steps), strict=True):
                self.hold(terminal, float(instant), float(value))
            last = float(player.values(np.array([time_s]))[0])
            if not np.isnan(last):
                self.hold(terminal, time_s, last)

    def changes(self, terminal: str, after_s: float, until_s: float) -> list[tuple[float, bool]]:
        """Changes of a line after one instant and up to another: instant, and whether it rises."""
        held = [t for t in self._held.get(terminal, ([], []))[0] if after_s < t <= until_s]
        player = self._players.get(terminal)
        steps = held if player is None else [*held, *player.steps(after_s, until_s)]
        instants = np.array(sorted({after_s, *map(float, steps)}))
        levels = self.at(terminal, instants) > 0.5
        turned = np.flatnonzero(levels[1:] != levels[:-1]) + 1
        return [(float(instants[place]), bool(levels[place])) for place in turned]

    def at(self, terminal: str, times_s: Values) -> Values:
        """Values at instants; 0 before anything was put out."""
        times, values = self._held.get(terminal, ([], []))
        known = np.array([0.0, *values])
        out = known[np.array([bisect_right(times, float(t)) for t in times_s], dtype=np.intp)]
        player = self._players.get(terminal)
        if player is not None:
            played = player.values(times_s)
            out = np.where(np.isnan(played), out, played)
        return np.asarray(out)

    def now(self, terminal: str, time_s: float) -> float:
        return float(self.at(terminal, np.array([time_s]))[0])


class WiredBench:
    """A signal source that also shows a device's own outputs at its internal channels.

    Devices that are not simulated see 0 V where nothing is wired; simulated ones are left open (NaN).
    """

    def __init__(self, source: _Volts, loopback: Loopback, is_real: Callable[[str], bool]) -> None:
        self._source = source
        self._loopback = loopback
        self._is_real = is_real

    def volts(self, terminals: tuple[str, ...], times_s: Values) -> Values:
        """(len(terminals), len(times_s)), as `SignalSource.volts`."""
        internal = [row for row, terminal in enumerate(terminals) if "/_" in terminal]
        if not internal:
            ideal = self._source(terminals, times_s)
        else:
            ideal = np.full((len(terminals), len(times_s)), np.nan)
            outside = [row for row in range(len(terminals)) if row not in internal]
            if outside:
                ideal[outside] = self._source(tuple(terminals[row] for row in outside), times_s)
        for row, terminal in enumerate(terminals):
            device, _, rest = terminal.partition("/")
            if len(times_s) and np.isnan(ideal[row, 0]) and self._is_real(device):
                output = f"{device}/{rest.split('_')[1]}" if rest.startswith("_ao") else ""
                ideal[row] = self._loopback.at(output, times_s) if output else 0.0
        return ideal


_Volts = Callable[[tuple[str, ...], Values], Values]
