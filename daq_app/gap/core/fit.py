"""Fitting one hypothesis: bounded Levenberg–Marquardt within a search for the scatter sizes.

Given the scatter sizes the features are Gaussian, so the inner step is least squares on whitened
residuals with the priors as further rows. The sizes themselves maximise the Laplace marginal
likelihood (restricted maximum likelihood: the unknowns are integrated out, not profiled).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import log_ndtr, ndtr

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.likelihood import Covariance, log_density
from daq_app.gap.core.model import Model
from daq_app.gap.core.problem import Linearised, Problem

SCATTER_STEP = 0.05
"""Step of the differences in the logarithm of a scatter size."""
_MAX_STARTS = 6
Frozen = dict[tuple[str, int | None], FloatArray]
_TOLERANCE = 1e-3
"""A change of the log posterior below this ends a search."""


@dataclass(slots=True)
class Fit:
    """The fit of one hypothesis. Unit coordinates are those of `Problem`; arrays follow `keys`."""

    effects: tuple[str, ...]
    keys: tuple[tuple[str, int | None], ...]
    u: FloatArray
    covariance: FloatArray
    sigmas: dict[str, float]
    log_likelihood: float
    log_evidence: float
    whitened: tuple[FloatArray, ...]
    """Residual of each run, whitened by the Cholesky factor of C: standard normal when all is well."""
    residuals: tuple[FloatArray, ...]
    scales: tuple[FloatArray, ...]
    """√diag C of each run: what one feature alone scatters by."""
    starts: int = 1
    starts_agreeing: int = 1
    converged: bool = True
    values: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Shared parameters: (value, low, high) of the 95 % interval."""
    local_values: tuple[dict[str, tuple[float, float, float]], ...] = ()

    @property
    def name(self) -> str:
        return " + ".join(self.effects) or "nothing missing"

    def known(self) -> dict[tuple[str, int | None], float]:
        """Unit coordinates by (key, run), to start another fit from."""
        return dict(zip(self.keys, (float(v) for v in self.u), strict=True))

    def strength(self, effect: str) -> float:
        """How many posterior sd the effect's parameters are from zero (Mahalanobis distance / √k)."""
        index = [i for i, (key, _) in enumerate(self.keys) if key.startswith(effect + ".")]
        block = self.covariance[np.ix_(index, index)]
        u = self.u[index]
        return math.sqrt(max(float(u @ np.linalg.solve(block, u)), 0.0) / max(len(index), 1))


