"""One search for the best parameters of a hypothesis: Levenberg–Marquardt within a search for the scatter.

Given the scatter sizes the features are Gaussian, so the inner step is least squares in the metric of C
with the priors as further rows. The sizes themselves maximise the Laplace marginal likelihood (restricted
maximum likelihood: the unknowns are integrated out, not profiled).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.metric import Metric, metric_of
from daq_app.gap.core.model import Prediction
from daq_app.gap.core.problem import Columns, Linearised, Problem

SCATTER_STEP = 0.05
"""Step of the differences in the logarithm of a scatter size."""
TOLERANCE = 1e-3
"""A change of the log posterior below this ends a search."""
FLAT = 1.0 - 1e-4
"""Share of the information of a prior that is taken away where data alone have to speak."""
_LOG_2PI = math.log(2 * math.pi)


class Search:
    """State of one search from one start.

    `known` are columns of the Jacobian that are taken as they are (those of linear parameters, or all of
    the fit without the effect while the search is far from its end); the others are differences.
    """

    def __init__(
        self, problem: Problem, u: FloatArray, log_sigma: FloatArray, known: Columns | None = None
    ) -> None:
        self.problem = problem
        self.scatters = problem.model.scatters
        self.u = u
        self.log_sigma = log_sigma
        self.known = known or {}
        self.weights = [run.features.independent_fraction for run in problem.runs]
        self.predictions = [problem.predict(i, u) for i in range(len(problem.runs))]
        self.lines: list[Linearised] = []
        self.damping = 1e-3
        self._metrics: list[Metric | None] = [None] * len(problem.runs)
        self._prepared: list[FloatArray] = []
        self._equations: dict[bytes, tuple[FloatArray, FloatArray, float]] = {}
        """Normal equations of the last linearisation, by the scatter sizes."""
        self._moved = True
        """Whether the unknowns, or the columns to use, have changed since the last linearisation."""
        self.objective = self.value_at(u, self.predictions, log_sigma)

    def sigmas(self, log_sigma: FloatArray) -> dict[str, float]:
        return {s.name: math.exp(float(v)) for s, v in zip(self.scatters, log_sigma, strict=True)}

    def scatter_prior(self, log_sigma: FloatArray) -> float:
        terms = (
            ((v - math.log(s.median)) / s.log_sd) ** 2 for s, v in zip(self.scatters, log_sigma, strict=True)
        )
        return 0.5 * float(sum(terms))

    def _metric(self, run: int, prediction: Prediction) -> Metric:
        metric = self._metrics[run]
        if metric is None or not metric.suits(prediction):
            metric = metric_of(self.problem.runs[run].features.sd, prediction)
            self._metrics[run] = metric
        return metric

    def value_at(self, u: FloatArray, predictions: list[Prediction], log_sigma: FloatArray) -> float:
        """−log posterior; infinite where the model diverges."""
        sigmas = self.sigmas(log_sigma)
        total = 0.5 * float(u @ u) + self.scatter_prior(log_sigma)
        for i, (run, prediction) in enumerate(zip(self.problem.runs, predictions, strict=True)):
            residual = run.features.values - prediction.features
            if not np.all(np.isfinite(residual)):
                return math.inf
            metric = self._metric(i, prediction)
            gram, log_det = metric.gram(metric.prepare(residual[:, None]), prediction, sigmas)
            total += 0.5 * self.weights[i] * (float(gram[0, 0]) + log_det + residual.size * _LOG_2PI)
        return total if math.isfinite(total) else math.inf

    def linearise(self, exact: bool = False) -> None:
        """Jacobians at the point; afterwards the columns of linear parameters are known for good."""
        self.lines = [
            self.problem.linearise(i, self.u, prediction, self.known, exact)
            for i, prediction in enumerate(self.predictions)
        ]
        self.known = self.problem.columns_of(self.lines, linear_only=True) | self.known
        self._moved = False
        self._equations = {}
        self._prepared = []
        for i, line in enumerate(self.lines):
            columns = np.column_stack([line.jacobian[:, self.problem.columns(i)], line.residual])
            self._prepared.append(self._metric(i, line.prediction).prepare(columns))

    def linearise_if_moved(self) -> None:
        """The same, unless the Jacobians at hand are of this very point."""
        if self._moved:
            self.linearise()

    def use(self, known: Columns) -> None:
        """Take these columns of the Jacobian as they are from now on."""
        self.known = known
        self._moved = True

    def normal_equations(self, log_sigma: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Hessian (with priors), gradient of −log posterior, and log likelihood of the linearisation.

        A promise, the step after it and the evidence at the end ask for the same ones.
        """
        key = log_sigma.tobytes()
        found = self._equations.get(key)
        if found is None:
            found = self._equations[key] = self._summed(log_sigma)
        return found

    def _summed(self, log_sigma: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        sigmas = self.sigmas(log_sigma)
        p = len(self.problem)
        hessian, gradient, log_like = np.eye(p), self.u.copy(), 0.0
        for i, (line, prepared, weight) in enumerate(
            zip(self.lines, self._prepared, self.weights, strict=True)
        ):
            gram, log_det = self._metric(i, line.prediction).gram(prepared, line.prediction, sigmas)
            columns = self.problem.columns(i)
            hessian[np.ix_(columns, columns)] += weight * gram[:-1, :-1]
            gradient[columns] -= weight * gram[:-1, -1]
            log_like -= 0.5 * weight * (gram[-1, -1] + log_det + line.residual.size * _LOG_2PI)
        return hessian, gradient, float(log_like)

    def _free(self, gradient: FloatArray) -> NDArray[np.bool_]:
        """Unknowns that are not pressed against a bound."""
        low, high = self.problem.low, self.problem.high
        pressed = ((self.u <= low) & (gradient > 0)) | ((self.u >= high) & (gradient < 0))
        return np.asarray(~pressed)

    def promise(self, held: NDArray[np.bool_]) -> float:
        """−log posterior that one step of the unknowns that are not `held` (a mask) would lead to."""
        if not math.isfinite(self.objective):
            return math.inf
        self.linearise_if_moved()
        hessian, gradient, _ = self.normal_equations(self.log_sigma)
        free = self._free(gradient) & np.asarray(~held)
        downhill = float(gradient[free] @ np.linalg.solve(hessian[np.ix_(free, free)], gradient[free]))
        return self.objective - 0.5 * downhill

    def score(self, asked: NDArray[np.bool_], named: NDArray[np.bool_]) -> tuple[float, float, float, float]:
        """What the `asked` unknowns (a mask) gain in log posterior on top of the others by one linear step,
        and how many of them the data determine (1 − posterior over prior variance, summed). Of a single one
        also its value (0 where it would be beyond its bound) and error by the data alone, in prior sd.

        The `named` unknowns give way as far as the data let them: a prior that would rather have their effect
        weaker is no evidence for another form of it.
        """
        self.linearise_if_moved()
        hessian, gradient, _ = self.normal_equations(self.log_sigma)
        others = self._free(gradient) & ~asked
        hessian, gradient = hessian - np.diag(np.where(named, FLAT, 0.0)), gradient - FLAT * named * self.u
        both = np.linalg.solve(hessian[np.ix_(others, others)], hessian[np.ix_(others, asked)])
        own = hessian[np.ix_(asked, asked)] - hessian[np.ix_(asked, others)] @ both
        slope = np.zeros_like(gradient)
        slope[asked] = gradient[asked] - both.T @ gradient[others]
        free = self._free(slope)[asked]
        variance = np.linalg.inv(own[np.ix_(free, free)])
        left = slope[asked][free]
        gain, determined = 0.5 * float(left @ variance @ left), float(np.sum(1.0 - np.diag(variance)))
        if asked.sum() > 1:
            return gain, determined, math.nan, math.nan
        seen = max(float(own[0, 0]) - 1.0, 1e-12)  # the prior has a weight of one
        value = -float(left[0]) / seen if free.any() else 0.0
        return gain, determined, value, 1.0 / math.sqrt(seen)

    def step(self) -> float:
        """One accepted Levenberg–Marquardt step; returns the gain (0 when none was found)."""
        self.linearise_if_moved()
        hessian, gradient, _ = self.normal_equations(self.log_sigma)
        free = self._free(gradient)
        if not free.any():
            return 0.0
        before = self.objective
        for _ in range(8):
            damped = hessian + self.damping * np.diag(np.diag(hessian))
            delta = np.zeros_like(self.u)
            delta[free] = -np.linalg.solve(damped[np.ix_(free, free)], gradient[free])
            if -float(gradient @ delta) < 0.1 * TOLERANCE:
                return 0.0  # nothing left to gain that a further prediction would be worth
            trial = np.clip(self.u + delta, self.problem.low, self.problem.high)
            predictions = [self.problem.predict(i, trial) for i in range(len(self.problem.runs))]
            objective = self.value_at(trial, predictions, self.log_sigma)
            if objective < before:
                self.u, self.predictions, self.objective = trial, predictions, objective
                self._moved = True
                # Down to nothing: any damping left would leave a stiff direction short of its optimum.
                self.damping = 0.0 if self.damping < 1e-7 else self.damping / 10
                return before - objective
            self.damping = max(self.damping * 10, 1e-6)
        return 0.0

    def marginal(self, log_sigma: FloatArray) -> float:
        """−log Laplace marginal of the scatter sizes at the current linearisation."""
        hessian, _, log_like = self.normal_equations(log_sigma)
        sign, log_det = np.linalg.slogdet(hessian)
        if not sign > 0:
            return math.inf
        value = -log_like + 0.5 * float(self.u @ self.u) + 0.5 * float(log_det)
        return value + self.scatter_prior(log_sigma) if math.isfinite(value) else math.inf

    def update_scatter(self) -> None:
        """A few damped Newton steps in the logarithms, each coordinate with its own curvature.

        The sizes hardly interact (each has its own features), so the diagonal of the curvature is enough.
        """
        here = self.marginal(self.log_sigma)
        for _ in range(4 if self.scatters and math.isfinite(here) else 0):
            slope, curvature = self.scatter_slopes(here)
            move = np.where(curvature > 0.05, -slope / np.maximum(curvature, 0.05), -np.sign(slope))
            trial = np.clip(self.log_sigma + np.clip(move, -1.0, 1.0), *self._scatter_bounds())
            value = self.marginal(trial)
            if value > here:
                trial = 0.5 * (trial + self.log_sigma)
                value = self.marginal(trial)
            moved = float(np.abs(trial - self.log_sigma).max())
            if not value <= here:
                break
            self.log_sigma, here = trial, value
            if moved < 0.02:
                break
        self.objective = self.value_at(self.u, self.predictions, self.log_sigma)

    def _scatter_bounds(self) -> tuple[FloatArray, FloatArray]:
        medians = np.array([math.log(s.median) for s in self.scatters])
        reach = np.array([4 * s.log_sd for s in self.scatters])
        return medians - reach, medians + reach

    def scatter_slopes(self, here: float) -> tuple[FloatArray, FloatArray]:
        """First and second derivatives of `marginal` along each logarithm."""
        slope, curvature = np.zeros(len(self.scatters)), np.zeros(len(self.scatters))
        for k in range(len(self.scatters)):
            offset = np.zeros(len(self.scatters))
            offset[k] = SCATTER_STEP
            ahead, behind = self.marginal(self.log_sigma + offset), self.marginal(self.log_sigma - offset)
            slope[k] = (ahead - behind) / (2 * SCATTER_STEP)
            curvature[k] = (ahead - 2 * here + behind) / SCATTER_STEP**2
        return slope, curvature

    def adopt(self, log_sigma: FloatArray) -> None:
        """Go on with other scatter sizes."""
        self.log_sigma = log_sigma.copy()
        self.objective = self.value_at(self.u, self.predictions, self.log_sigma)

    def walk(self, steps: int, tolerance: float = TOLERANCE) -> float:
        """Steps at the scatter as it is, until one gains less than `tolerance`; returns the gain."""
        gained = 0.0
        for _ in range(steps):
            gain = self.step()
            gained += gain
            if gain < tolerance:
                break
        return gained

    def run(self, rounds: int, steps: int, tolerance: float = TOLERANCE) -> bool:
        """Alternate steps and scatter updates; True when neither changes anything any more."""
        for _ in range(rounds):
            gained = self.walk(steps, tolerance)
            before = self.log_sigma.copy()
            self.update_scatter()
            if gained < tolerance and np.all(np.abs(self.log_sigma - before) < 0.01):
                return True
        return False
