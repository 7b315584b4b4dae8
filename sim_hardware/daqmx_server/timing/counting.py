"""Counter inputs: what they measure of the pulses that another counter of the bench puts out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes

TIMEBASE_HZ: Final = 100e6
"""Clock that pulse widths are counted in, where the client asks for ticks."""


@dataclass(frozen=True, slots=True)
class Pulses:
    """A train of pulses from an instant on."""

    first_s: float
    low_s: float
    high_s: float
    count: float
    """Number of pulses; inf for a train without end."""

    @property
    def period_s(self) -> float:
        return self.low_s + self.high_s

    def edges_before(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rising edges up to each instant: the first comes after one low time."""
        count = np.floor((times_s - self.first_s - self.low_s) / self.period_s + 1e-9) + 1
        return np.asarray(np.clip(count, 0, self.count))


PulsesAt = Callable[[VirtualChannel], Pulses | None]


class CounterSampler:
    """Readings of counter-input channels; a terminal without pulses reads the middle of the range, or 0."""

    def __init__(
        self, channels: Sequence[VirtualChannel], times: SampleTimes, armed_s: float, pulses_at: PulsesAt
    ) -> None:
        self._channels = tuple(channels)
        self._times = times
        self._armed_s = armed_s
        self._pulses_at = pulses_at

    def codes(self, start: int, stop: int) -> NDArray[np.float64]:
        """Readings of samples start … stop−1, shape (channels, samples)."""
        instants = self._times.at(np.arange(start, stop))
        return np.array([self._row(channel, instants) for channel in self._channels])

    def _row(self, channel: VirtualChannel, instants: NDArray[np.float64]) -> NDArray[np.float64]:
        pulses = self._pulses_at(channel)
        if channel.measurement == "COUNT_EDGES":
            initial = float(channel.attributes.get("CI_COUNT_EDGES_INITIAL_CNT", 0))
            if pulses is None:
                return np.full(len(instants), initial)
            counted = pulses.edges_before(instants) - pulses.edges_before(np.array([self._armed_s]))
            return initial + counted
        return np.full(len(instants), value_of(channel, pulses))


def value_of(channel: VirtualChannel, pulses: Pulses | None) -> float:
    """One reading of a measurement that does not change from sample to sample."""
    attributes = channel.attributes
    if pulses is None:
        return 0.5 * (float(attributes.get("CI_MIN", 0.0)) + float(attributes.get("CI_MAX", 0.0)))
    values = {
        "FREQUENCY": 1.0 / pulses.period_s,
        "PERIOD": pulses.period_s,
        "PULSE_WIDTH_DIGITAL": pulses.high_s,
        "PULSE_WIDTH_DIGITAL_SEMI_PERIOD": pulses.high_s,
        "DUTY_CYCLE": pulses.high_s / pulses.period_s,
    }
    return values.get(channel.measurement, 0.0)
