"""Fitting one hypothesis from several starts, and what the fit says: values, evidence, residuals."""

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
from daq_app.gap.core.likelihood import Covariance
from daq_app.gap.core.model import Model
from daq_app.gap.core.problem import Columns, Problem
from daq_app.gap.core.search import TOLERANCE, Search

_MAX_STARTS = 6
_FOLLOWED = 3
_POLISH_ROUNDS = 8
_SAME = 0.5
"""Log posterior within which two searches are at the same optimum."""
_GLANCES = 4
_LOOSE = 0.05
"""Tolerance of the search in a hypothesis that has yet to show that it is worth more."""


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
    withheld: float = 0.0
    """What the log evidence would be more by, if effects might be too weak to be any."""
    starts: int = 1
    starts_agreeing: int = 1
    converged: bool = True
    settled: bool = False
    """Of a glance: no other start promises more than the place where it ended."""
    columns: Columns = field(default_factory=dict, repr=False)
    """Jacobian at the end, where it was worked out exactly."""
    values: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Shared parameters: (value, low, high) of the 95 % interval."""
    local_values: tuple[dict[str, tuple[float, float, float]], ...] = ()

    @property
    def name(self) -> str:
        return " + ".join(self.effects) or "nothing missing"

    @property
    def objective(self) -> float:
        """−log posterior of the unknowns at the end, with the scatter sizes as they are."""
        return 0.5 * float(self.u @ self.u) - self.log_likelihood

    def known(self) -> dict[tuple[str, int | None], float]:
        """Unit coordinates by (key, run), to start another fit from."""
        return dict(zip(self.keys, (float(v) for v in self.u), strict=True))

    def strength(self, effect: str, only: Collection[str] = ()) -> float:
        """How many posterior sd the effect is from none.

        Of several parameters, or one in every run: the number of sd at which a single one would be as
        unlikely by chance as their Mahalanobis distance is. With `only`, of the parameters with these keys.
        """
        index = [
            i
            for i, (key, _) in enumerate(self.keys)
            if key.startswith(effect + ".") and (not only or key in only)
        ]
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
    known: Mapping[tuple[str, int | None], float] | None = None,
    sigmas: Mapping[str, float] | None = None,
    multistart: bool = True,
    frozen: Columns | None = None,
    polish: bool = True,
) -> Fit:
    """Fit a hypothesis to runs.

    `known` are unit coordinates to start from (usually the fit without the effect), `sigmas` the
    scatter sizes to start from. With `multistart` the effect's parameters are started from zero and
    from each of their declared starts; the three that promise most are followed.

    `frozen` are columns of the Jacobian from the fit without the effect (`Fit.columns`): the
    search uses them until its last steps. Without `polish` even those use them, which is good enough
    to see that a hypothesis has no chance.
    """
    problem = Problem(model, runs, effects)
    base = problem.start(known or {})
    start_sigma = np.array([math.log((sigmas or {}).get(s.name, s.median)) for s in model.scatters])
    starts = _starts(problem, base, known or {}) if multistart and effects else [base]
    linear = _linear(problem, frozen)
    searches = [Search(problem, u, start_sigma.copy(), frozen or linear) for u in starts]
    # A start may lie where the model diverges; it is dropped as long as another one does not.
    searches = [s for s in searches if math.isfinite(s.objective)] or searches[:1]
    followed, agreeing = _lead(searches, problem)
    best = followed[0]
    converged = _polish(best, linear) if polish else best.run(4, 4, _LOOSE)
    return _finish(best, converged, len(followed), agreeing, exact=polish)


def searches_from(
    model: Model,
    runs: Sequence[Run],
    effects: Sequence[Effect],
    known: Mapping[tuple[str, int | None], float],
    sigmas: Mapping[str, float],
    frozen: Columns,
    hint: Mapping[tuple[str, int | None], float] | None = None,
) -> list[Search]:
    """Searches from every start of the effects; with a `hint` (unit coordinates of what is not in `known`)
    from that and zero."""
    problem = Problem(model, runs, effects)
    base = problem.start(known)
    start_sigma = np.array([math.log(sigmas.get(s.name, s.median)) for s in model.scatters])
    starts = _starts(problem, base, known) if hint is None else [base]
    if hint:
        starts.append(problem.start({**hint, **known}))
    return [Search(problem, u, start_sigma.copy(), frozen) for u in starts]


def glance(searches: Sequence[Search]) -> Fit:
    """What a hypothesis is worth to within a few per cent of what it gains, for a tenth of a fit's cost.

    Every start is judged by one linear step of all unknowns; the one that promises most takes
    `_GLANCES` steps at the scatter as it was, and if it does not keep its promise the one that is best as
    it stands. `Fit.settled` says whether no other start promises more than where this ended.
    """
    nothing = np.zeros(len(searches[0].problem), dtype=bool)
    promises = [search.promise(nothing) for search in searches]
    best = searches[int(np.argmin(promises))]
    safe = min(searches, key=lambda search: search.objective)
    best.walk(_GLANCES, _LOOSE)
    if safe.objective < best.objective:
        safe.walk(_GLANCES, _LOOSE)
        best = safe
    arrived = best.promise(nothing) > best.objective - _LOOSE
    found = _finish(best, arrived, 1, 1, exact=False)
    found.settled = all(promise > best.objective - _SAME for promise in promises)
    return found


def promised(searches: Sequence[Search]) -> float:
    """The lowest −log posterior (`Fit.objective`) that one linear step from any of the starts promises.

    From the columns of a fit without one of the effects this is the score test of that effect, in which
    all other unknowns give way as far as they can. It costs a part of a glance.
    """
    nothing = np.zeros(len(searches[0].problem), dtype=bool)
    return min(search.promise(nothing) - search.scatter_prior(search.log_sigma) for search in searches)


@dataclass(frozen=True, slots=True)
class Score:
    """Score test of a form on top of a fit."""

    gain: float
    """In log posterior."""
    determined: float
    """How many coefficients of the form the runs determine besides what the fit has already."""
    coefficient: float = math.nan
    """Of a form with one coefficient: what the runs alone make of it, in its unit; NaN of others."""
    error: float = math.nan
    """Its standard deviation."""


def on_top(search: Search, form: str) -> Score:
    """What a form (an effect of the search) gains on top of the search's other effects, whose priors do not
    count here."""
    effects = np.array([unknown.effect for unknown in search.problem.unknowns])
    asked = effects == form
    gain, determined, unit, error = search.score(asked, (effects != "") & ~asked)
    alone = next(q for q in search.problem.unknowns if q.effect == form)
    return Score(gain, determined, unit * alone.parameter.sd, error * alone.parameter.sd)


def _polish(search: Search, linear: Columns) -> bool:
    """Follow a search to its end: fresh columns, many steps with these, until fresh ones gain nothing."""
    nothing = np.zeros(len(search.problem), dtype=bool)
    for _ in range(_POLISH_ROUNDS):
        search.use(dict(linear))
        arrived = search.objective - search.promise(nothing) < TOLERANCE
        sigma = search.log_sigma.copy()
        search.use(search.problem.columns_of(search.lines))
        search.run(6, 6)
        if arrived and np.all(np.abs(search.log_sigma - sigma) < 0.01):
            return True
    return False


def _linear(problem: Problem, frozen: Columns | None) -> Columns:
    """Those of the known columns that hold everywhere."""
    names = {q.key for q in problem.unknowns if q.parameter.linear}
    return {key: column for key, column in (frozen or {}).items() if key[0] in names}


def _lead(searches: list[Search], problem: Problem) -> tuple[list[Search], int]:
    """The searches that were followed, best first, and how many of them reached the same optimum.

    Where a start leads is told by one linear step in the unknowns of the model with the effect held; the
    three that promise most are followed.
    """
    if len(searches) > _FOLLOWED:
        held = np.array([bool(q.effect) for q in problem.unknowns])
        searches = sorted(searches, key=lambda search: search.promise(held))[:_FOLLOWED]
    first, *others = searches
    first.run(4, 4, _LOOSE)
    for search in others:
        # At the scatter of the first it is soon seen whether another start leads to the same place.
        search.adopt(first.log_sigma)
        search.walk(4, _LOOSE)
        if abs(search.objective - first.objective) > _SAME:
            search.run(4, 4, _LOOSE)
    searches = sorted(searches, key=lambda search: search.objective)
    best = searches[0].objective
    return searches, sum(1 for search in searches if search.objective - best < _SAME)


def _starts(
    problem: Problem, base: FloatArray, known: Mapping[tuple[str, int | None], float]
) -> list[FloatArray]:
    """Starting vectors over the effects' unknown parameters, at most `_MAX_STARTS` besides zero."""
    new = [k for k, q in enumerate(problem.unknowns) if q.effect and (q.key, q.run) not in known]
    own = [k for k in new if problem.unknowns[k].run is None]
    per_run = [k for k in new if problem.unknowns[k].run is not None]
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
        u = np.clip(u, problem.low, problem.high)
        if not any(np.array_equal(u, other) for other in starts):
            starts.append(u)
    return starts


