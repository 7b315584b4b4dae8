"""Gaussian likelihood of a run's features with random effects integrated out.

    y ~ N(f(u), C),  C = diag(sd² + Σ σ_s² d_s² + ν_g² m²) + Σ σ_s² L_s L_sᵀ + L_f L_fᵀ

σ_s is the scatter of the specimen (e.g. of r from impact to impact). ν_g is the discrepancy of the model in
the feature's group, in units of its nominal sd m: what the model itself gets wrong there (Kennedy and
O'Hagan, J. R. Stat. Soc. B 63, 2001). Both are estimated under every hypothesis, so the strength of an effect
counts against repeatability and against the model's own limits, and not against sensor noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting import dense
from daq_app.gap.core.fitting.experiment import Coupling, Experiment
from daq_app.gap.core.model import Prediction, Scatter
from daq_app.gap.core.policy import POLICY

LOG_2PI = math.log(2 * math.pi)
_SMALLEST = 1e-6
"""Square of a discrepancy below which it is none."""
_LARGEST_STEP = 100.0
"""Factor by which one step changes the square of a discrepancy at most."""


class Covariance:
    """C of one run. Rows that share no random effect are kept as a diagonal, the coupled ones as a block."""

    def __init__(
        self,
        sd: FloatArray,
        prediction: Prediction,
        scatter: Mapping[str, float],
        discrepancy: FloatArray | None = None,
        coupling: Coupling | None = None,
    ) -> None:
        """`discrepancy`: its variance for each feature, shape (n,). `coupling`: that of the prediction's
        fixed loadings, where it is known."""
        diagonal = sd**2 if discrepancy is None else sd**2 + discrepancy
        columns: list[FloatArray] = []
        for name, loading in prediction.loadings.items():
            if loading.ndim == 1:
                diagonal = diagonal + (scatter[name] * loading) ** 2
            elif loading.shape[1]:
                columns.append(scatter[name] * loading)
        if coupling is None:
            coupling = Coupling.of(prediction.fixed_loadings)
        if columns:
            fixed = prediction.fixed_loadings
            coupling = Coupling.of(np.hstack(columns if fixed is None else [*columns, fixed]))
        self._variance = diagonal
        self._root = np.sqrt(diagonal)
        self._rows = coupling.rows
        self.log_det = 0.0
        if self._rows.size:
            block = coupling.product.copy()
            diagonal_places = np.arange(self._rows.size)
            block[diagonal_places, diagonal_places] += diagonal[self._rows]
            self._variance = diagonal.copy()
            self._variance[self._rows] = block[diagonal_places, diagonal_places]
            lower = dense.factor(block)
            self._inverse = dense.inverse_factor(lower)
            # The block has its own factor: its rows count as of variance one in the diagonal.
            self._root[self._rows] = 1.0
            self.log_det = 2.0 * float(np.log(np.diag(lower)).sum())
        self.log_det += 2.0 * float(np.log(self._root).sum())

    @property
    def marginal_sd(self) -> FloatArray:
        """√diag C, (n,): what each feature alone would scatter by."""
        return np.sqrt(self._variance)

    def whiten(self, matrix: FloatArray) -> FloatArray:
        """M X with MᵀM = C⁻¹, for X of shape (n,) or (n, m): N(0, 1) where X has the covariance C."""
        white: FloatArray = matrix / (self._root if matrix.ndim == 1 else self._root[:, None])
        if self._rows.size:
            white[self._rows] = self._inverse @ matrix[self._rows]
        return white

    def back(self, white: FloatArray) -> FloatArray:
        """Mᵀ X for X of shape (n,) or (n, m), with the M of `whiten`."""
        product: FloatArray = white / (self._root if white.ndim == 1 else self._root[:, None])
        if self._rows.size:
            product[self._rows] = self._inverse.T @ white[self._rows]
        return product

    def inverse_diagonal(self) -> FloatArray:
        """diag C⁻¹, shape (n,)."""
        inverse: FloatArray = 1.0 / self._root**2
        if self._rows.size:
            inverse[self._rows] = np.sum(self._inverse**2, axis=0)
        return inverse


def log_density(residual: FloatArray, covariance: Covariance) -> float:
    """ln N(r; 0, C) of a residual r, (n,)."""
    white = covariance.whiten(residual)
    return -0.5 * (float(white @ white) + covariance.log_det + residual.size * LOG_2PI)


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of the random effects of one hypothesis.

    `log_scatter`: ln σ_s in the order of the model's scatters. `discrepancy`: ν_g² by group.
    """

    log_scatter: FloatArray
    discrepancy: FloatArray

    @classmethod
    def nominal(cls, experiment: Experiment) -> Sizes:
        """Scatter at its prior medians, and next to no discrepancy."""
        medians = np.array([math.log(s.median) for s in experiment.model.scatters])
        return cls(medians, np.full(len(experiment.groups), POLICY.starting_discrepancy**2))

    def scatter(self, scatters: tuple[Scatter, ...]) -> dict[str, float]:
        """σ_s by name."""
        return {s.name: math.exp(float(v)) for s, v in zip(scatters, self.log_scatter, strict=True)}

    def without_discrepancy(self) -> Sizes:
        """The same scatter, and a model that is exact."""
        return Sizes(self.log_scatter, np.zeros_like(self.discrepancy))

    def cost(self, scatters: tuple[Scatter, ...]) -> float:
        """−ln prior: log-normal scatter, half-Cauchy discrepancy of scale one (both up to a constant)."""
        strain = (
            (v - math.log(s.median)) / s.log_sd for s, v in zip(scatters, self.log_scatter, strict=True)
        )
        spread = np.log1p(self.discrepancy / POLICY.usual_discrepancy**2)
        return 0.5 * math.fsum(z * z for z in strain) + float(spread.sum())

    def covariance(self, experiment: Experiment, run: int, prediction: Prediction) -> Covariance:
        """C of one run."""
        groups = experiment.groups
        added = self.discrepancy[groups.index[run]] * groups.variance[run]
        scatter = self.scatter(experiment.model.scatters)
        coupling = experiment.couplings[run]
        known = coupling if prediction.fixed_loadings is coupling.loadings else None
        return Covariance(experiment.runs[run].features.sd, prediction, scatter, added, known)

    def updated(
        self,
        scatters: tuple[Scatter, ...],
        grown: tuple[FloatArray, FloatArray],
        held: tuple[FloatArray, FloatArray],
    ) -> Sizes:
        """One step of the restricted-likelihood fixed point σ² ← σ² S / Q for every size.

        `grown` and `held`: S and Q of the scatters and of the groups. With S the square of C⁻¹e and Q the
        trace of P, both projected on the size's loadings, S = Q where the restricted likelihood is highest
        (Harville, J. Am. Stat. Assoc. 72, 1977); priors add to the side that they pull to.
        """
        log_scatter = self.log_scatter.copy()
        for k, scatter in enumerate(scatters):
            pull = (
                (log_scatter[k] - math.log(scatter.median))
                / scatter.log_sd**2
                * math.exp(-2 * log_scatter[k])
            )
            above, below = grown[0][k] + max(-pull, 0.0), held[0][k] + max(pull, 0.0)
            if above > 0.0 and below > 0.0:
                log_scatter[k] += np.clip(0.5 * math.log(above / below), -1.0, 1.0)
        usual = POLICY.usual_discrepancy**2
        ratio = grown[1] / (held[1] + 2.0 / (usual + self.discrepancy))
        square = self.discrepancy * np.clip(ratio, 1.0 / _LARGEST_STEP, _LARGEST_STEP)
        return Sizes(log_scatter, np.maximum(square, _SMALLEST))
