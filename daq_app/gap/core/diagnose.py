"""One diagnosis: fits of all hypotheses, ranking, held-out scores, verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from daq_app.gap.core.decision import Material, Thresholds, decide
from daq_app.gap.core.effects import Library
from daq_app.gap.core.evidence import NULL, Ranked, credible_set, family_of, pair_candidates, rank
from daq_app.gap.core.features import Run
from daq_app.gap.core.fit import Fit, effects_of
from daq_app.gap.core.goodness import Goodness, check
from daq_app.gap.core.held_out import GapSize, HeldOutRun, gap_size
from daq_app.gap.core.likelihood import Covariance
from daq_app.gap.core.model import Model
from daq_app.gap.core.parallel import FitTask, GlanceTask, ScoreTask, Workers
from daq_app.gap.core.problem import Problem
from daq_app.gap.core.result import CannotDiagnose, Detection, Diagnosis, Estimate
from daq_app.gap.core.where import gap_map

Hypothesis = tuple[str, ...]
POLISHED = 6
POLISH_REACH = 40.0
"""The best six hypotheses within 40 in log evidence are fitted to the end with exact Jacobians."""
REACH = 60.0
REACH_SHARE = 0.5
"""A hypothesis is fitted if a glance puts it within 60 of the best in log evidence, or if it gains half as
much as the best; the others keep what the glance gave them, which leaves them without a chance."""
STRAINED = 4.0
"""Prior sd from which a parameter of the model looks as if it stood for an effect."""
LITTLE = 3.0
"""A glance that has arrived and gained less than this over what it started from, and is no nearer to the
best, is kept too: the scatter that it took over is its own."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a diagnosis is run."""

    pairs: bool = True
    """Fit pairs of effects where a single one does not pass the gate, or always (`always_pairs`)."""
    always_pairs: bool = False
    multistart: bool = True
    """Start the fit of an effect from several strengths, not only from none."""
    hold_out: str = "level"
    workers: int = 1
    pair_width: int = 5
    thresholds: Thresholds = field(default_factory=Thresholds)
    progress: Callable[[int, int, str], None] | None = None
    cancelled: Callable[[], bool] | None = None


def diagnose(
    model: Model,
    runs: Sequence[Run],
    library: Library,
    options: Options | None = None,
    limits: Sequence[str] = (),
) -> Diagnosis:
    """Where model and runs differ, which effect of the library explains it, how far the gap shrinks.

    Raises `CannotDiagnose` where there is nothing to fit, and `parallel.Interrupted` when
    `options.cancelled` says so. `limits` are passed on to the result.
    """
    options = options or Options()
    began = time.perf_counter()
    _refuse(model, runs)
    stated = list(limits)
    if len(runs) == 1:
        stated.append("One run only: nothing is held out, and repeatability comes from its prior.")
    with Workers(model, runs, options.workers, options.progress, options.cancelled) as workers:
        study = _Study(model, tuple(runs), library, options, workers)
        study.fit_all()
        return study.conclude(stated, began)


def _refuse(model: Model, runs: Sequence[Run]) -> None:
    if not runs:
        raise CannotDiagnose("There is no run to diagnose.", "Give at least one recorded run.")
    for run in runs:
        if len(run.features) == 0:
            raise CannotDiagnose(f"Run {run.name} has no features.", "Check that it was released and rocks.")
    features = sum(len(run.features) for run in runs)
    unknowns = len(Problem(model, runs, ()))
    if features <= unknowns:
        raise CannotDiagnose(
            f"{features} features cannot determine {unknowns} unknowns.", "Give more runs or longer ones."
        )


PER_RUN = " (mean of the runs; each has its own)"


def _mean_of_runs(found: Fit, key: str) -> tuple[float, float, float]:
    """A parameter that every run has for itself: mean over the runs with the interval of that mean."""
    values = np.array([local[key] for local in found.local_values if key in local])
    own = (values[:, 2] - values[:, 1]) / 3.92
    between = float(values[:, 0].std(ddof=1)) if len(values) > 1 else 0.0
    half = 1.96 * math.sqrt((float(np.mean(own**2)) + between**2) / len(values))
    middle = float(values[:, 0].mean())
    return middle, middle - half, middle + half


