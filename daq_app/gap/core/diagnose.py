"""One diagnosis: fits of all hypotheses, ranking, held-out scores, verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence

import numpy as np

from daq_app.gap.core.decision import Material, decide
from daq_app.gap.core.effects import Library
from daq_app.gap.core.evidence import NULL, Ranked, answers, credible_set, family_of
from daq_app.gap.core.features import Run
from daq_app.gap.core.findings import Finding
from daq_app.gap.core.fit import Fit, effects_of
from daq_app.gap.core.held_out import GapSize, HeldOutRun, gap_size
from daq_app.gap.core.hypotheses import Hypotheses, Hypothesis, Options
from daq_app.gap.core.joined import with_findings
from daq_app.gap.core.likelihood import Covariance
from daq_app.gap.core.model import Model
from daq_app.gap.core.other_forms import with_other_forms
from daq_app.gap.core.parallel import ScoreTask, Workers
from daq_app.gap.core.problem import Problem
from daq_app.gap.core.result import CannotDiagnose, Detection, Diagnosis, Estimate
from daq_app.gap.core.where import gap_map


def diagnose(
    model: Model,
    runs: Sequence[Run],
    library: Library,
    options: Options | None = None,
    limits: Sequence[str] = (),
    findings: Sequence[Finding] = (),
) -> Diagnosis:
    """Where model and runs differ, which effect of the library explains it, how far the gap shrinks.

    Raises `CannotDiagnose` where there is nothing to fit, and `parallel.Interrupted` when
    `options.cancelled` says so. `limits` are passed on to the result; `findings` are what was
    measured directly about instruments and is out of the runs already: material ones join the answer.
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
        return with_findings(study.conclude(stated, began), findings)


def _refuse(model: Model, runs: Sequence[Run]) -> None:
    if not runs:
        raise CannotDiagnose("There is no run to diagnose.", "Give at least one recorded run.")
    for run in runs:
        if len(run.features) == 0:
            raise CannotDiagnose(f"Run {run.name} has no features.", "Check its recording.")
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


class _Study(Hypotheses):
    """The fits of one diagnosis, and what follows from them."""

    def conclude(self, limits: list[str], began: float) -> Diagnosis:
        """Ranking, held-out scores, verdict."""
        ranked = self.ranked()
        best = answers(ranked, self.library)[0].effects
        probe_order = sorted(self.probes, key=lambda k: -self.probes[k].log_evidence)
        for hypothesis in [NULL, best, *probe_order[:1]]:
            self.goodness(hypothesis)
        found = self.fits[best]
        forms = self.free_forms(best)
        ranked = with_other_forms(ranked, best, forms, self.library, self.thresholds.priors.other_form)
        classes = answers(ranked, self.library)
        material = Material(
            self.library,
            classes,
            self.fits,
            self.probes,
            self._goodness,
            forms,
            null_gap=self._gap(found, self.fits[NULL].known()),
            best_gap=self.leftover(best),
            nominal_gap=self._gap(
                found, {key: u for key, u in self.fits[NULL].known().items() if key[1] is not None}
            ),
        )
        decision, following = decide(material, self.thresholds)
        gap = self._held_out(best)
        if decision.verdict in ("effect", "pair") and not self.goodness(best).passed:
            limits.append(f"A small structure remains: {self.goodness(best).worst}.")
        suspected = self.suspected(best)
        if suspected is not None:
            limits.append(f"Perhaps {' + '.join(suspected)}: the second effect is too weak to be sure of.")
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
            set95=tuple(r for answer in credible_set(classes) for r in answer.alternatives),
            decision=decision,
            parameters=self._estimates(self.fits[best], nuisance=True),
            effect_parameters=self._estimates(self.fits[best], nuisance=False),
            scatter=self._scatter(self.fits[best]),
            gap=gap,
            remaining=gap_map(found.residuals, found.scales, self.runs),
            goodness=self.goodness(best),
            goodness_null=self.goodness(NULL),
            free_forms=tuple(forms),
            rest_p=material.rest_p,
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
