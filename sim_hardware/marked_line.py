"""Terminals that tell what was sampled, and when: a `SignalSource` that proves every sample's place.

LVDT terminals carry a slow triangle over most of their range, each with a lag of its own: the volts of one
sample say at which instant, and on which channel, it was taken. The other terminals stand at their
sensor's zero with a little noise, so that no analysis sees a motion. Used where faults are injected and
every recorded sample must be shown to be the right one (`tests/faults`, `studies/recording`).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Rig

PERIOD_SAMPLES: Final = 40_000
"""After these everything repeats; within them two instants never look alike on all channels."""
_LAG_SAMPLES: Final = 1_700
_REACH: Final = 0.9
_NOISE_V: Final = 1.5e-3
_KNUTH: Final = 2_654_435_761

Floats = NDArray[np.float64]


class MarkedLine:
    """Keeps `SignalSource` for the terminals of a rig; takes no commands but `status` and `reset`."""

    def __init__(self, rig: Rig) -> None:
        self._rate_hz = rig.acquisition.rate_hz
        self._rows = {channel.physical_channel: row for row, channel in enumerate(rig.channels)}
        self._channels = rig.channels

    def volts(self, terminals: tuple[str, ...], times_s: Floats) -> Floats:
        """(len(terminals), len(times_s)); a terminal that is not wired stays at 0 V."""
        out = np.zeros((len(terminals), len(times_s)))
        tick = np.floor(times_s * self._rate_hz + 1e-3)
        for index, name in enumerate(terminals):
            row = self._rows.get(name)
            if row is not None:
                out[index] = self._of_row(row, tick)
        return out

    def reading(self, row: int, samples: NDArray[np.int64]) -> Floats:
        """What a voltage channel (rig order) reads at these samples, but for the converter's steps."""
        return self._of_row(row, samples.astype(np.float64))

    def _of_row(self, row: int, tick: Floats) -> Floats:
        channel = self._channels[row]
        if channel.family != "lvdt":
            mixed = ((tick % PERIOD_SAMPLES + 911.0 * row).astype(np.int64) * _KNUTH) >> 13 & 0xFF
            zero = 0.0 if channel.scaled_by_driver else channel.offset
            return zero + _NOISE_V * (mixed / 127.5 - 1.0)
        low, high = channel.input_range_v
        phase = (tick + _LAG_SAMPLES * row) % PERIOD_SAMPLES / PERIOD_SAMPLES
        triangle = 1.0 - 4.0 * np.abs(phase - 0.5)
        return 0.5 * (low + high) + 0.5 * _REACH * (high - low) * triangle

    def advance(self, time_s: float) -> None:
        """Nothing here depends on commands."""

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        """`status` and `reset` do nothing; `ValueError` for all others."""
        if name in ("status", "reset"):
            return {"state": "marked"}
        raise ValueError(f"no wall is wired to this bench (--wall marked): it cannot {name}")
