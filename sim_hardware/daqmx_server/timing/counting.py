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


Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pulses:
    """Pulses from an instant on, one after the other and then again from the first one."""

    first_s: float
    lows_s: Values
    highs_s: Values
    count: float
    """Number of pulses; inf for a train without end."""
    high_first: bool = False
    """Each pulse begins with its high time (idle state high): the line rises at its end."""

    @classmethod
    def regular(cls, first_s: float, low_s: float, high_s: float, count: float = np.inf) -> Pulses:
        """Pulses that are all alike."""
        return cls(first_s, np.array([low_s]), np.array([high_s]), count)

    @property
    def _rises_s(self) -> Values:
        """Rising edges of one turn, from its start."""
        ends = np.cumsum(self.lows_s + self.highs_s)
        return np.asarray(ends if self.high_first else ends - self.highs_s)

    def edges_before(self, times_s: Values) -> Values:
        """Rising edges up to each instant."""
        turn_s = float((self.lows_s + self.highs_s).sum())
        slack_s = 1e-9 * turn_s / len(self.lows_s)
        turns, rest_s = np.divmod(np.asarray(times_s) - self.first_s + slack_s, turn_s)
        edges = turns * len(self.lows_s) + np.searchsorted(self._rises_s, rest_s, side="right")
        return np.asarray(np.clip(edges, 0, self.count))

    def between_edges(self, number: NDArray[np.int64]) -> tuple[Values, Values]:
        """Low and high time between a rising edge and the next one, by the number of the first, s."""
        n = len(self.lows_s)
        following = (np.asarray(number) + 1) % n
        high = self.highs_s[following if self.high_first else np.asarray(number) % n]
        return self.lows_s[following], high

    def measured(
        self, index: NDArray[np.int64], instants: Values, armed_s: float, implicit: bool
    ) -> tuple[Values, Values]:
        """Low and high times that samples of a counter input hold, s.

        A task with implicit timing measures each period after its start; any other the last whole one.
        """
        if implicit:
            return self.between_edges(index + int(self.edges_before(np.array([armed_s]))[0]))
        return self.between_edges(np.maximum(self.edges_before(instants) - 2, 0).astype(np.int64))


PulsesAt = Callable[[VirtualChannel], Pulses | None]


class CounterSampler:
    """Readings of counter-input channels; a terminal without pulses reads 0, as NI's simulated devices do."""

    def __init__(
        self,
        channels: Sequence[VirtualChannel],
        times: SampleTimes,
        armed_s: float,
        pulses_at: PulsesAt,
        implicit: bool,
    ) -> None:
        """`implicit`: the pulses themselves are the clock."""
        self._channels = tuple(channels)
        self._times = times
        self._armed_s = armed_s
        self._pulses_at = pulses_at
        self._implicit = implicit

    def codes(self, start: int, stop: int) -> Values:
        """Readings of samples start … stop−1, shape (channels, samples)."""
        index = np.arange(start, stop)
        instants = self._times.at(index)
        return np.array([self._row(channel, index, instants) for channel in self._channels])

    def _row(self, channel: VirtualChannel, index: NDArray[np.int64], instants: Values) -> Values:
        pulses = self._pulses_at(channel)
        attributes = channel.attributes
        if channel.measurement == "COUNT_EDGES":
            initial = float(attributes.get("CI_COUNT_EDGES_INITIAL_CNT", 0))
            if pulses is None:
                return np.full(len(instants), initial)
            counted = pulses.edges_before(instants) - pulses.edges_before(np.array([self._armed_s]))
            return np.asarray(initial + counted)
        if pulses is None:
            return np.zeros(len(instants))
        low_s, high_s = pulses.measured(index, instants, self._armed_s, self._implicit)
        values = {
            "FREQUENCY": 1.0 / (low_s + high_s),
            "PERIOD": low_s + high_s,
            "PULSE_WIDTH_DIGITAL": high_s,
            "PULSE_WIDTH_DIGITAL_SEMI_PERIOD": high_s,
            "DUTY_CYCLE": high_s / (low_s + high_s),
        }
        return values.get(channel.measurement, np.zeros(len(instants)))
