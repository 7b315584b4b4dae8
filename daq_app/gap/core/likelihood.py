"""Gaussian likelihood of a run's features with random effects integrated out.

    y ~ N(f(u), C),  C = diag(sd² + Σ σ_s² d_s²) + Σ σ_s² L_s L_sᵀ + L_f L_fᵀ

The scatter of the specimen (σ_s, e.g. of r from impact to impact) is thus part of the covariance:
the strength of an effect counts against repeatability and not against sensor noise. Products with
C⁻¹ use the Woodbury identity, so the cost grows with n·k², not with n³.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.linalg import solve_triangular

from daq_app.gap.core.features import FeatureSet, FloatArray
from daq_app.gap.core.model import Prediction

_LOG_2PI = math.log(2 * math.pi)


class Covariance:
    """C of one run at given scatter sizes."""

    def __init__(self, sd: FloatArray, prediction: Prediction, sigmas: Mapping[str, float]) -> None:
        diagonal = sd**2
        columns: list[FloatArray] = []
        for name, loading in prediction.loadings.items():
            if loading.ndim == 1:
                diagonal = diagonal + (sigmas[name] * loading) ** 2
            elif loading.shape[1]:
                columns.append(sigmas[name] * loading)
        if prediction.fixed_loadings is not None and prediction.fixed_loadings.shape[1]:
            columns.append(prediction.fixed_loadings)
        self.diagonal = diagonal
        self._loadings = np.hstack(columns) if columns else None
        self._inverse: FloatArray | None = None
        self._log_det_core = 0.0
        if self._loadings is not None:
            weighted = self._loadings / diagonal[:, None]
            core = np.eye(self._loadings.shape[1]) + self._loadings.T @ weighted
            self._weighted = weighted
            # k × k with eigenvalues of at least 1: its inverse is safe, and products with it are many.
            self._inverse = np.linalg.inv(core).astype(np.float64)
            self._log_det_core = float(np.linalg.slogdet(core)[1])

    @property
    def log_det(self) -> float:
        """ln |C|."""
        return float(np.log(self.diagonal).sum()) + self._log_det_core

    def solve(self, right: FloatArray) -> FloatArray:
        """C⁻¹ right, for right of shape (n,) or (n, m)."""
        scaled: FloatArray = right / (self.diagonal if right.ndim == 1 else self.diagonal[:, None])
        if self._inverse is None or self._loadings is None:
            return scaled
        corrected: FloatArray = scaled - self._weighted @ (self._inverse @ (self._loadings.T @ scaled))
        return corrected

    def gram(self, right: FloatArray) -> FloatArray:
        """rightᵀ C⁻¹ right of shape (m, m)."""
        scaled = right / self.diagonal[:, None]
        product: FloatArray = right.T @ scaled
        if self._inverse is not None and self._loadings is not None:
            inner = self._loadings.T @ scaled
            product = product - inner.T @ self._inverse @ inner
        return product

    @property
    def marginal_sd(self) -> FloatArray:
        """√diag C: what one feature alone would scatter by."""
        variance = self.diagonal
        if self._loadings is not None:
            variance = variance + np.sum(self._loadings**2, axis=1)
        return np.sqrt(variance)

    def whiten(self, residual: FloatArray) -> FloatArray:
        """Innovations: each residual given those before it, over its sd. N(0, 1) when all is well."""
        if self._loadings is None:
            plain: FloatArray = residual / np.sqrt(self.diagonal)
            return plain
        whitened: FloatArray = residual / np.sqrt(self.diagonal)
        # Rows that share no random effect are independent of all others: only the coupled ones are turned.
        rows = np.flatnonzero(self._loadings.any(axis=1))
        shared = self._loadings[rows]
        matrix = np.diag(self.diagonal[rows]) + shared @ shared.T
        whitened[rows] = solve_triangular(np.linalg.cholesky(matrix), residual[rows], lower=True)
        return whitened


def log_density(residual: FloatArray, covariance: Covariance) -> float:
    """ln N(residual; 0, C)."""
    quadratic = float(residual @ covariance.solve(residual))
    return -0.5 * (quadratic + covariance.log_det + residual.size * _LOG_2PI)


def run_log_likelihood(features: FeatureSet, prediction: Prediction, sigmas: Mapping[str, float]) -> float:
    """Log likelihood of one run, scaled by its share of independent features."""
    covariance = Covariance(features.sd, prediction, sigmas)
    return features.independent_fraction * log_density(features.values - prediction.features, covariance)
