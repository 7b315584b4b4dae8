"""Channels at the rails, as the hardware reports them and as the readings show."""

from __future__ import annotations

import numpy as np

from drivers import Block

_RAIL_SHARE = 0.9995
"""A reading beyond this share of the input range is at the rail: some modules report no overload."""


class OverloadWatch:
    """Remembers which channels are overloaded now, so that each is told once."""

    def __init__(self, channel_ids: tuple[str, ...], ranges: dict[str, tuple[float, float]]) -> None:
        self._ids = channel_ids
        low = np.array([ranges[name][0] for name in channel_ids])
        high = np.array([ranges[name][1] for name in channel_ids])
        margin = 0.5 * (1.0 - _RAIL_SHARE) * (high - low)
        self._low, self._high = low + margin, high - margin
        self._now: frozenset[str] = frozenset()
        self._news: tuple[str, ...] = ()

    def check(self, block: Block) -> tuple[str, ...]:
        """Ids of the channels overloaded in `block`, rig order."""
        railed = (block.readings.max(axis=1) >= self._high) | (block.readings.min(axis=1) <= self._low)
        reported = set(block.overloaded)
        found = tuple(name for name, rail in zip(self._ids, railed, strict=True) if rail or name in reported)
        self._news = tuple(name for name in found if name not in self._now)
        self._now = frozenset(found)
        return found

    def forget(self) -> None:
        """Tell everything again that is still so."""
        self._now = frozenset()

    def news(self) -> str:
        """A sentence on channels that were not overloaded in the block before; empty for none."""
        if not self._news:
            return ""
        channels = ", ".join(self._news)
        return f"Overloaded: {channels}. Check range, excitation and plug; the readings there are cut off"
