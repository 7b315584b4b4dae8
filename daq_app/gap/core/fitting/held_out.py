"""Scores on runs that the fit has not seen: predictive density, and the gap in noise units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.fit import Fit, finish
from daq_app.gap.core.fitting.likelihood import Sizes, log_density
from daq_app.gap.core.fitting.problem import Columns, Problem
from daq_app.gap.core.fitting.search import Search
from daq_app.gap.core.model import Model, Prediction

_TRAINING_STEPS = 4
_LOCAL_STEPS = 8


@dataclass(frozen=True, slots=True)
class HeldOutRun:
    """One run predicted from the others.

    `residual`: features minus prediction after fitting the run's own parameters (release, offsets),
    shape (n,), in the features' units. `log_score`: ln of the predictive density of the features.
    """

    name: str
    level: str
    log_score: float
    residual: FloatArray
    prediction: Prediction
    strain: float = 0.0
    """Squared distance of the model's shared parameters from their priors, in prior sd, over the number of
    runs: a survey and a calibration are measurements too, and a wire scale that is 4 % off is a gap even
    where the prediction follows it."""


def folds(runs: Sequence[Run], by: str) -> list[list[int]]:
    """Groups of run indices to hold out: ``level`` (whole levels) or ``repetition`` (single runs).

    With one level only, whole levels cannot be held out, and single runs are.
    """
    if by not in ("level", "repetition"):
        raise ValueError(f"hold out by level or repetition, not {by!r}")
    levels = list(dict.fromkeys(run.level for run in runs))
    if by == "level" and len(levels) > 1:
        return [[i for i, run in enumerate(runs) if run.level == level] for level in levels]
    return [[i] for i in range(len(runs))]


def score(
    experiment: Experiment,
    effects: Sequence[Effect],
    whole: Fit,
    by: str = "level",
    columns: Columns | None = None,
) -> list[HeldOutRun]:
    """Predict every run from a fit to the runs outside its fold.

    `whole` is the fit to all runs, from which the refits start and whose sizes they keep; `columns` of its
    Jacobian save work. With a single run there is nothing to learn from, and the list is empty.
    """
    runs = experiment.runs
    if len(runs) < 2:
        return []
    results: list[HeldOutRun] = []
    for fold in folds(runs, by):
        kept = [i for i in range(len(runs)) if i not in fold]
        start, theirs = _renumber(whole, columns or {}, kept)
        problem = Problem(experiment.only(kept), effects)
        search = Search(problem, problem.start(start), whole.sizes, theirs)
        search.walk(_TRAINING_STEPS)
        trained = finish(search, True, exact=False)
        strain = strain_of(experiment.model, trained) / len(runs)
        for i in fold:
            of_run: Columns = {
                (key, 0): column for (key, index), column in (columns or {}).items() if index == i
            }
            results.append(_predict(experiment.only([i]), effects, trained, of_run, strain))
    return results


def strain_of(model: Model, trained: Fit) -> float:
    """Squared distance from the priors of those parameters that are the model's own, beyond chance."""
    names = {p.name for p in model.nuisance}
    square = math.fsum(
        float(u) ** 2
        for (key, run), u in zip(trained.keys, trained.u, strict=True)
        if run is None and key in names
    )
    return max(square - len(names), 0.0)


def _renumber(
    whole: Fit, columns: Columns, kept: Sequence[int]
) -> tuple[dict[tuple[str, int | None], float], Columns]:
    """The whole fit's coordinates and columns with the indices that the kept runs have among themselves."""
    place: dict[int | None, int | None] = {None: None}
    place |= {old: new for new, old in enumerate(kept)}
    known = {(key, place[run]): value for (key, run), value in whole.known().items() if run in place}
    theirs = {(key, place[run]): column for (key, run), column in columns.items() if run in place}
    return known, theirs


