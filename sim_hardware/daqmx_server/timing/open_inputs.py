"""What analogue inputs of a simulated device show where nothing is wired: NI's sine with its noise.

NI-DAQmx User Manual, "Reading and Writing Data with NI-DAQmx Simulated Devices": a full-scale sine with noise
of three per cent of full scale, the channels of a task five degrees apart, and the channel's minimum and
maximum as its ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

_PERIOD_SAMPLES: Final = 100
_SHIFT_RAD: Final = np.deg2rad(5.0)
"""Each further channel of a task is so far ahead of the one before."""
_NOISE: Final = 0.03
"""Largest noise over half of the span. The manual gives no distribution: uniform is assumed."""


class ShownInput(Protocol):
    """An input as far as its sine is concerned."""

    @property
    def shown(self) -> tuple[float, float]:
        """Ends of the sine."""
        ...

    @property
    def step(self) -> float:
        """One code of its converter."""
        ...


def noisy_sines(
    inputs: Sequence[ShownInput], rows: NDArray[np.int64], index: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Samples of those numbers of the inputs that stand in these rows of a task, (inputs, samples).

    They keep one code away from both ends, so that no rounded reading lies beyond them. A sample depends on
    its number and row alone: read again, it is the same.
    """
    ends = np.array([entry.shown for entry in inputs])
    steps = np.array([entry.step for entry in inputs])
    middle, half = ends.mean(axis=1), np.maximum(0.5 * (ends[:, 1] - ends[:, 0]) - steps, 0.0)
    phase = 2.0 * np.pi * index / _PERIOD_SAMPLES + _SHIFT_RAD * rows[:, None]
    shares = np.clip(np.sin(phase) + _NOISE * _uniform(rows, index), -1.0, 1.0)
    sines: NDArray[np.float64] = middle[:, None] + half[:, None] * shares
    return sines


def _uniform(rows: NDArray[np.int64], index: NDArray[np.int64]) -> NDArray[np.float64]:
    """Numbers from −1 to 1 that look random: SplitMix64's finaliser of row and number of the sample."""
    key = (rows.astype(np.uint64) + np.uint64(1)) * np.uint64(0xD1342543DE82EF95)
    z = key[:, None] + index.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    numbers: NDArray[np.float64] = (z >> np.uint64(11)) * (2.0 / 2.0**53) - 1.0
    return numbers
