"""Rotation and velocity of the last minutes, kept so that any window of them is one slice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class MotionTrace:
    """The last `capacity` points of θ(t) and θ̇(t) on the sample clock.

    Points live in a buffer of twice the capacity and are moved to its start when it is full, so
    that `window` hands out views and copies nothing.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._data = np.empty((3, 2 * capacity))
        self._count = 0

    def clear(self) -> None:
        """Forget everything."""
        self._count = 0

    def __len__(self) -> int:
        return min(self._count, self.capacity)

    def append(self, samples: Array, rotation_rad: Array, velocity_rad_s: Array) -> None:
        """Add points; `samples` are sample indices and ascend beyond those already here.

        A step back in the index means that the tasks were restarted: what was here is dropped.
        """
        count = samples.size
        if count == 0:
            return
        if self._count and samples[0] <= self._data[0, self._count - 1]:
            self.clear()
        if count > self.capacity:
            samples, rotation_rad, velocity_rad_s = (
                row[-self.capacity :] for row in (samples, rotation_rad, velocity_rad_s)
            )
            count = self.capacity
        if self._count + count > self._data.shape[1]:
            keep = self.capacity - count
            self._data[:, :keep] = self._data[:, self._count - keep : self._count].copy()
            self._count = keep
        self._data[:, self._count : self._count + count] = (samples, rotation_rad, velocity_rad_s)
        self._count += count

    @property
    def last_sample(self) -> float:
        """Sample index of the newest point; NaN when empty."""
        return float(self._data[0, self._count - 1]) if self._count else float("nan")

    def window(self, first_sample: float, last_sample: float = np.inf) -> tuple[Array, Array, Array]:
        """Views (samples, rotation, velocity) of the points within the two sample indices."""
        oldest = max(0, self._count - self.capacity)
        samples = self._data[0, oldest : self._count]
        start = oldest + int(np.searchsorted(samples, first_sample, side="left"))
        stop = oldest + int(np.searchsorted(samples, last_sample, side="right"))
        return self._data[0, start:stop], self._data[1, start:stop], self._data[2, start:stop]
