"""Noise of one sample, read from a record itself."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.means import means_over

Floats = NDArray[np.float64]

_MEAN_S = 0.015
"""Length of the means over which a crossing is timed."""
_CLIPPED = 4.0
"""Standard deviations beyond which a mean is that of an impact, which counts for no more."""


def white_noise(values: Floats) -> float:
    """rms of the white noise of a record (n,), by second differences, robust to impacts; NaN for too few."""
    second = np.diff(values, 2)
    known = np.isfinite(second)
    second = second if known.all() else second[known]
    if second.size < 100:
        return math.nan
    # Median absolute deviation to standard deviation; a second difference has six times the variance.
    second -= np.median(second)
    return float(np.median(np.abs(second, out=second), overwrite_input=True)) * 1.4826 / math.sqrt(6.0)


def moving_noise(rows: Floats, patterns: Floats, shapes: Floats, rate_hz: float) -> float:
    """rms of one sample of records of one make while they move, as means over 15 ms see it.

    Windings and wipers of potentiometers err where they move, and not at rest. Noise is what is left of
    `rows`, (k, n), at each instant beyond `patterns` over them, (k, p), which the motion makes, and in time
    beyond `shapes`, (s, n), by which sound sensors differ (gains, times). Robust to impacts; NaN for no more
    records than patterns, or too few samples.
    """
    size = max(int(_MEAN_S * rate_hz), 1)
    left_of, sizes, _ = np.linalg.svd(patterns, full_matrices=False)
    basis = left_of[:, sizes > 1e-9 * sizes[0]]
    rank = basis.shape[1]
    if len(rows) <= rank or rows.shape[1] < 20 * size:
        return math.nan
    apart, design = means_over(rows, size), means_over(shapes, size).T
    apart = (apart - basis @ (basis.T @ apart)).T
    left = np.abs(apart - design @ np.linalg.lstsq(design, apart, rcond=None)[0])
    usual = 1.4826 * np.median(left, axis=0)
    square = np.mean(np.minimum(left, _CLIPPED * usual) ** 2, axis=0).sum()
    return math.sqrt(float(square) / (len(rows) - rank) * size)


def timing_noise(rest: Floats, rate_hz: float) -> float:
    """rms of one sample of a record at rest (n,), as means over 15 ms see it, of the unit of `rest`.

    Coloured noise averages down less than white noise of the same rms; the larger of the two counts.
    """
    white = float(np.sqrt(np.mean(np.diff(rest, 2) ** 2) / 6.0))
    size = max(int(_MEAN_S * rate_hz), 1)
    means = means_over(rest, size)
    place = np.arange(means.size)
    left = means - np.polyval(np.polyfit(place, means, 1), place)
    coloured = float(np.sqrt(np.sum(left**2) / max(means.size - 2, 1) * size))
    return max(white, coloured) + 1e-12