def _predict(
    experiment: Experiment, effects: Sequence[Effect], trained: Fit, columns: Columns, strain: float
) -> HeldOutRun:
    """One run predicted with everything shared as it was trained, its own parameters fitted."""
    problem, (run,) = Problem(experiment, effects), experiment.runs
    shared = [k for k, q in enumerate(problem.unknowns) if q.run is None]
    local = [k for k, q in enumerate(problem.unknowns) if q.run is not None]
    order = {key: k for k, (key, index) in enumerate(trained.keys) if index is None}
    pick = [order[problem.unknowns[k].key] for k in shared]
    u = problem.start({(key, None): trained.u[k] for key, k in order.items()})
    line = problem.linearise(0, u, known=columns)
    for _ in range(_LOCAL_STEPS if local else 0):
        covariance = trained.sizes.covariance(experiment, 0, line.prediction)
        white = covariance.whiten(np.column_stack([line.jacobian[:, local], line.residual]))
        hessian = white[:, :-1].T @ white[:, :-1] + np.eye(len(local))
        step = np.linalg.solve(hessian, white[:, :-1].T @ white[:, -1] - u[local])
        u[local] = np.clip(u[local] + step, problem.low[local], problem.high[local])
        line = problem.linearise(0, u, known=columns)
        if float(np.abs(step).max()) < 1e-2:
            break
    # Predictive covariance: scatter and noise, what training left open, and the run's own prior.
    spread = np.linalg.cholesky(trained.covariance[np.ix_(pick, pick)] + 1e-14 * np.eye(len(pick)))
    open_columns = np.hstack([line.jacobian[:, shared] @ spread, line.jacobian[:, local]])
    fixed = line.prediction.fixed_loadings
    loadings = open_columns if fixed is None else np.hstack([fixed, open_columns])
    widened = Prediction(line.prediction.features, line.prediction.loadings, loadings)
    from_prior = line.residual + line.jacobian[:, local] @ u[local]
    density = log_density(from_prior, trained.sizes.covariance(experiment, 0, widened))
    weight = run.features.independent_fraction
    return HeldOutRun(run.name, run.level, weight * density, line.residual, line.prediction, strain)


@dataclass(frozen=True, slots=True)
class GapSize:
    """How far the gap shrank on held-out runs, in units of noise, scatter and discrepancy (floor about 1)."""

    before: float
    after: float
    floor: float
    closure: float
    before_interval: tuple[float, float]
    after_interval: tuple[float, float]
    score_gained: float
    per_level: dict[str, tuple[float, float]]
    """Level → (before, after)."""
    per_observable: dict[str, tuple[float, float, str]]
    """Observable → (before, after, unit): plain rms in the observable's own unit."""


def gap_size(
    experiment: Experiment, before: Sequence[HeldOutRun], after: Sequence[HeldOutRun], yardstick: Sizes
) -> GapSize | None:
    """Compare two sets of held-out predictions on one yardstick: C at the sizes given.

    Closure is the share of the reachable held-out log score that was gained; the reachable score
    is that of a residual as large as C says, −½(n + ln|C| + n ln 2π) per run.
    """
    if not before or not after:
        return None
    place = {run.name: i for i, run in enumerate(experiment.runs)}
    rms: dict[str, list[tuple[float, float]]] = {}
    gained = reachable = 0.0
    sums: dict[str, list[float]] = {}
    units: dict[str, str] = {}
    for old, new in zip(before, after, strict=True):
        measured = experiment.runs[place[old.name]].features
        covariance = yardstick.covariance(experiment, place[old.name], new.prediction)
        n, weight = len(measured), measured.independent_fraction
        squares = [float(np.sum(covariance.whiten(run.residual) ** 2)) + run.strain for run in (old, new)]
        rms.setdefault(old.level, []).append((math.sqrt(squares[0] / n), math.sqrt(squares[1] / n)))
        gained += weight * (squares[0] - squares[1])
        reachable += weight * (squares[0] - n)
        for label, a, b in zip(measured.labels, old.residual, new.residual, strict=True):
            entry = sums.setdefault(label.observable, [0.0, 0.0, 0.0])
            entry[0] += a * a
            entry[1] += b * b
            entry[2] += 1
            units[label.observable] = label.unit
    flat = [pair for pairs in rms.values() for pair in pairs]
    closure = gained / reachable if reachable > 0 else 1.0
    return GapSize(
        before=_rms([a for a, _ in flat]),
        after=_rms([b for _, b in flat]),
        floor=1.0,
        closure=min(closure, 1.0),
        before_interval=_interval([a for a, _ in flat]),
        after_interval=_interval([b for _, b in flat]),
        score_gained=sum(r.log_score for r in after) - sum(r.log_score for r in before),
        per_level={k: (_rms([a for a, _ in v]), _rms([b for _, b in v])) for k, v in rms.items()},
        per_observable={
            k: (math.sqrt(v[0] / v[2]), math.sqrt(v[1] / v[2]), units[k]) for k, v in sums.items()
        },
    )


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(v * v for v in values) / len(values))


def _interval(values: Sequence[float]) -> tuple[float, float]:
    """Bootstrap 95 % interval of the rms over runs (fixed seed, 400 draws)."""
    array = np.asarray(values)
    draws = np.random.default_rng(0).integers(0, array.size, (400, array.size))
    sizes = np.sqrt(np.mean(array[draws] ** 2, axis=1))
    return float(np.quantile(sizes, 0.025)), float(np.quantile(sizes, 0.975))
