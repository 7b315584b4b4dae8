"""The scan list of a task: converters and instants of its channels, and readings of their codes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.channels.analog_input import AnalogInput
from sim_hardware.daqmx_server.timing.sampling import Input


class Scan:
    """Settled when a task is verified: channels do not change while it runs."""

    def __init__(self, channels: Sequence[AnalogInput], time_offsets_s: Sequence[float]) -> None:
        self._channels = tuple(channels)
        converters = [channel.converter for channel in channels]
        self.inputs = tuple(
            Input(channel.physical, converter, offset, channel.hold_s, channel.limits_electrical)
            for channel, converter, offset in zip(channels, converters, time_offsets_s, strict=True)
        )
        units = np.array([channel.unit_per_electrical for channel in channels])
        self._gain = np.array([converter.step for converter in converters]) * units
        self._zero = np.array([converter.middle for converter in converters]) * units
        self._watched = frozenset(row for row, c in enumerate(channels) if c.overload_detection)
        self._scaled = {row: c.scale for row, c in enumerate(channels) if c.scale is not None}

    def readings(self, codes: NDArray[np.int32], rows: Sequence[int] | None = None) -> NDArray[np.float64]:
        """Codes (channels × samples) in the channels' units."""
        gain, zero = self._gain, self._zero
        if rows is not None:
            gain, zero = gain[list(rows)], zero[list(rows)]
        values: NDArray[np.float64] = codes * gain[:, None]
        values += zero[:, None]
        if self._scaled:
            for place, row in enumerate(range(len(self._channels)) if rows is None else rows):
                if row in self._scaled:
                    values[place] = self._scaled[row].forward(values[place])
        return values

    def overloaded(self, codes: NDArray[np.int32], rows: Sequence[int] | None = None) -> list[str]:
        """Names of the channels that reached a rail, among those whose module detects that."""
        if not self._watched or not codes.shape[1]:
            return []
        out = []
        for place, row in enumerate(range(len(self._channels)) if rows is None else rows):
            if row in self._watched:
                low, high = self.inputs[row].converter.code_limits
                if codes[place].min() <= low or codes[place].max() >= high:
                    out.append(self._channels[row].name)
        return out
