"""What a task puts out: the samples that the client has written, and how far they have gone."""

from __future__ import annotations

from typing import Any

import numpy as np
from nidaqmx.constants import RegenerationMode
from numpy.typing import NDArray

from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes

Samples = NDArray[np.float64]


class Generation:
    """Samples written, shape (channels, samples): analogue values, digital words, or pulse periods."""

    def __init__(self, settings: dict[str, Any]) -> None:
        self._settings = settings
        self._samples: Samples = np.empty((0, 0))
        self.pulses: Samples = np.empty((2, 0))
        """Low and high times of pulses that a counter output makes in turn, s, shape (2, pulses)."""
        self.written = 0
        """Samples per channel written so far."""
        self.written_before_start = 0
        """Samples per channel that had been written when the task was last started."""

    @property
    def regenerates(self) -> bool:
        """Whether the buffer is put out again and again."""
        mode = self._settings.get("REGEN_MODE", RegenerationMode.ALLOW_REGENERATION.value)
        return bool(mode == RegenerationMode.ALLOW_REGENERATION.value)

    @property
    def samples(self) -> Samples:
        return self._samples

    def write(self, samples: Samples, buffer: int | None) -> int:
        """Append samples, or begin anew where a regenerated buffer is full; their number."""
        count = int(samples.shape[1])
        full = buffer is not None and self._samples.shape[1] + count > buffer
        if self._samples.shape[0] != samples.shape[0] or (self.regenerates and full):
            self._samples = samples.copy()
        else:
            self._samples = np.concatenate((self._samples, samples), axis=1)
        self.written += count
        return count

    def at(self, row: int, times: SampleTimes, instants: Samples, total: int | None) -> Samples:
        """Value of a channel at instants: the sample last clocked out; NaN before the first."""
        count = np.array([times.count(float(instant)) for instant in instants]) - 1
        if total is not None:
            count = np.minimum(count, total - 1)
        length = self._samples.shape[1]
        index = count % length if self.regenerates else np.minimum(count, length - 1)
        return np.where(count < 0, np.nan, self._samples[row, np.maximum(index, 0)])


def line_levels(channel: VirtualChannel, word: int) -> dict[str, bool]:
    """Levels of a digital channel's lines for a word written to it."""
    inverted = bool(channel.attributes.get("DO_INVERT_LINES", False))
    return {line: bool(word >> bit & 1) ^ inverted for bit, line in enumerate(channel.lines)}
