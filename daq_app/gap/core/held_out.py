"""Scores on runs that the fit has not seen: predictive density, and the gap in noise units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.fit import Fit, fit
from daq_app.gap.core.likelihood import Covariance
from daq_app.gap.core.model import Model, Prediction
from daq_app.gap.core.problem import Columns, Problem

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
    sigmas: dict[str, float]
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
    model: Model, runs: Sequence[Run], effects: Sequence[Effect], whole: Fit, by: str = "level"
) -> list[HeldOutRun]:
    """Predict every run from a fit to the runs outside its fold.

    `whole` is the fit to all runs, from which the refits start. With a single run there is nothing
    to learn from, and the list is empty.
    """
    if len(runs) < 2:
        return []
    results: list[HeldOutRun] = []
    for fold in folds(runs, by):
        training = [run for i, run in enumerate(runs) if i not in fold]
        start, columns = _renumber(whole, fold, len(runs))
        trained = fit(
            model,
            training,
            effects,
            start,
            whole.sigmas,
            multistart=False,
            frozen=columns,
            polish=not columns,
        )
        strain = strain_of(model, trained) / len(runs)
        results += [_predict(model, runs[i], effects, trained, _of_run(whole, i), strain) for i in fold]
    return results


def strain_of(model: Model, trained: Fit) -> float:
    """Squared distance from the priors of those parameters that are the model's own, beyond chance."""
    own = {p.name for p in model.nuisance}
    square = math.fsum(
        float(u) ** 2
        for (key, run), u in zip(trained.keys, trained.u, strict=True)
        if run is None and key in own
    )
    return max(square - len(own), 0.0)


def _of_run(whole: Fit, run: int) -> Columns:
    """The Jacobian of one run at the whole fit, as that of a problem with this run alone."""
    return {(key, 0): column for (key, index), column in whole.columns.items() if index == run}


def _renumber(
    whole: Fit, fold: Sequence[int], count: int
) -> tuple[dict[tuple[str, int | None], float], Columns]:
    """The whole fit's coordinates and Jacobian with run indices as they are once the fold is left out."""
    place: dict[int | None, int | None] = {None: None}
    place |= {old: new for new, old in enumerate(i for i in range(count) if i not in fold)}
    known = {(key, place[run]): value for (key, run), value in whole.known().items() if run in place}
    columns = {(key, place[run]): column for (key, run), column in whole.columns.items() if run in place}
    return known, columns


def _predict(
    model: Model, run: Run, effects: Sequence[Effect], trained: Fit, columns: Columns, strain: float
) -> HeldOutRun:
    problem = Problem(model, [run], effects)
    shared = [k for k, q in enumerate(problem.unknowns) if q.run is None]
    local = [k for k, q in enumerate(problem.unknowns) if q.run is not None]
    order = {key: k for k, (key, index) in enumerate(trained.keys) if index is None}
    pick = [order[problem.unknowns[k].key] for k in shared]
    u = problem.start({(key, None): trained.u[k] for key, k in order.items()})
    line = problem.linearise(0, u, known=columns)
    for _ in range(_LOCAL_STEPS if local else 0):
        jacobian = line.jacobian[:, local]
        covariance = Covariance(run.features.sd, line.prediction, trained.sigmas)
        hessian = covariance.gram(jacobian) + np.eye(len(local))
        step = np.linalg.solve(hessian, jacobian.T @ covariance.solve(line.residual) - u[local])
        u[local] = np.clip(u[local] + step, problem.low[local], problem.high[local])
        line = problem.linearise(0, u, known=columns)
        if float(np.abs(step).max()) < 1e-3:
            break
    # Predictive covariance: scatter and noise, what training left open, and the run's own prior.
    spread = np.linalg.cholesky(trained.covariance[np.ix_(pick, pick)] + 1e-14 * np.eye(len(pick)))
    open_columns = np.hstack([line.jacobian[:, shared] @ spread, line.jacobian[:, local]])
    fixed = line.prediction.fixed_loadings
    loadings = open_columns if fixed is None else np.hstack([fixed, open_columns])
    widened = Prediction(line.prediction.features, line.prediction.loadings, loadings)
    covariance = Covariance(run.features.sd, widened, trained.sigmas)
    from_prior = line.residual + line.jacobian[:, local] @ u[local]
    n = from_prior.size
    quadratic = float(from_prior @ covariance.solve(from_prior))
    log_score = -0.5 * (quadratic + covariance.log_det + n * math.log(2 * math.pi))
    weight = run.features.independent_fraction
    return HeldOutRun(
        run.name, run.level, weight * log_score, line.residual, line.prediction, trained.sigmas, strain
    )


@dataclass(frozen=True, slots=True)
class GapSize:
    """How far the gap shrank on held-out runs, in units of noise and scatter (floor about 1)."""

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
    runs: Sequence[Run],
    before: Sequence[HeldOutRun],
    after: Sequence[HeldOutRun],
    yardstick: Mapping[str, float],
) -> GapSize | None:
    """Compare two sets of held-out predictions on one yardstick: C at the scatter sizes given.

    Closure is the share of the reachable held-out log score that was gained; the reachable score
    is that of a residual as large as C says, −½(n + ln|C| + n ln 2π) per run.
    """
    if not before or not after:
        return None
    features = {run.name: run.features for run in runs}
    rms: dict[str, list[tuple[float, float]]] = {}
    gained = reachable = 0.0
    sums: dict[str, list[float]] = {}
    units: dict[str, str] = {}
    for old, new in zip(before, after, strict=True):
        measured = features[old.name]
        covariance = Covariance(measured.sd, new.prediction, yardstick)
        pair = tuple(
            math.sqrt((float(r.residual @ covariance.solve(r.residual)) + r.strain) / len(measured))
            for r in (old, new)
        )
        rms.setdefault(old.level, []).append((pair[0], pair[1]))
        weight = measured.independent_fraction
        n = len(measured)
        best = -0.5 * weight * (n + covariance.log_det + n * math.log(2 * math.pi))
        scores = [
            -0.5 * weight * (n * size**2 + covariance.log_det + n * math.log(2 * math.pi)) for size in pair
        ]
        gained += scores[1] - scores[0]
        reachable += best - scores[0]
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
