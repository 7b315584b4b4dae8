"""Triggers on analogue signals: what counts as a crossing, and the search for the first one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from nidaqmx.constants import (
    ActiveLevel,
    Edge,
    Slope,
    TriggerType,
    WindowTriggerCondition1,
    WindowTriggerCondition2,
)
from numpy.typing import NDArray

Readings = Callable[[int, int], NDArray[np.float64]]
"""Readings of the trigger's channel for samples start … stop−1."""
Which = Literal["START", "REF", "ARM_START"]

NONE: Final[int] = TriggerType.NONE.value
DIGITAL: Final[int] = TriggerType.DIGITAL_EDGE.value
ANALOG: Final[int] = TriggerType.ANALOG_EDGE.value
WINDOW: Final[int] = TriggerType.ANALOG_WINDOW.value
LEVEL: Final[int] = TriggerType.DIGITAL_LEVEL.value
ANALOG_LEVEL: Final[int] = TriggerType.ANALOG_LEVEL.value
TIME: Final[int] = TriggerType.TIME.value


@dataclass(frozen=True, slots=True)
class Condition:
    """An analogue trigger as a band: fires on entering [low, high] after [low_off, high_off] was left."""

    low: float
    high: float
    low_off: float
    high_off: float
    leaving: bool = False
    """Fires on leaving the band instead."""

    @classmethod
    def of(cls, settings: Mapping[str, Any], which: Which) -> Condition:
        """From a task's trigger attributes; hysteresis re-arms an edge only beyond level ∓ hysteresis."""
        if settings[f"{which}_TRIG_TYPE"] == WINDOW:
            low, high = settings[f"ANLG_WIN_{which}_TRIG_BTM"], settings[f"ANLG_WIN_{which}_TRIG_TOP"]
            when = settings[f"ANLG_WIN_{which}_TRIG_WHEN"]
            return cls(low, high, low, high, when == WindowTriggerCondition1.LEAVING_WINDOW.value)
        level = settings[f"ANLG_EDGE_{which}_TRIG_LVL"]
        hysteresis = settings.get(f"ANLG_EDGE_{which}_TRIG_HYST", 0.0)
        if settings[f"ANLG_EDGE_{which}_TRIG_SLOPE"] == Slope.FALLING.value:
            return cls(-np.inf, level, -np.inf, level + hysteresis)
        return cls(level, np.inf, level - hysteresis, np.inf)

    def fires(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where an armed trigger fires."""
        inside = (values >= self.low) & (values <= self.high)
        return ~inside if self.leaving else inside

    def arms(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the signal is on the near side, so that the next crossing counts."""
        inside = (values >= self.low_off) & (values <= self.high_off)
        return inside if self.leaving else ~inside


class Hold:
    """An analogue pause trigger: holds the clock from where it comes on to where it goes off."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        """From a task's trigger attributes."""
        self._settings = settings
        self._held = False

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which samples are held, for values that follow those of the call before."""
        on, off = self._window(values) if self._settings["PAUSE_TRIG_TYPE"] == WINDOW else self._level(values)
        turns = np.concatenate(([1 if self._held else -1], np.where(on, 1, np.where(off, -1, 0))))
        last_turn = np.maximum.accumulate(np.where(turns != 0, np.arange(len(turns)), 0))
        held: NDArray[np.bool_] = (turns[last_turn] > 0)[1:]
        if len(held):
            self._held = bool(held[-1])
        return held

    def _level(self, values: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Hysteresis lets the clock go only beyond level ∓ hysteresis."""
        level = float(self._settings.get("ANLG_LVL_PAUSE_TRIG_LVL", 0.0))
        hysteresis = float(self._settings.get("ANLG_LVL_PAUSE_TRIG_HYST", 0.0))
        when = self._settings.get("ANLG_LVL_PAUSE_TRIG_WHEN", ActiveLevel.ABOVE.value)
        if when == ActiveLevel.BELOW.value:
            return values < level, values >= level + hysteresis
        return values > level, values <= level - hysteresis

    def _window(self, values: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        low = float(self._settings.get("ANLG_WIN_PAUSE_TRIG_BTM", 0.0))
        high = float(self._settings.get("ANLG_WIN_PAUSE_TRIG_TOP", 0.0))
        inside = (values >= low) & (values <= high)
        when = self._settings.get("ANLG_WIN_PAUSE_TRIG_WHEN", WindowTriggerCondition2.INSIDE_WINDOW.value)
        return (inside, ~inside) if when == WindowTriggerCondition2.INSIDE_WINDOW.value else (~inside, inside)


class CrossingSearch:
    """Looks for the first crossing, continuing where it stopped, armed or not."""

    _PIECE = 4096

    def __init__(self, condition: Condition, first_sample: int) -> None:
        self._condition = condition
        self._next = first_sample
        self._armed = False

    def find(self, readings: Readings, stop: int) -> int | None:
        """Index of the first sample at or past the crossing, among those before `stop`."""
        while self._next < stop:
            end = min(stop, self._next + self._PIECE)
            values = readings(self._next, end)
            ready = self._condition.arms(values)
            armed = np.logical_or.accumulate(np.concatenate(([self._armed], ready)))[:-1]
            hits = np.flatnonzero(self._condition.fires(values) & armed)
            if len(hits):
                return self._next + int(hits[0])
            self._armed = bool(self._armed or ready.any())
            self._next = end
        return None


def waits_for_edge(settings: Mapping[str, Any], which: Which) -> bool:
    """Whether a trigger listens to a terminal: a digital one, or an analogue one at an ``APFI`` terminal."""
    kind = settings.get(f"{which}_TRIG_TYPE", NONE)
    outer = "apfi" in source_of(settings, which).lower() if kind in (ANALOG, WINDOW) else False
    return outer or kind == DIGITAL


def is_rising(settings: Mapping[str, Any], which: Which) -> bool:
    """Which edge of a trigger at a terminal counts."""
    if settings.get(f"{which}_TRIG_TYPE") == ANALOG:
        return bool(settings.get(f"ANLG_EDGE_{which}_TRIG_SLOPE") != Slope.FALLING.value)
    return bool(settings.get(f"DIG_EDGE_{which}_TRIG_EDGE", Edge.RISING.value) == Edge.RISING.value)


def holds_by_analog(settings: Mapping[str, Any]) -> bool:
    """Whether an analogue signal holds the sample clock."""
    return settings.get("PAUSE_TRIG_TYPE", NONE) in (ANALOG_LEVEL, WINDOW)


def digital_start(settings: Mapping[str, Any]) -> Which | None:
    """Which edge at a terminal a task waits for: the start trigger's, or a counter's arm start trigger's."""
    if waits_for_edge(settings, "START"):
        return "START"
    return "ARM_START" if settings.get("ARM_START_TRIG_TYPE") == DIGITAL else None


def source_of(settings: Mapping[str, Any], which: str) -> str:
    """Channel or terminal that the configured trigger listens to."""
    prefixes = {DIGITAL: "DIG_EDGE", ANALOG: "ANLG_EDGE", WINDOW: "ANLG_WIN", ANALOG_LEVEL: "ANLG_LVL"}
    prefix = prefixes[settings[f"{which}_TRIG_TYPE"]]
    return str(settings.get(f"{prefix}_{which}_TRIG_SRC", ""))
