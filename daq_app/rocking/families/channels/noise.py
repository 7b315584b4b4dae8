"""Noise that is slower than white: what long means of a still record scatter by."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.means import means_over

Floats = NDArray[np.float64]

_MEAN_S = 0.025
"""Length of the means: a quarter of the shortest half-cycles that tell something of r."""
_FEWEST_MEANS = 12


def slow_noise(signal: Floats, rate_hz: float) -> float:
    """rms of one sample of the white noise whose 25 ms means scatter as those of `signal` (n,) do.

    The signal shows a wall at rest; slow drift falls away by second differences. The median of their sizes
    counts, so that a wall that still rocks through a third of it does no harm. NaN for less than 0.3 s.
    """
    size = max(1, round(_MEAN_S * rate_hz))
    means = means_over(signal, size)
    if means.size < _FEWEST_MEANS:
        return math.nan
    second = np.diff(means, 2)
    second = second[np.isfinite(second)]
    if second.size < _FEWEST_MEANS - 2:
        return math.nan
    # A second difference has six times the variance; 1.4826 medians of its size are one rms of a normal one.
    return 1.4826 * float(np.median(np.abs(second))) * math.sqrt(size / 6.0)
