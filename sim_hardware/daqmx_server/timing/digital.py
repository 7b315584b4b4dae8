"""Samples of digital input channels: one word of 64 bits per sample, bit i for line i of the channel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.loopback import Loopback
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes


class DigitalSampler:
    """Simulated devices count the samples in binary on each 8 lines; real ones see their lines."""

    def __init__(
        self,
        channels: Sequence[VirtualChannel],
        times: SampleTimes,
        loopback: Loopback,
        first: int = 0,
    ) -> None:
        """`first` is the number of the first sample in the count of a simulated device."""
        self._channels = tuple(channels)
        self._times = times
        self._loopback = loopback
        self._first = first

    def codes(self, start: int, stop: int) -> NDArray[np.uint64]:
        """Words of samples start … stop−1, shape (channels, samples)."""
        index = np.arange(start, stop)
        out = np.zeros((len(self._channels), len(index)), dtype=np.uint64)
        for row, channel in enumerate(self._channels):
            inverted = bool(channel.attributes.get("DI_INVERT_LINES", False))
            for bit, line in enumerate(channel.lines):
                level = self._level(channel, line, index) ^ inverted
                out[row] |= level.astype(np.uint64) << np.uint64(bit)
        return out

    def _level(self, channel: VirtualChannel, line: str, index: NDArray[np.int64]) -> NDArray[np.bool_]:
        if channel.device.simulated:
            number = int(line.rpartition("line")[2])
            return ((index + self._first) >> (number % 8) & 1).astype(bool)
        return self._loopback.at(line, self._times.at(index)) > 0.5
