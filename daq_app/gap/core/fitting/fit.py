"""Fitting one hypothesis, and what the fit says: values, evidence, residuals."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import log_ndtr
from scipy.stats import chi2

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.likelihood import Sizes
from daq_app.gap.core.fitting.linear import Linear
from daq_app.gap.core.fitting.problem import Columns, Problem
from daq_app.gap.core.fitting.search import Search
from daq_app.gap.core.model import Model

Known = Mapping[tuple[str, int | None], float]
"""Unit coordinates by (key, run)."""
MAX_STARTS = 6
_POLISH_ROUNDS = 6
_LOOSE = 0.1
"""Tolerance, in log posterior, of a search that is not polished."""


@dataclass(slots=True)
class Fit:
    """The fit of one hypothesis. Unit coordinates are those of `Problem`; arrays follow `keys`."""

    effects: tuple[str, ...]
    keys: tuple[tuple[str, int | None], ...]
    u: FloatArray
    covariance: FloatArray
    sizes: Sizes
    sigmas: dict[str, float]
    log_likelihood: float
    log_evidence: float
    residuals: tuple[FloatArray, ...]
    converged: bool = True
    columns: Columns = field(default_factory=dict, repr=False)
    """Jacobian at the end, where it was worked out exactly."""
    values: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Shared parameters: (value, low, high) of the 95 % interval."""
    local_values: tuple[dict[str, tuple[float, float, float]], ...] = ()

    def known(self) -> dict[tuple[str, int | None], float]:
        """Unit coordinates by (key, run), to start another fit from."""
        return dict(zip(self.keys, (float(v) for v in self.u), strict=True))

    def linear(self, problem: Problem) -> Linear:
        """The linearisation of its hypothesis, `problem`, at its end."""
        lines = [problem.linearise(i, self.u, known=self.columns) for i in range(len(problem.runs))]
        return Linear(problem, self.u, lines, self.sizes)

    def misfit_nats(self, experiment: Experiment, sizes: Sizes) -> FloatArray:
        """What the fit leaves, as half a sum of squares, shape (group + 1,).

        First the residuals of each group of features over their nominal variance and the discrepancy in
        `sizes`; last, how far the unknowns that belong to no effect are strained.
        """
        groups = experiment.groups
        square = np.zeros(len(groups))
        for run, index, variance, residual in zip(
            experiment.runs, groups.index, groups.variance, self.residuals, strict=True
        ):
            weight = run.features.independent_fraction
            square += weight * np.bincount(index, residual**2 / variance, len(groups))
        own = np.array(["." not in key for key, _ in self.keys])
        return 0.5 * np.append(square / (1.0 + sizes.discrepancy), np.sum(self.u[own] ** 2))

    def strength(self, effect: str, only: Collection[str] = ()) -> float:
        """How many posterior sd the effect is from none; `only` restricts it to parameters by key."""
        own = {key for key, _ in self.keys if key.startswith(effect + ".")}
        return self.distance(own.intersection(only) if only else own)

    def distance(self, unknowns: Collection[str]) -> float:
        """How many posterior sd the unknowns of these keys are from the centres of their priors.

        For several, or one in every run, this is the number of sd at which a single one would be as unlikely
        by chance as their Mahalanobis distance is.
        """
        index = [i for i, (key, _) in enumerate(self.keys) if key in unknowns]
        block = self.covariance[np.ix_(index, index)]
        u = self.u[index]
        square = max(float(u @ np.linalg.solve(block, u)), 0.0)
        if len(index) == 1:
            return math.sqrt(square)
        chance = float(chi2.sf(square, len(index)))
        # So far out that the chance is no longer a number, the distance itself is right to a per cent.
        return math.sqrt(float(chi2.isf(chance, 1)) if chance > 0.0 else square)


def fit(
    model: Model,
    runs: Sequence[Run],
    effects: Sequence[Effect] = (),
    known: Known | None = None,
) -> Fit:
    """Fit a hypothesis to runs to the end, from every start of the effects' parameters.

    `known` are unit coordinates to start from (usually those of the fit without the effect).
    """
    experiment = Experiment.of(model, runs)
    problem = Problem(experiment, effects)
    base = problem.start(known or {})
    sizes = Sizes.nominal(experiment)
    searches = [Search(problem, u, sizes) for u in starts(problem, base, known or {})]
    # A start may lie where the model diverges; it is dropped as long as another one does not.
    searches = [s for s in searches if math.isfinite(s.objective)] or searches[:1]
    for search in searches:
        search.run(6, 4, _LOOSE)
    best = min(searches, key=lambda search: search.objective)
    return finish(best, polished(best), exact=True)


def fitted(
    experiment: Experiment,
    effects: Sequence[Effect],
    known: Known,
    sizes: Sizes,
    columns: Columns,
    polish: bool,
) -> Fit:
    """Go on with a fit from where another one ended.

    `columns` of the Jacobian are taken as they are until the last steps. Without `polish` even those use
    them, which is good enough to rank hypotheses.
    """
    problem = Problem(experiment, effects)
    search = Search(problem, problem.start(known), sizes, columns)
    if not math.isfinite(search.objective):
        # A linear step may end where the model diverges: there is nothing of the effects to begin with.
        of_effects = {(q.key, q.run) for q in problem.unknowns if q.effect}
        search = Search(
            problem, problem.start({k: u for k, u in known.items() if k not in of_effects}), sizes, columns
        )
    converged = search.run(4, 4, _LOOSE)
    if polish:
        converged = polished(search)
    return finish(search, converged, exact=polish)


