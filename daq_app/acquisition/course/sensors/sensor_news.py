"""What is wrong with sensors while they are sampled: rails, ends of travel, doubtful channels."""

from __future__ import annotations

import math
from collections.abc import Callable

from daq_app.acquisition.course.sensors.channel_watch import ChannelWatch
from daq_app.acquisition.course.sensors.overload import OverloadWatch
from daq_app.config.rig import Rig
from drivers import Block, Opened

Note = Callable[[str, str, str, int | None, dict[str, float | str] | None], None]
"""Tells (kind, text, severity, sample, data)."""


class SensorNews:
    """Feed it every block; each trouble is told once, and again after `forget`; its end as well."""

    def __init__(self, rig: Rig, opened: Opened, note: Note) -> None:
        self.overloaded: tuple[str, ...] = ()
        """Channels that can follow no further in the last block."""
        self.told_sample = -math.inf
        """Sample of the last block in which something new was wrong with a sensor."""
        self._note = note
        self._overload = OverloadWatch(rig.channels, opened.ranges, opened.rate_hz)
        self._channels = ChannelWatch(rig, opened.rate_hz, opened.ranges)

    def look(self, block: Block, *, moving: bool) -> None:
        """Tell what is new in a block. `moving`: impacts ring and leap; only what is no motion is told."""
        self.overloaded = self._overload.check(block)
        for news in self._overload.news():
            if news.severity != "info":
                self.told_sample = block.first_sample
            self._note(news.kind, news.text, news.severity, None, None)
        for doubt in self._channels.check(block, moving=moving, at_end=self._overload.at_end):
            self.told_sample = block.first_sample
            data: dict[str, float | str] = {"channel": doubt.channel_id, "doubt": doubt.name}
            self._note("channel", doubt.text, "warning", doubt.sample, data)

    def forget(self) -> None:
        """Tell everything again that is still so: a new run must say it as well."""
        self._overload.forget()
        self._channels.forget()
