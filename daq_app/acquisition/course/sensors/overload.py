"""Channels that can follow no further: at the rails of their input, or at the end of their travel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from daq_app.config.families import AUXILIARY
from daq_app.config.rig import Channel
from daq_app.config.scaling import Scaling
from drivers import Block

_RAIL_SHARE = 0.9995
"""A reading beyond this share of the input range is at the rail: some modules report no overload."""


_TRAVEL_SHARE = 0.001
"""Within this share of its travel from either end a sensor stands at its stop: 0.1 mm of 100 mm. Assumed."""
_BEYOND_SHARE = 0.01
"""A reading further than this share of the travel beyond its end comes from the line, not from the sensor."""
TRAVELLING = ("lvdt", "wire", "tiltmeter", *(name for name, family in AUXILIARY.items() if family.travels))
"""Families with a mechanical or stated end of travel."""


def travel_in_readings(channels: Sequence[Channel]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n_channels,) lowest and highest reading within the travel; infinite where there is no end.

    Ends are those of `range_si`, seen from the certificate's zero: a tare does not move a sensor's stop.
    """
    span = np.array([channel.range_si for channel in channels])
    inset = _TRAVEL_SHARE * (span[:, 1] - span[:, 0])
    inner = np.stack((span[:, 0] + inset, span[:, 1] - inset), axis=1)
    readings = Scaling.of(channels).to_readings(inner)
    ends = np.array([channel.family in TRAVELLING for channel in channels])
    low = np.where(ends, readings.min(axis=1), -np.inf)
    high = np.where(ends, readings.max(axis=1), np.inf)
    return low, high


class OverloadWatch:
    """Remembers which channels can follow no further, so that each is told once."""

    def __init__(self, channels: Sequence[Channel], ranges: dict[str, tuple[float, float]]) -> None:
        self._channels = tuple(channels)
        self._ids = tuple(channel.id for channel in channels)
        low = np.array([ranges[name][0] for name in self._ids])
        high = np.array([ranges[name][1] for name in self._ids])
        margin = 0.5 * (1.0 - _RAIL_SHARE) * (high - low)
        self._low, self._high = low + margin, high - margin
        self._travel_low, self._travel_high = travel_in_readings(channels)
        beyond = _BEYOND_SHARE * (self._travel_high - self._travel_low)
        self._lowest, self._highest = self._travel_low - beyond, self._travel_high + beyond
        self._now: frozenset[str] = frozenset()
        self._news: tuple[str, ...] = ()
        self.at_end: frozenset[str] = frozenset()
        """Channels at the end of their travel in the last block."""

    def check(self, block: Block) -> tuple[str, ...]:
        """Ids of the channels that can follow no further in `block`, rig order."""
        largest, smallest = block.readings.max(axis=1), block.readings.min(axis=1)
        railed = (largest >= self._high) | (smallest <= self._low)
        at_high = (largest >= self._travel_high) & (largest <= self._highest)
        ended = at_high | (smallest <= self._travel_low) & (smallest >= self._lowest)
        reported = set(block.overloaded)
        flags = zip(self._ids, railed | ended, strict=True)
        overloaded = tuple(name for name, flag in flags if flag or name in reported)
        self.at_end = frozenset(name for name, end in zip(self._ids, ended, strict=True) if end)
        self._news = tuple(name for name in overloaded if name not in self._now)
        self._now = frozenset(overloaded)
        return overloaded

    def forget(self) -> None:
        """Tell everything again that is still so."""
        self._now = frozenset()

    def news(self) -> list[tuple[str, str]]:
        """(kind, sentence) on channels that were within their range in the block before."""
        ended = [
            channel for channel in self._channels if channel.id in self._news and channel.id in self.at_end
        ]
        railed = ", ".join(name for name in self._news if name not in self.at_end)
        told = []
        if ended:
            names = ", ".join(_with_end(channel) for channel in ended)
            advice = "What lies beyond is not measured; set the sensors back or use longer ones"
            told.append(("travel", f"End of travel: {names}. {advice}"))
        if railed:
            text = f"Overloaded: {railed}. Check range, excitation and plug; the readings there are cut off"
            told.append(("overload", text))
        return told


def _with_end(channel: Channel) -> str:
    """A channel with its travel, in the units of a bench."""
    low, high = channel.range_si
    if channel.family == "tiltmeter":
        return f"{channel.id} ({1e3 * low:g} to {1e3 * high:g} mrad)"
    return f"{channel.id} ({1e3 * low:g} to {1e3 * high:g} mm)"