class _Search:
    """State of one search from one start."""

    def __init__(self, problem: Problem, u: FloatArray, log_sigma: FloatArray) -> None:
        self.problem = problem
        self.scatters = problem.model.scatters
        self.u = u
        self.log_sigma = log_sigma
        self.weights = [run.features.independent_fraction for run in problem.runs]
        self.predictions = [problem.predict(i, u) for i in range(len(problem.runs))]
        self.lines: list[Linearised] = []
        self.damping = 1e-3
        self.frozen: Frozen | None = None
        self.objective = self._objective(u, log_sigma)

    def sigmas(self, log_sigma: FloatArray) -> dict[str, float]:
        return {s.name: math.exp(float(v)) for s, v in zip(self.scatters, log_sigma, strict=True)}

    def scatter_prior(self, log_sigma: FloatArray) -> float:
        terms = (
            ((v - math.log(s.median)) / s.log_sd) ** 2 for s, v in zip(self.scatters, log_sigma, strict=True)
        )
        return 0.5 * float(sum(terms))

    def _objective(self, u: FloatArray, log_sigma: FloatArray) -> float:
        """−log posterior at the current predictions."""
        sigmas = self.sigmas(log_sigma)
        total = 0.5 * float(u @ u) + self.scatter_prior(log_sigma)
        for run, prediction, weight in zip(self.problem.runs, self.predictions, self.weights, strict=True):
            covariance = Covariance(run.features.sd, prediction, sigmas)
            total -= weight * log_density(run.features.values - prediction.features, covariance)
        return total if math.isfinite(total) else math.inf

    def linearise(self) -> None:
        self.lines = [
            self.problem.linearise(i, self.u, prediction, self.frozen)
            for i, prediction in enumerate(self.predictions)
        ]

    def normal_equations(self, log_sigma: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Hessian (with priors), gradient of −log posterior, and log likelihood of the linearisation."""
        sigmas = self.sigmas(log_sigma)
        p = len(self.problem)
        hessian, gradient, log_like = np.eye(p), self.u.copy(), 0.0
        for i, (line, run, weight) in enumerate(
            zip(self.lines, self.problem.runs, self.weights, strict=True)
        ):
            covariance = Covariance(run.features.sd, line.prediction, sigmas)
            columns = self.problem.columns(i)
            gram = covariance.gram(np.column_stack([line.jacobian[:, columns], line.residual]))
            hessian[np.ix_(columns, columns)] += weight * gram[:-1, :-1]
            gradient[columns] -= weight * gram[:-1, -1]
            n = line.residual.size
            log_like -= 0.5 * weight * (gram[-1, -1] + covariance.log_det + n * math.log(2 * math.pi))
        return hessian, gradient, float(log_like)

    def step(self) -> float:
        """One accepted Levenberg–Marquardt step; returns the gain (0 when none was found)."""
        self.linearise()
        hessian, gradient, _ = self.normal_equations(self.log_sigma)
        low, high = self.problem.low, self.problem.high
        free = ~(((self.u <= low) & (gradient > 0)) | ((self.u >= high) & (gradient < 0)))
        if not free.any():
            return 0.0
        before = self.objective
        for _ in range(8):
            damped = hessian + self.damping * np.diag(np.diag(hessian))
            delta = np.zeros_like(self.u)
            delta[free] = -np.linalg.solve(damped[np.ix_(free, free)], gradient[free])
            trial = np.clip(self.u + delta, low, high)
            kept = self.predictions
            self.predictions = [self.problem.predict(i, trial) for i in range(len(self.problem.runs))]
            objective = self._objective(trial, self.log_sigma)
            if math.isfinite(objective) and objective < before:
                self.u, self.objective = trial, objective
                # Down to nothing: any damping left would leave a stiff direction short of its optimum.
                self.damping = 0.0 if self.damping < 1e-7 else self.damping / 10
                return before - objective
            self.predictions = kept
            self.damping = max(self.damping * 10, 1e-6)
        return 0.0

    def marginal(self, log_sigma: FloatArray) -> float:
        """−log Laplace marginal of the scatter sizes at the current linearisation."""
        hessian, _, log_like = self.normal_equations(log_sigma)
        sign, log_det = np.linalg.slogdet(hessian)
        if sign <= 0:
            return math.inf
        return -log_like + 0.5 * float(self.u @ self.u) + 0.5 * float(log_det) + self.scatter_prior(log_sigma)

    def update_scatter(self) -> None:
        """A few damped Newton steps in the logarithms, each coordinate with its own curvature.

        The sizes hardly interact (each has its own features), so the diagonal of the curvature is enough.
        """
        here = self.marginal(self.log_sigma)
        for _ in range(4 if self.scatters else 0):
            slope, curvature = self.scatter_slopes(here)
            move = np.where(curvature > 0.05, -slope / np.maximum(curvature, 0.05), -np.sign(slope))
            trial = np.clip(self.log_sigma + np.clip(move, -1.0, 1.0), *self._scatter_bounds())
            value = self.marginal(trial)
            if value > here:
                trial = 0.5 * (trial + self.log_sigma)
                value = self.marginal(trial)
            moved = float(np.abs(trial - self.log_sigma).max())
            if value > here:
                break
            self.log_sigma, here = trial, value
            if moved < 0.02:
                break
        self.objective = self._objective(self.u, self.log_sigma)

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

    def run(self, rounds: int, steps: int) -> bool:
        """Alternate steps and scatter updates; True when neither changes anything any more."""
        for _ in range(rounds):
            gained = 0.0
            for _ in range(steps):
                gain = self.step()
                gained += gain
                if gain < _TOLERANCE:
                    break
            before = self.log_sigma.copy()
            self.update_scatter()
            if gained < _TOLERANCE and np.all(np.abs(self.log_sigma - before) < 0.01):
                return True
        return False


def fit(
    model: Model,
    runs: Sequence[Run],
    effects: Sequence[Effect] = (),
    known: Mapping[tuple[str, int | None], float] | None = None,
    sigmas: Mapping[str, float] | None = None,
    multistart: bool = True,
    frozen: Frozen | None = None,
    polish: bool = True,
) -> Fit:
    """Fit a hypothesis to runs.

    `frozen` are columns of the Jacobian from the fit without the effect (`frozen_columns`): the
    search uses them until its last steps. Without `polish` even those use them, which is good enough
    to see that a hypothesis has no chance.

    `known` are unit coordinates to start from (usually the fit without the effect), `sigmas` the
    scatter sizes to start from. With `multistart` the effect's parameters are started from zero and
    from each of their declared starts; the two best are followed to convergence.
    """
    problem = Problem(model, runs, effects)
    base = problem.start(known or {})
    start_sigma = np.array([math.log((sigmas or {}).get(s.name, s.median)) for s in model.scatters])
    starts = _starts(problem, base) if multistart and effects else [base]
    searches = [_Search(problem, u, start_sigma.copy()) for u in starts]
    # A start may lie where the model diverges; it is dropped as long as another one does not.
    searches = [s for s in searches if math.isfinite(s.objective)] or searches[:1]
    for search in searches:
        search.frozen = frozen
        if len(searches) > 1:
            search.run(rounds=1, steps=3 if frozen else 2)
    searches.sort(key=lambda s: s.objective)
    leaders = searches[:2]
    if frozen:
        for search in leaders:
            search.run(rounds=3, steps=5)
        searches.sort(key=lambda s: s.objective)
        leaders = searches[:1]
    converged = []
    for search in leaders:
        if polish:
            search.frozen = None
        converged.append(search.run(rounds=6, steps=6))
    finals = [s.objective for s in leaders] + [s.objective for s in searches[len(leaders) :]]
    best = int(np.argmin(finals[: len(leaders)]))
    agreeing = sum(1 for value in finals if value - finals[best] < 0.5)
    return _finish(leaders[best], converged[best], len(searches), agreeing)


def frozen_columns(model: Model, runs: Sequence[Run], found: Fit, effects: Sequence[Effect] = ()) -> Frozen:
    """Columns of the Jacobian at a fit, by (key, run index)."""
    problem = Problem(model, runs, effects)
    columns: Frozen = {}
    for i in range(len(problem.runs)):
        line = problem.linearise(i, found.u)
        for k in problem.columns(i):
            columns[(problem.unknowns[k].key, i)] = line.jacobian[:, k]
    return columns


def _starts(problem: Problem, base: FloatArray) -> list[FloatArray]:
    """Starting vectors over the effects' parameters, at most `_MAX_STARTS` besides zero."""
    own = [k for k, q in enumerate(problem.unknowns) if q.effect and q.run is None]
    per_run = [k for k, q in enumerate(problem.unknowns) if q.effect and q.run is not None]
    choices = [problem.unknowns[k].parameter.start_coordinates() for k in own]
    combinations = list(itertools.islice(itertools.product(*choices), 0, 64)) if own else [()]
    if len(combinations) > _MAX_STARTS:
        pick = np.linspace(0, len(combinations) - 1, _MAX_STARTS).round().astype(int)
        combinations = [combinations[i] for i in pick]
    starts = [base]
    for combination in combinations:
        u = base.copy()
        u[own] = combination
        for k in per_run:
            u[k] = problem.unknowns[k].parameter.start_coordinates()[0]
        starts.append(np.clip(u, problem.low, problem.high))
    return starts


def _finish(search: _Search, converged: bool, starts: int, agreeing: int) -> Fit:
    """Evidence, covariance and residuals at the end of a search."""
    problem = search.problem
    search.linearise()
    hessian, gradient, log_like = search.normal_equations(search.log_sigma)
    covariance: FloatArray = np.linalg.inv(hessian).astype(np.float64)
    _, log_det = np.linalg.slogdet(hessian)
    evidence = log_like - 0.5 * float(search.u @ search.u) - 0.5 * float(log_det)
    evidence += math.fsum(_bound_correction(problem, search.u, gradient, covariance))
    evidence += _scatter_evidence(search)
    sigmas = search.sigmas(search.log_sigma)
    whitened, scales = [], []
    for line, run in zip(search.lines, problem.runs, strict=True):
        c = Covariance(run.features.sd, line.prediction, sigmas)
        whitened.append(c.whiten(line.residual))
        scales.append(c.marginal_sd)
    sd = np.sqrt(np.diag(covariance))
    shared: dict[str, tuple[float, float, float]] = {}
    local: list[dict[str, tuple[float, float, float]]] = [{} for _ in problem.runs]
    for k, unknown in enumerate(problem.unknowns):
        target = shared if unknown.run is None else local[unknown.run]
        u = float(search.u[k])
        target[unknown.key] = (unknown.parameter.value(u), *unknown.parameter.interval(u, float(sd[k])))
    return Fit(
        effects=tuple(e.name for e in problem.effects),
        keys=tuple((q.key, q.run) for q in problem.unknowns),
        u=search.u,
        covariance=covariance,
        sigmas=sigmas,
        log_likelihood=log_like,
        log_evidence=evidence,
        whitened=tuple(whitened),
        residuals=tuple(line.residual for line in search.lines),
        scales=tuple(scales),
        starts=starts,
        starts_agreeing=agreeing,
        converged=converged,
        values=shared,
        local_values=tuple(local),
    )


def _bound_correction(
    problem: Problem, u: FloatArray, gradient: FloatArray, covariance: FloatArray
) -> list[float]:
    """ln of the posterior mass inside the bounds over the prior mass inside them, per bounded unknown.

    At a bound the gradient does not vanish; the Gaussian is then that of the Newton step beyond it.
    """
    corrections = []
    for k in np.flatnonzero(np.isfinite(problem.low) | np.isfinite(problem.high)):
        sd = math.sqrt(covariance[k, k])
        slope = float(gradient[k]) if u[k] <= problem.low[k] or u[k] >= problem.high[k] else 0.0
        centre = u[k] - slope * sd**2
        inside = _log_mass((problem.low[k] - centre) / sd, (problem.high[k] - centre) / sd)
        prior = math.log(max(float(ndtr(problem.high[k]) - ndtr(problem.low[k])), 1e-300))
        corrections.append(0.5 * (slope * sd) ** 2 + inside - prior)
    return corrections


def _log_mass(low: float, high: float) -> float:
    """ln(Φ(high) − Φ(low)) without cancellation in the tails."""
    if low > 0:
        low, high = -high, -low
    upper, lower = float(log_ndtr(high)), float(log_ndtr(low))
    return upper + math.log1p(-math.exp(min(lower - upper, -1e-12)))


def _scatter_evidence(search: _Search) -> float:
    """Laplace term of the scatter sizes: prior at the mode and the width of their posterior."""
    total = -search.scatter_prior(search.log_sigma)
    _, curvature = search.scatter_slopes(search.marginal(search.log_sigma))
    for scatter, bend in zip(search.scatters, curvature, strict=True):
        total -= 0.5 * math.log(max(float(bend), 1e-2)) + math.log(scatter.log_sd)
    return total


def effects_of(names: Sequence[str], library: Mapping[str, Effect]) -> tuple[Effect, ...]:
    """Effects by name."""
    return tuple(library[name] for name in names)
