"""A problem linearised at a point, in the metric of given sizes of the random effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting import dense
from daq_app.gap.core.fitting.likelihood import LOG_2PI, Covariance, Sizes
from daq_app.gap.core.fitting.problem import Linearised, Problem

Mask = NDArray[np.bool_]
_PASSES = 3
"""Passes over the bounds of a linear solution."""
_SETTLED = 0.01
"""Share by which sizes move that have settled."""


class Linear:
    """−log posterior to second order about a point.

    Hessian and gradient are in unit coordinates with the priors included; `objective` is the −log posterior
    at the point itself, priors of the sizes included.
    """

    def __init__(
        self,
        problem: Problem,
        u: FloatArray,
        lines: Sequence[Linearised],
        sizes: Sizes,
        stacked: Sequence[FloatArray] | None = None,
    ) -> None:
        """`stacked`: Jacobian of each run in its own columns beside its residual, where that is known."""
        self.problem, self.u, self.lines, self.sizes = problem, u, lines, sizes
        self._stacked = stacked or [
            np.column_stack([line.jacobian[:, problem.columns(i)], line.residual])
            for i, line in enumerate(lines)
        ]
        self.covariances: list[Covariance] = []
        self.white: list[FloatArray] = []
        """Whitened columns of each run, the residual last, (n, p + 1)."""
        p = len(problem)
        self.hessian, self.gradient = np.eye(p), u.copy()
        log_likelihood = 0.0
        for i, line in enumerate(lines):
            columns, weight = problem.columns(i), problem.runs[i].features.independent_fraction
            covariance = sizes.covariance(problem.experiment, i, line.prediction)
            white = covariance.whiten(self._stacked[i])
            gram = weight * (white.T @ white)
            self.hessian[columns[:, None], columns] += gram[:-1, :-1]
            self.gradient[columns] -= gram[:-1, -1]
            log_likelihood -= 0.5 * float(gram[-1, -1])
            log_likelihood -= 0.5 * weight * (covariance.log_det + line.residual.size * LOG_2PI)
            self.covariances.append(covariance)
            self.white.append(white)
        self.log_likelihood = log_likelihood
        scatters = problem.model.scatters
        self.objective = 0.5 * float(u @ u) - log_likelihood + sizes.cost(scatters)

    @cached_property
    def factor(self) -> FloatArray:
        """Lower Cholesky factor of the Hessian, (p, p)."""
        return dense.factor(self.hessian)

    @property
    def log_det(self) -> float:
        """ln |H|."""
        return 2.0 * float(np.log(np.diag(self.factor)).sum())

    @property
    def covariance(self) -> FloatArray:
        """Posterior covariance of the unknowns in unit coordinates, (p, p)."""
        return dense.solve(self.factor, np.eye(len(self.problem)))

    @cached_property
    def lowest(self) -> float:
        """Half the squares of unknowns and of weighted white residuals at the lowest point without bounds."""
        here = float(self.u @ self.u) + sum(
            run.features.independent_fraction * float(white[:, -1] @ white[:, -1])
            for run, white in zip(self.problem.runs, self.white, strict=True)
        )
        return 0.5 * here - 0.5 * float(self.gradient @ dense.solve(self.factor, self.gradient))

    def free(self, gradient: FloatArray, u: FloatArray) -> Mask:
        """Unknowns, (p,), that the gradient does not press against a bound at `u`."""
        return not_pressed(u, gradient, self.problem.low, self.problem.high)

    def solution(self, damping: float = 0.0) -> FloatArray:
        """The lowest point, (p,), within the bounds in unit coordinates.

        `damping`: share of the diagonal of the Hessian that is added to it (Levenberg and Marquardt).
        """
        u = self.u.copy()
        matrix = self.hessian + damping * np.diag(np.diag(self.hessian)) if damping else self.hessian
        for _ in range(_PASSES):
            gradient = self.gradient + self.hessian @ (u - self.u)
            free = self.free(gradient, u)
            if free.all():
                step = dense.solve(self.factor if not damping else dense.factor(matrix), gradient)
                moved = u - step
            else:
                moved = u.copy()
                moved[free] -= np.linalg.solve(matrix[np.ix_(free, free)], gradient[free])
            clipped = np.clip(moved, self.problem.low, self.problem.high)
            done = bool(np.array_equal(clipped, moved))
            u = clipped
            if done:
                break
        return u

    def objective_at(self, u: FloatArray) -> float:
        """−log posterior at `u`, (p,), to second order about the point of linearisation."""
        step = u - self.u
        return self.objective + float(self.gradient @ step) + 0.5 * float(step @ self.hessian @ step)

    def marginal_at(self, u: FloatArray) -> float:
        """−log Laplace marginal of the sizes: what their restricted likelihood makes small."""
        return self.objective_at(u) + 0.5 * self.log_det

    def updated_sizes(self, u: FloatArray) -> Sizes:
        """One step of the restricted-likelihood update of the sizes, for the residuals at `u`, (p,)."""
        scatters = self.problem.model.scatters
        groups = self.problem.experiment.groups
        scatter = np.zeros((2, len(scatters)))
        group = np.zeros((2, len(groups)))
        root = dense.inverse_factor(self.factor).T
        for i, (line, covariance, white) in enumerate(
            zip(self.lines, self.covariances, self.white, strict=True)
        ):
            columns, weight = self.problem.columns(i), self.problem.runs[i].features.independent_fraction
            rest = white[:, -1] - white[:, :-1] @ (u - self.u)[columns]
            spread = math.sqrt(weight) * (white[:, :-1] @ root[columns])
            square = weight * covariance.back(rest) ** 2
            trace = weight * (covariance.inverse_diagonal() - np.sum(covariance.back(spread) ** 2, axis=1))
            variance = groups.variance[i]
            for total, per_feature in zip(group, (square, trace), strict=True):
                total += np.bincount(groups.index[i], per_feature * variance, len(groups))
            for k, s in enumerate(scatters):
                loading = line.prediction.loadings.get(s.name)
                if loading is None:
                    continue
                if loading.ndim == 1:
                    scatter[:, k] += float(square @ loading**2), float(trace @ loading**2)
                else:
                    turned = covariance.whiten(loading)
                    scatter[0, k] += weight * float(np.sum((turned.T @ rest) ** 2))
                    scatter[1, k] += weight * float(np.sum(turned**2) - np.sum((spread.T @ turned) ** 2))
        return self.sizes.updated(scatters, (scatter[0], group[0]), (scatter[1], group[1]))

    def under(self, sizes: Sizes) -> Linear:
        """The same linearisation in the metric of other sizes."""
        return Linear(self.problem, self.u, self.lines, sizes, self._stacked)


def not_pressed(u: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> Mask:
    """Unknowns that a gradient does not press against a bound; all of shape (p,)."""
    return np.asarray(~(((u <= low) & (gradient > 0)) | ((u >= high) & (gradient < 0))))


def relaxed(linear: Linear, rounds: int) -> tuple[Linear, FloatArray]:
    """Alternate the lowest point and the sizes; the linearisation at the last sizes and its lowest point.

    Ends early once no size of a discrepancy that counts moves by more than `_SETTLED`.
    """
    u = linear.solution()
    for _ in range(rounds):
        sizes = linear.updated_sizes(u)
        before, after = linear.sizes.discrepancy, sizes.discrepancy
        moved = np.abs(after - before) / (0.1 + before)
        changes = np.append(moved, np.abs(sizes.log_scatter - linear.sizes.log_scatter))
        steady = np.all(changes < _SETTLED)
        linear = linear.under(sizes)
        u = linear.solution()
        if steady:
            break
    return linear, u
