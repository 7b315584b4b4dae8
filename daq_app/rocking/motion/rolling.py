"""A window on the end of a growing series, with absolute indices and bounded memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class RollingArray:
    """Appends columns, forgets the oldest beyond `capacity`; slices are contiguous views."""

    def __init__(self, capacity: int, rows: int = 1) -> None:
        self._capacity = capacity
        self._data = np.empty((rows, 2 * capacity))
        self._used = 0
        self._end = 0

    @property
    def end(self) -> int:
        """Absolute index after the last value."""
        return self._end

    @property
    def start(self) -> int:
        """Absolute index of the oldest value kept."""
        return self._end - self._used

    def grow(self, capacity: int) -> None:
        """Keep at least `capacity` values from now on."""
        if capacity > self._capacity:
            data = np.empty((self._data.shape[0], 2 * capacity))
            data[:, : self._used] = self._data[:, : self._used]
            self._data, self._capacity = data, capacity

    def append(self, *blocks: Floats) -> None:
        """Append (rows, n) values, or several blocks of rows (k, n) that lie one below the other."""
        n = blocks[0].shape[1]
        if n > self._capacity:
            self._end += n - self._capacity
            blocks, n, self._used = tuple(b[:, -self._capacity :] for b in blocks), self._capacity, 0
        if self._used + n > self._data.shape[1]:
            keep = self._capacity - n
            self._data[:, :keep] = self._data[:, self._used - keep : self._used].copy()
            self._used = keep
        columns, row = slice(self._used, self._used + n), 0
        for block in blocks:
            self._data[row : row + block.shape[0], columns] = block
            row += block.shape[0]
        self._used += n
        self._end += n

    def slice(self, start: int, stop: int) -> Floats:
        """(rows, n) view of absolute indices [start, stop), cut to what is kept."""
        oldest = self._end - self._used
        low, high = max(start - oldest, 0), min(stop, self._end) - oldest
        return self._data[:, low : max(high, low)]

    def last(self, n: int) -> Floats:
        """(rows, up to n) view of the newest values."""
        return self._data[:, self._used - min(n, self._used) : self._used]
