"""The metric of one run during a search: products with C⁻¹ for many scatter sizes without building C anew.

C = diag(sd² + Σ σ_s² d_s²) + L_f L_fᵀ. Where the rows that L_f couples have one scatter each, of a size
that does not depend on the parameters, the generalised eigenvectors of (diag sd² + L_f L_fᵀ, diag d²) make
C diagonal for every σ at once. A coupled row without scatter is given one of a ten-thousandth of its error,
which changes nothing that could be seen and keeps the problem regular. Other covariances go through
Woodbury's identity (`likelihood.Covariance`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.likelihood import Covariance
from daq_app.gap.core.model import Prediction

_NEGLIGIBLE = 1e-4


class Metric(Protocol):
    """Products with C⁻¹ of one run."""

    def suits(self, prediction: Prediction) -> bool:
        """Whether the metric still holds for another prediction of the same run."""
        ...

    def prepare(self, matrix: FloatArray) -> FloatArray:
        """Columns (n, m) in the coordinates that `gram` takes; they depend on no scatter size."""
        ...

    def gram(
        self, prepared: FloatArray, prediction: Prediction, sigmas: Mapping[str, float]
    ) -> tuple[FloatArray, float]:
        """(columnsᵀ C⁻¹ columns of shape (m, m), ln |C|)."""
        ...


class DiagonalMetric:
    """C made diagonal by one rotation of the coupled rows."""

    def __init__(self, sd: FloatArray, prediction: Prediction, own: str, rows: NDArray[np.intp]) -> None:
        self._variance = sd**2
        self._own, self._rows = own, rows
        self._seen = prediction.loadings[own] if own else None
        """The loading of the coupled rows' scatter as it was given first: mostly it stays the same array."""
        self._given = prediction.loadings[own][rows] if own else np.zeros(0)
        self._scale = self._given
        if rows.size:
            assert prediction.fixed_loadings is not None
            error = np.sqrt(self._variance[rows] + np.sum(prediction.fixed_loadings[rows] ** 2, axis=1))
            self._scale = np.where(self._given == 0.0, _NEGLIGIBLE * error, self._given)
            coupled = prediction.fixed_loadings[rows] / self._scale[:, None]
            whole = np.diag(self._variance[rows] / self._scale**2) + coupled @ coupled.T
            self._eigen, vectors = np.linalg.eigh(whole)
            self._turn = vectors.T / self._scale
            self._variance[rows] = self._eigen
        self._log_scale = 2.0 * float(np.log(np.abs(self._scale)).sum())

    def suits(self, prediction: Prediction) -> bool:
        if not self._own or prediction.loadings[self._own] is self._seen:
            return True
        return np.array_equal(prediction.loadings[self._own][self._rows], self._given)

    def prepare(self, matrix: FloatArray) -> FloatArray:
        turned = matrix.copy()
        if self._rows.size:
            turned[self._rows] = self._turn @ matrix[self._rows]
        return turned

    def gram(
        self, prepared: FloatArray, prediction: Prediction, sigmas: Mapping[str, float]
    ) -> tuple[FloatArray, float]:
        variance = self._variance.copy()
        for name, loading in prediction.loadings.items():
            added = (sigmas[name] * loading) ** 2
            if self._rows.size:
                added[self._rows] = sigmas[name] ** 2 if name == self._own else 0.0
            variance += added
        product: FloatArray = prepared.T @ (prepared / variance[:, None])
        return product, float(np.log(variance).sum()) + self._log_scale


class GeneralMetric:
    """Any covariance, by Woodbury's identity."""

    def __init__(self, sd: FloatArray) -> None:
        self._sd = sd

    def suits(self, prediction: Prediction) -> bool:
        return True

    def prepare(self, matrix: FloatArray) -> FloatArray:
        return matrix

    def gram(
        self, prepared: FloatArray, prediction: Prediction, sigmas: Mapping[str, float]
    ) -> tuple[FloatArray, float]:
        covariance = Covariance(self._sd, prediction, sigmas)
        return covariance.gram(prepared), covariance.log_det


def metric_of(sd: FloatArray, prediction: Prediction) -> Metric:
    """The cheapest metric that is exact for a prediction."""
    if any(loading.ndim > 1 and loading.shape[1] for loading in prediction.loadings.values()):
        return GeneralMetric(sd)
    fixed = prediction.fixed_loadings
    rows = np.zeros(0, dtype=np.intp) if fixed is None else np.flatnonzero(fixed.any(axis=1))
    if not rows.size:
        return DiagonalMetric(sd, prediction, "", rows)
    acting = [name for name, loading in prediction.loadings.items() if loading[rows].any()]
    if len(acting) == 1:
        return DiagonalMetric(sd, prediction, acting[0], rows)
    return GeneralMetric(sd)
