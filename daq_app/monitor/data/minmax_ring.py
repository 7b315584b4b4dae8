"""Min/max decimation of live channels, done once per sample as it arrives.

A strip a few hundred pixels wide shows tens of thousands of samples. Taking every n-th would lose
an impact spike that lasts one sample; keeping the smallest and largest of each column never does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


class MinMaxRing:
    """The last `n_columns` columns of every channel, each the extremes of `samples_per_column` samples.

    Columns lie on a grid that is fixed to the sample index (column = sample // samples_per_column),
    so that blocks may come in any sizes. Columns without a sample, behind a gap for instance, are NaN.
    """

    def __init__(self, n_channels: int, n_columns: int, samples_per_column: int) -> None:
        if min(n_channels, n_columns, samples_per_column) < 1:
            raise ValueError("channels, columns and samples per column must be at least 1")
        self.n_channels = n_channels
        self.n_columns = n_columns
        self.samples_per_column = samples_per_column
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        shape = (self.n_channels, self.n_columns)
        self._low: Array = np.full(shape, np.nan, dtype=np.float32)
        self._high: Array = np.full(shape, np.nan, dtype=np.float32)
        self._newest = -1

    @property
    def end_sample(self) -> int:
        """First sample after the newest column; 0 when empty."""
        return (self._newest + 1) * self.samples_per_column

    def append(self, first_sample: int, values: NDArray[np.floating]) -> None:
        """Add `values` (n_channels, n_samples) whose first column is sample `first_sample`.

        Samples older than the ring reaches are ignored; a sample that is NaN counts as missing.
        """
        if values.shape[0] != self.n_channels:
            raise ValueError(f"{values.shape[0]} channels given, {self.n_channels} expected")
        size = self.samples_per_column
        end = first_sample + values.shape[1]
        oldest_kept = max(self._newest, (end - 1) // size) - self.n_columns + 1
        skip = max(0, oldest_kept * size - first_sample)
        if skip >= values.shape[1]:
            return
        first, values = first_sample + skip, values[:, skip:]
        self._advance((end - 1) // size)
        head = min(-first % size, values.shape[1])
        if head:
            self._merge(first // size, values[:, :head, None].transpose(0, 2, 1))
        whole = (values.shape[1] - head) // size
        if whole:
            body = values[:, head : head + whole * size].reshape(self.n_channels, whole, size)
            self._merge((first + head) // size, body)
        tail = values[:, head + whole * size :]
        if tail.shape[1]:
            self._merge((end - 1) // size, tail[:, None, :])

    def columns(self, merge: int = 1) -> tuple[Array, Array]:
        """(low, high), each (n_channels, n_columns), oldest column first, newest last; copies.

        With `merge` above 1, that many neighbours become one column, for a picture with fewer
        pixels. The groups lie on the sample grid like the columns, so that the picture does not
        shimmer as it moves on; the newest group may still be filling.
        """
        shift = -((self._newest + 1) % self.n_columns)
        low, high = np.roll(self._low, shift, axis=1), np.roll(self._high, shift, axis=1)
        if merge == 1:
            return low, high
        head = -(self._newest + 1 - self.n_columns) % merge
        tail = -(self.n_columns - head) % merge
        padding = ((0, 0), (0, tail))

        def grouped(values: Array) -> NDArray[np.float32]:
            padded = np.pad(values[:, head:], padding, constant_values=np.nan)
            return padded.reshape(self.n_channels, -1, merge)

        return np.fmin.reduce(grouped(low), axis=2), np.fmax.reduce(grouped(high), axis=2)

    def _advance(self, column: int) -> None:
        """Make `column` the newest, emptying the columns between."""
        if column <= self._newest:
            return
        count = min(column - self._newest, self.n_columns)
        slots = np.arange(column - count + 1, column + 1) % self.n_columns
        self._low[:, slots] = np.nan
        self._high[:, slots] = np.nan
        self._newest = column

    def _merge(self, column: int, groups: NDArray[np.floating]) -> None:
        """Fold `groups` (n_channels, k, samples) into columns column … column + k − 1."""
        slots = np.arange(column, column + groups.shape[1]) % self.n_columns
        low = np.fmin.reduce(groups, axis=2).astype(np.float32)
        high = np.fmax.reduce(groups, axis=2).astype(np.float32)
        self._low[:, slots] = np.fmin(self._low[:, slots], low)
        self._high[:, slots] = np.fmax(self._high[:, slots], high)