def _finish(search: Search, converged: bool, starts: int, agreeing: int, exact: bool) -> Fit:
    """Evidence, covariance and residuals at the end of a search."""
    problem = search.problem
    if exact:
        search.linearise(exact)
    else:
        search.linearise_if_moved()
    hessian, gradient, log_like = search.normal_equations(search.log_sigma)
    covariance: FloatArray = np.linalg.inv(hessian).astype(np.float64)
    _, log_det = np.linalg.slogdet(hessian)
    evidence = log_like - 0.5 * float(search.u @ search.u) - 0.5 * float(log_det)
    any_size, real = (
        math.fsum(_bound_correction(problem, search.u, gradient, covariance, weak)) for weak in (True, False)
    )
    evidence += real + _scatter_evidence(search)
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
        withheld=any_size - real,
        whitened=tuple(whitened),
        residuals=tuple(line.residual for line in search.lines),
        scales=tuple(scales),
        starts=starts,
        starts_agreeing=agreeing,
        converged=converged,
        columns=problem.columns_of(search.lines) if exact else {},
        values=shared,
        local_values=tuple(local),
    )


def _bound_correction(
    problem: Problem, u: FloatArray, gradient: FloatArray, covariance: FloatArray, weak: bool
) -> list[float]:
    """ln of the posterior mass inside the bounds over the prior mass inside them, per bounded unknown.

    What is too weak to be an effect (`Parameter.smallest`) is inside only if `weak`.
    At a bound the gradient does not vanish; the Gaussian is then that of the Newton step beyond it.
    """
    corrections = []
    for k in np.flatnonzero(np.isfinite(problem.low) | np.isfinite(problem.high)):
        parameter = problem.unknowns[k].parameter
        sd = math.sqrt(covariance[k, k])
        slope = float(gradient[k]) if u[k] <= problem.low[k] or u[k] >= problem.high[k] else 0.0
        least = 0.0 if weak else parameter.smallest / parameter.sd
        pieces = [(max(problem.low[k], least) if least else problem.low[k], problem.high[k])]
        if least and problem.low[k] < -least:
            pieces.append((problem.low[k], -least))
        corrections.append(_in_pieces(pieces, float(u[k]) - slope * sd**2, sd) + 0.5 * (slope * sd) ** 2)
    return corrections


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


def _scatter_evidence(search: Search) -> float:
    """Laplace term of the scatter sizes: prior at the mode and the width of their posterior."""
    total = -search.scatter_prior(search.log_sigma)
    _, curvature = search.scatter_slopes(search.marginal(search.log_sigma))
    for scatter, bend in zip(search.scatters, curvature, strict=True):
        total -= 0.5 * math.log(max(float(bend), 1e-2)) + math.log(scatter.log_sd)
    return total


def effects_of(names: Sequence[str], library: Mapping[str, Effect]) -> tuple[Effect, ...]:
    """Effects by name."""
    return tuple(library[name] for name in names)
