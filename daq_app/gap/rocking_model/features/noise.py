"""Covariance of regression coefficients under noise with a spectrum: white, short-lived and slow parts.

What a regression leaves is modelled as noise of a short memory plus a random walk of the zero. The walk is
what a zero that drifts, a cable that warms or 1/f noise makes over seconds; it goes almost wholly into the
coefficients of slow shapes, where the autocorrelation of the residual no longer shows it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray, independent_fraction
from daq_app.gap.rocking_model.tolerances.motion import LEAST_INDEPENDENT

_CELL = 8
"""Samples of the grid, 40 ms, that are averaged before increments are taken: averages out white noise."""
_ALL = 0.9999
"""Share of its squares beyond which nothing more is said to be explained of a record."""
_LAGS = (2, 4, 8, 16)
"""Lags in cells, 0.08–0.64 s: longer ones are absorbed by the shapes of the regression."""


def walk_variance(residual: FloatArray, places: NDArray[np.intp]) -> float:
    """Variance per sample of the random walk in a residual, (n,), at the places `places` of the grid.

    The mean square increment over a lag is 2 σ² + q · lag: what an impact leaves is short and only raises σ²,
    a cable that jumps by s in n samples is a walk of q = s²/n. 0 where increments do not grow with the lag.
    """
    # Cells of each unbroken part of the record, as far as they are whole.
    edges = np.concatenate([[0], np.flatnonzero(np.diff(places) != 1) + 1, [places.size]])
    cells = np.diff(edges) // _CELL
    part = np.repeat(np.arange(cells.size), cells)
    within = np.arange(part.size) - np.repeat(np.cumsum(cells) - cells, cells)
    means = residual[(edges[part] + _CELL * within)[:, None] + np.arange(_CELL)].mean(axis=1)
    known = []
    for lag in _LAGS:
        squares = (means[lag:] - means[:-lag])[part[lag:] == part[:-lag]] ** 2
        if squares.size >= 8:
            known.append((lag * _CELL, squares))
    if len(known) < 2:
        return 0.0
    lags = np.array([lag for lag, _ in known], dtype=float)
    levels = np.array([float(row.mean()) for _, row in known])
    # Increments of longer lags overlap more and are known less well: relative errors ∝ √lag.
    slope, _ = np.polyfit(lags, levels, 1, w=1.0 / np.sqrt(lags))
    return max(float(slope), 0.0)


def coefficient_covariance(
    residual: FloatArray, projection: FloatArray, pick: NDArray[np.bool_], shapes: int
) -> FloatArray:
    """Covariance, (k, k), of coefficients = `projection` @ series at the samples `pick` of the grid.

    `residual`: (n,) what the regression leaves at those samples; `shapes`: how many shapes it has.
    """
    places = np.flatnonzero(pick)
    fraction = max(independent_fraction(residual), LEAST_INDEPENDENT)
    variance = float(residual @ residual) / max(residual.size - shapes, 1) / fraction
    walk = walk_variance(residual, places)
    covariance: FloatArray = variance * projection @ projection.T
    if walk > 0.0:
        steps = np.diff(places, prepend=places[0]).astype(float)
        # A walk is a sum of steps: each moves all samples after it.
        moved = np.cumsum(projection[:, ::-1], axis=1)[:, ::-1]
        covariance = covariance + walk * (moved * steps) @ moved.T
    return covariance


def nats_explained(values: FloatArray, explained: FloatArray, at_least: float) -> FloatArray:
    """Gain in log likelihood, (k,), of shapes that explain so much, (k,), of the squares of values, (n,).

    `at_least`: share of the samples that count as independent, however alike neighbours are.
    """
    share = np.clip(explained / max(float(values @ values), 1e-300), 0.0, _ALL)
    fraction = max(independent_fraction(values), at_least)
    return -0.5 * fraction * values.size * np.log1p(-share)
