"""Channels that can follow no further: at the rails of their input, or at the end of their travel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.families import AUXILIARY
from daq_app.config.rig import Channel
from daq_app.config.scaling import Scaling
from daq_app.config.wording import signed
from drivers import Block

_RAIL_SHARE = 0.9995
"""A reading beyond this share of the input range is at the rail: some modules report no overload."""


_TRAVEL_SHARE = 0.001
"""Within this share of its travel from either end a sensor stands at its stop: 0.1 mm of 100 mm. Assumed."""
_BEYOND_SHARE = 0.01
"""A reading further than this share of the travel beyond its end comes from the line, not from the sensor."""
_OVER_S: Final = 2.0
"""A channel that has followed for so long follows again, s: longer than a half-cycle of a rocking wall."""
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


@dataclass(frozen=True, slots=True)
class RangeNews:
    """What is told of channels that follow no further, or follow again."""

    kind: str
    """travel or overload"""
    severity: str
    """warning, and info at its end"""
    text: str


class OverloadWatch:
    """Remembers which channels can follow no further, so that each is told once, and when that is over."""

    def __init__(
        self, channels: Sequence[Channel], ranges: dict[str, tuple[float, float]], rate_hz: float
    ) -> None:
        self._by_id = {channel.id: channel for channel in channels}
        self._ids = tuple(channel.id for channel in channels)
        low = np.array([ranges[name][0] for name in self._ids])
        high = np.array([ranges[name][1] for name in self._ids])
        margin = 0.5 * (1.0 - _RAIL_SHARE) * (high - low)
        self._low, self._high = low + margin, high - margin
        self._travel_low, self._travel_high = travel_in_readings(channels)
        beyond = _BEYOND_SHARE * (self._travel_high - self._travel_low)
        self._lowest, self._highest = self._travel_low - beyond, self._travel_high + beyond
        self._over_samples = _OVER_S * rate_hz
        self._last_out: dict[str, dict[str, int]] = {"travel": {}, "overload": {}}
        """By kind: the channels that were told, and the sample up to which each could not follow."""
        self._untold: set[str] = set()
        """Channels that a new run has not told yet."""
        self._news: list[RangeNews] = []
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
        now = {
            "travel": [name for name in overloaded if name in self.at_end],
            "overload": [name for name in overloaded if name not in self.at_end],
        }
        self._news = [news for kind, names in now.items() for news in self._changes(kind, names, block)]
        self._untold -= set(overloaded)
        return overloaded

    def _changes(self, kind: str, names: Sequence[str], block: Block) -> Iterator[RangeNews]:
        """Who follows no further since this block, and that all follow again."""
        last_out = self._last_out[kind]
        end = block.first_sample + block.n_samples
        new = [name for name in names if name not in last_out or name in self._untold]
        last_out.update(dict.fromkeys(names, end))
        if new:
            yield RangeNews(kind, "warning", _warning(kind, [self._by_id[name] for name in new]))
        if last_out and end - max(last_out.values()) >= self._over_samples:
            back = ", ".join(name for name in self._ids if name in last_out)
            yield RangeNews(kind, "info", _END[kind].format(names=back))
            last_out.clear()

    def forget(self) -> None:
        """Tell everything again that is still so."""
        self._untold = {name for names in self._last_out.values() for name in names}

    def news(self) -> list[RangeNews]:
        """What is new with the last block."""
        return self._news


_END: Final = {
    "travel": "Within their travel again: {names}",
    "overload": "Within their input range again: {names}",
}


def _warning(kind: str, channels: Sequence[Channel]) -> str:
    if kind == "travel":
        by_travel: dict[str, list[str]] = {}
        for channel in channels:
            by_travel.setdefault(_travel(channel), []).append(channel.id)
        names = "; ".join(f"{', '.join(ids)} ({travel})" for travel, ids in by_travel.items())
        advice = "What lies beyond is not measured; set the sensors back or use longer ones"
        return f"End of travel: {names}. {advice}"
    railed = ", ".join(channel.id for channel in channels)
    return f"Overloaded: {railed}. Check range, excitation and plug; the readings there are cut off"


def _travel(channel: Channel) -> str:
    """From where to where a channel can follow, in the units of a bench."""
    low, high = (signed(1e3 * end) for end in channel.range_si)
    return f"{low} to {high} {'mrad' if channel.family == 'tiltmeter' else 'mm'}"
