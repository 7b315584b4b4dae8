"""Readings to SI and back: the only place where polarity, offset, tare and sensitivity meet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Channel

_NO_TARE: Mapping[str, float] = {}


@dataclass(frozen=True, slots=True)
class Scaling:
    """Linear map of several channels: ``si = (reading − zero) · gain`` row by row."""

    zero: NDArray[np.float64]
    """(n, 1) reading at zero quantity: certificate offset plus tare, unit of the reading."""
    gain: NDArray[np.float64]
    """(n, 1) signed SI per reading."""

    @classmethod
    def of(cls, channels: Sequence[Channel], tare: Mapping[str, float] = _NO_TARE) -> Scaling:
        """Scaling of `channels` in order; `tare` gives what a zeroing found beyond the offset, by id."""
        zero = [channel.offset + tare.get(channel.id, 0.0) for channel in channels]
        gain = [channel.polarity / channel.sensitivity_reading_per_si for channel in channels]
        return cls(np.array(zero, dtype=np.float64)[:, None], np.array(gain, dtype=np.float64)[:, None])

    def to_si(
        self, readings: NDArray[np.float64], out: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """(n, m) readings to SI, into `out` (which may be `readings` themselves) if given."""
        tared = np.subtract(readings, self.zero, out=out)
        return np.multiply(tared, self.gain, out=tared)

    def to_readings(self, si: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, m) SI to readings."""
        return si / self.gain + self.zero
