"""What a converter makes of a voltage: rails, codes, and the voltage that a code stands for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Converter:
    """An ideal converter of `bits` bits over [low, high] (electrical unit, usually volts)."""

    low: float
    high: float
    bits: int

    @property
    def step(self) -> float:
        """Size of one code, electrical unit."""
        return (self.high - self.low) / float(2**self.bits)

    @property
    def middle(self) -> float:
        return 0.5 * (self.high + self.low)

    @property
    def code_limits(self) -> tuple[int, int]:
        half = 1 << (self.bits - 1)
        return -half, half - 1

    def codes(self, electrical: NDArray[np.float64]) -> NDArray[np.int32]:
        """Rounded codes, clipped at the rails."""
        scaled = np.rint((electrical - self.middle) * (1.0 / self.step))
        return np.clip(scaled, *self.code_limits).astype(np.int32)

    def electrical(self, codes: NDArray[np.int32]) -> NDArray[np.float64]:
        """The electrical value that each code stands for."""
        return codes.astype(np.float64) * self.step + self.middle