class _Study:
    """The fits of one diagnosis."""

    def __init__(
        self, model: Model, runs: tuple[Run, ...], library: Library, options: Options, workers: Workers
    ) -> None:
        self.model, self.runs, self.library, self.options, self.workers = (
            model,
            runs,
            library,
            options,
            workers,
        )
        self.thresholds = options.thresholds
        self.fits: dict[Hypothesis, Fit] = {}
        self.probes: dict[Hypothesis, Fit] = {}
        self._goodness: dict[Hypothesis, Goodness] = {}
        self._polished: set[Hypothesis] = set()

    def _task(self, effects: Hypothesis, start: Fit | None, *, polish: bool) -> FitTask:
        known = start.known() if start else {}
        sigmas = start.sigmas if start else {}
        again = start is not None and start.effects == effects
        # A pair keeps the columns of the effect that it starts from while it looks for the other.
        columns = {} if start is None else {k: c for k, c in start.columns.items() if "." in k[0]}
        several = self.options.multistart and not again
        return FitTask(effects_of(effects, self.library), known, sigmas, polish, several, columns)

    def _fit(
        self,
        hypotheses: Sequence[Hypothesis],
        starts: Sequence[Fit | None],
        text: str,
        *,
        polish: bool = True,
    ) -> list[Fit]:
        tasks = [self._task(h, s, polish=polish) for h, s in zip(hypotheses, starts, strict=True)]
        return self.workers.run(tasks, text)

    def _glance(self, effects: Hypothesis, start: Fit) -> GlanceTask:
        """A pair is started from what each of its effects was alone, or without the weaker one."""
        task = self._task(effects, start, polish=False)
        hint: dict[tuple[str, int | None], float] | None = None if self.options.multistart else {}
        if len(effects) > 1:
            hint = {k: u for name in effects for k, u in self.fits[(name,)].known().items() if "." in k[0]}
        return GlanceTask(task.effects, task.known, task.sigmas, task.columns, hint)

    def _screened(self, hypotheses: Sequence[Hypothesis], starts: Sequence[Fit], text: str) -> list[Fit]:
        """Fits of hypotheses, of those without a chance a glance only."""
        tasks = [self._glance(h, s) for h, s in zip(hypotheses, starts, strict=True)]
        found: list[Fit] = self.workers.run(tasks, text)
        null = self.fits[NULL].log_evidence
        best = max(f.log_evidence for f in (*self.fits.values(), *found))
        bar = best - max(REACH, REACH_SHARE * (best - null))
        near = [
            k
            for k, f in enumerate(found)
            if f.log_evidence >= bar and not self._done(f, starts[k].log_evidence, best)
        ]
        # A glance whose other starts promise no more is gone on with; else all starts are followed.
        fitted = self._fit(
            [hypotheses[k] for k in near],
            [found[k] if found[k].settled else starts[k] for k in near],
            text,
            polish=False,
        )
        for k, result in zip(near, fitted, strict=True):
            found[k] = result
        return found

    @staticmethod
    def _done(seen: Fit, start: float, best: float) -> bool:
        """Whether a fit could not change what a glance says of a hypothesis."""
        gained = seen.log_evidence - start
        return seen.settled and seen.converged and gained < LITTLE and seen.log_evidence < best - LITTLE

    def fit_all(self) -> None:
        """Null, singles and probes; then pairs where they are wanted."""
        self.fits[NULL] = self._fit([NULL], [None], "without any effect")[0]
        self.workers.frozen = self.fits[NULL].columns
        singles = [(effect.name,) for effect in self.library.named]
        probes = [(effect.name,) for effect in self.library.probes]
        both = singles + probes
        found = self._screened(both, [self.fits[NULL]] * len(both), "single effects")
        for hypothesis, result in zip(both, found, strict=True):
            (self.fits if hypothesis in singles else self.probes)[hypothesis] = result
        self._polish(self.fits)
        self._polish(self.probes)
        if len(self.library.named) > 1 and self.options.pairs and self._pairs_wanted():
            self._fit_pairs()
            self._polish(self.fits)

    def _polish(self, fits: dict[Hypothesis, Fit]) -> None:
        """Finish the fits that have a chance; the others keep their quick ones."""
        if not fits:
            return
        best = max(f.log_evidence for f in fits.values())
        order = sorted(fits, key=lambda h: -fits[h].log_evidence)
        chosen = [h for h in order[:POLISHED] if fits[h].log_evidence > best - POLISH_REACH and h != NULL]
        chosen = [h for h in chosen if h not in self._polished]
        self._polished |= set(chosen)
        for hypothesis, result in zip(
            chosen, self._fit(chosen, [fits[h] for h in chosen], "the best once more"), strict=True
        ):
            if result.log_evidence > fits[hypothesis].log_evidence - 5.0:
                result.starts, result.starts_agreeing = (
                    fits[hypothesis].starts,
                    fits[hypothesis].starts_agreeing,
                )
                fits[hypothesis] = result

    def _pairs_wanted(self) -> bool:
        """Pairs cost most of the time, and only help where singles leave something over."""
        if self.options.always_pairs:
            return True
        best = self._ranked()[0]
        if best.effects and min(self.fits[best.effects].strength(e) for e in best.effects) < 2:
            return False
        beaten = any(
            p.log_evidence > self.fits[best.effects].log_evidence + self.thresholds.probe_log_bayes
            for p in self.probes.values()
        )
        left = not self.goodness(best.effects).passed or self._leftover(best.effects) > 1.1
        return beaten or left or self._strain(best.effects) > STRAINED

    def _strain(self, effects: Hypothesis) -> float:
        """The largest distance of a parameter of the model from its prior, in prior sd.

        A parameter that all runs share can hide a second effect without a trace in the residuals.
        """
        found = self.fits[effects]
        own = [
            abs(float(u))
            for (key, run), u in zip(found.keys, found.u, strict=True)
            if run is None and "." not in key
        ]
        return max(own, default=0.0)

    def _leftover(self, effects: Hypothesis) -> float:
        whitened = np.concatenate(self.fits[effects].whitened)
        return float(np.sqrt(np.mean(whitened**2)))

    def _fit_pairs(self) -> None:
        candidates = pair_candidates(self.fits, self.library, self.options.pair_width)
        starts: list[Fit] = []
        for pair in candidates:
            known = [self.fits[(name,)] for name in pair]
            starts.append(max(known, key=lambda f: f.log_evidence))
        found = self._screened(candidates, starts, "pairs of effects")
        for pair, result in zip(candidates, found, strict=True):
            self.fits[pair] = result

    def _ranked(self) -> list[Ranked]:
        return rank(self.fits, self.library, self.thresholds.priors, self.thresholds.temperature)

    def goodness(self, effects: Hypothesis) -> Goodness:
        if effects not in self._goodness:
            found = self.fits.get(effects) or self.probes[effects]
            self._goodness[effects] = check(
                found,
                self.runs,
                self.model.scatters,
                self.thresholds.goodness_p,
                self.thresholds.goodness_tolerated,
            )
        return self._goodness[effects]

    def conclude(self, limits: list[str], began: float) -> Diagnosis:
        """Ranking, held-out scores, verdict."""
        ranked = self._ranked()
        best = ranked[0].effects
        probe_order = sorted(self.probes, key=lambda k: -self.probes[k].log_evidence)
        for hypothesis in [NULL, best, *probe_order[:1]]:
            self.goodness(hypothesis)
        found = self.fits[best]
        material = Material(
            self.library,
            ranked,
            self.fits,
            self.probes,
            self._goodness,
            null_gap=self._gap(found, self.fits[NULL].known()),
            best_gap=self._leftover(best),
            nominal_gap=self._gap(
                found, {key: u for key, u in self.fits[NULL].known().items() if key[1] is not None}
            ),
        )
        decision, following = decide(material, self.thresholds)
        gap = self._held_out(best)
        if decision.verdict in ("effect", "pair") and not self.goodness(best).passed:
            limits.append(f"A small structure remains: {self.goodness(best).worst}.")
        if not self.fits[best].converged or self.fits[best].starts_agreeing * 3 < self.fits[best].starts:
            limits.append(
                f"Only {self.fits[best].starts_agreeing} of {self.fits[best].starts} starts reached "
                f"the optimum of {self.fits[best].name}."
            )
        return Diagnosis(
            model=self.model.name,
            runs=tuple(run.name for run in self.runs),
            where=gap_map(self.fits[NULL].residuals, found.scales, self.runs),
            which=tuple(ranked),
            set95=tuple(credible_set(ranked)),
            decision=decision,
            parameters=self._estimates(self.fits[best], nuisance=True),
            effect_parameters=self._estimates(self.fits[best], nuisance=False),
            scatter=self._scatter(self.fits[best]),
            gap=gap,
            remaining=gap_map(found.residuals, found.scales, self.runs),
            goodness=self.goodness(best),
            goodness_null=self.goodness(NULL),
            probes=tuple(
                Ranked(k, family_of(k, self.library), 0.0, self.probes[k].log_evidence) for k in probe_order
            ),
            probe_shapes={
                k[0]: {q: v for q, v in self.probes[k].values.items() if q.startswith(k[0] + ".")}
                for k in probe_order
            },
            detection=self._detection(),
            next_measurement=following,
            limits=tuple(limits),
            seconds=time.perf_counter() - began,
        )

    def _held_out(self, best: Hypothesis) -> GapSize | None:
        wanted = [NULL] if best == NULL else [NULL, best]
        tasks = [ScoreTask(effects_of(h, self.library), self.fits[h], self.options.hold_out) for h in wanted]
        scores: list[list[HeldOutRun]] = self.workers.run(tasks, "held-out runs")
        return gap_size(self.runs, scores[0], scores[-1], self.fits[best].sigmas)

    def _gap(self, best: Fit, known: Mapping[tuple[str, int | None], float]) -> float:
        """Gap without any effect at the coordinates given, else at the priors' centres.

        In the noise and scatter units of the best hypothesis.
        """
        problem = Problem(self.model, self.runs, ())
        u = problem.start(known)
        total, count = 0.0, 0
        for i, run in enumerate(self.runs):
            prediction = problem.predict(i, u)
            residual = run.features.values - prediction.features
            c = Covariance(run.features.sd, prediction, best.sigmas)
            total += float(residual @ c.solve(residual))
            count += residual.size
        return math.sqrt(total / count)

    def _estimates(self, found: Fit, *, nuisance: bool) -> tuple[Estimate, ...]:
        problem = Problem(self.model, self.runs[:1], effects_of(found.effects, self.library))
        wanted = [q for q in problem.unknowns if bool(q.effect) != nuisance and (q.run is None or q.effect)]
        return tuple(
            Estimate(
                q.key,
                *(found.values[q.key] if q.run is None else _mean_of_runs(found, q.key)),
                q.parameter.unit,
                q.parameter.mean,
                q.parameter.sd,
                q.parameter.meaning + ("" if q.run is None else PER_RUN),
            )
            for q in wanted
        )

    def _scatter(self, found: Fit) -> tuple[Estimate, ...]:
        return tuple(
            Estimate(s.name, found.sigmas[s.name], math.nan, math.nan, s.unit, s.median, s.log_sd, s.meaning)
            for s in self.model.scatters
        )

    def _detection(self) -> tuple[Detection, ...]:
        limits: list[Detection] = []
        for effect in self.library.named:
            found: Mapping[tuple[str, int | None], int] = {
                key: k for k, key in enumerate(self.fits[(effect.name,)].keys)
            }
            for parameter in effect.shared:
                if parameter.scale == "log":
                    continue
                k = found[(effect.key(parameter), None)]
                sd = math.sqrt(self.fits[(effect.name,)].covariance[k, k]) * parameter.sd
                limits.append(Detection(effect.name, parameter.name, 4 * sd, parameter.unit))
        return tuple(limits)