def polished(search: Search) -> bool:
    """Follow a search to its end: fresh columns, many steps with these, until fresh ones gain nothing."""
    names = {q.key for q in search.problem.unknowns if q.parameter.linear}
    linear = {key: column for key, column in search.known.items() if key[0] in names}
    for _ in range(_POLISH_ROUNDS):
        search.use(dict(linear))
        arrived = search.step() < _LOOSE
        search.use(search.problem.columns_of(search.linear.lines))
        if search.run(3, 4) and arrived:
            return True
    return False


def starts(problem: Problem, base: FloatArray, known: Known) -> list[FloatArray]:
    """Starting vectors over the effects' unknown parameters, at most `MAX_STARTS` besides zero."""
    new = [k for k, q in enumerate(problem.unknowns) if q.effect and (q.key, q.run) not in known]
    common = [k for k in new if problem.unknowns[k].run is None]
    per_run = [k for k in new if problem.unknowns[k].run is not None]
    choices = [problem.unknowns[k].parameter.start_coordinates() for k in common]
    combinations = list(itertools.islice(itertools.product(*choices), 0, 64)) if common else [()]
    if len(combinations) > MAX_STARTS:
        pick = np.linspace(0, len(combinations) - 1, MAX_STARTS).round().astype(int)
        combinations = [combinations[i] for i in pick]
    vectors = [base]
    for combination in combinations:
        u = base.copy()
        u[common] = combination
        for k in per_run:
            u[k] = problem.unknowns[k].parameter.start_coordinates()[0]
        u = np.clip(u, problem.low, problem.high)
        if not any(np.array_equal(u, other) for other in vectors):
            vectors.append(u)
    return vectors


def finish(search: Search, converged: bool, exact: bool) -> Fit:
    """Evidence, covariance and residuals at the end of a search."""
    if exact:
        search.linearise(exact)
    problem, linear = search.problem, search.linear
    covariance = linear.covariance
    # No constant of the sizes' own posterior is added: it is nearly the same under every hypothesis.
    evidence = -linear.marginal_at(linear.u) + bound_corrections(linear, covariance)
    evidence = evidence if math.isfinite(evidence) else -math.inf
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
        sizes=search.sizes,
        sigmas=search.sizes.scatter(problem.model.scatters),
        log_likelihood=linear.log_likelihood,
        log_evidence=evidence,
        residuals=tuple(line.residual for line in linear.lines),
        converged=converged,
        columns=problem.columns_of(linear.lines) if exact else {},
        values=shared,
        local_values=tuple(local),
    )


def bound_corrections(linear: Linear, covariance: FloatArray) -> float:
    """ln of the posterior mass inside the bounds over the prior mass inside them, summed over the unknowns.

    A strength that is too weak to be an effect (`Parameter.smallest`) is outside. Pressed against a bound the
    gradient does not vanish; the Gaussian is then that of the Newton step beyond it. A fit that ended at no
    number has no mass: NaN.
    """
    problem, u, gradient = linear.problem, linear.u, linear.gradient
    if not np.isfinite(covariance).all():
        return math.nan
    free = linear.free(gradient, u)
    corrections = []
    for k in np.flatnonzero(np.isfinite(problem.low) | np.isfinite(problem.high)):
        parameter = problem.unknowns[k].parameter
        sd = math.sqrt(covariance[k, k])
        slope = 0.0 if free[k] else float(gradient[k])
        least = parameter.smallest / parameter.sd
        pieces = [(max(problem.low[k], least) if least else problem.low[k], problem.high[k])]
        if least and problem.low[k] < -least:
            pieces.append((problem.low[k], -least))
        corrections.append(_in_pieces(pieces, float(u[k]) - slope * sd**2, sd) + 0.5 * (slope * sd) ** 2)
    return math.fsum(corrections)


def _in_pieces(pieces: Sequence[tuple[float, float]], centre: float, sd: float) -> float:
    """ln of the posterior mass over the prior mass in intervals of a unit coordinate."""
    inside = [_log_mass((low - centre) / sd, (high - centre) / sd) for low, high in pieces]
    prior = [_log_mass(low, high) for low, high in pieces]
    return float(np.logaddexp.reduce(inside) - np.logaddexp.reduce(prior))


def _log_mass(low: float, high: float) -> float:
    """ln(Φ(high) − Φ(low)) without cancellation in the tails."""
    if low > 0:
        low, high = -high, -low
    upper, lower = float(log_ndtr(high)), float(log_ndtr(low))
    return upper + math.log1p(-math.exp(min(lower - upper, -1e-12)))


def effects_of(names: Sequence[str], library: Mapping[str, Effect]) -> tuple[Effect, ...]:
    """Effects by name."""
    return tuple(library[name] for name in names)
