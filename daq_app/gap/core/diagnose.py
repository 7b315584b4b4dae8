"""One diagnosis: fits of all hypotheses, ranking, held-out scores, what remains, decision."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from daq_app.gap.core.effects import Library
from daq_app.gap.core.features import Run
from daq_app.gap.core.findings import Finding, material
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.fit import Fit, effects_of
from daq_app.gap.core.fitting.held_out import GapSize, HeldOutRun, gap_size
from daq_app.gap.core.fitting.parallel import Workers
from daq_app.gap.core.fitting.problem import Problem
from daq_app.gap.core.fitting.tasks import FitTask, ScoreTask
from daq_app.gap.core.judging.decision import Evidence, Usual, decide
from daq_app.gap.core.judging.evidence import NULL, Hypothesis, Ranked, answers, credible_set, inclusion
from daq_app.gap.core.judging.hypotheses import Hypotheses, Options
from daq_app.gap.core.judging.joined import with_findings
from daq_app.gap.core.judging.other_forms import with_other_forms
from daq_app.gap.core.judging.remainder import remainder
from daq_app.gap.core.judging.where import gap_map
from daq_app.gap.core.model import Model
from daq_app.gap.core.parameters import NORMAL_95, Parameter
from daq_app.gap.core.result import CannotDiagnose, Cause, Detection, Diagnosis, Estimate

PER_RUN = " (mean of the runs; each has its own)"


def diagnose(
    model: Model,
    runs: Sequence[Run],
    library: Library,
    options: Options | None = None,
    limits: Sequence[str] = (),
    findings: Sequence[Finding] = (),
) -> Diagnosis:
    """Where model and runs differ, which effects of the library explain it, how far the gap shrinks.

    Raises `CannotDiagnose` where there is nothing to fit, and `parallel.Interrupted` when
    `options.cancelled` says so. `limits` are passed on to the result; `findings` are what was
    measured directly about instruments and is out of the runs already: material ones join the answer.
    """
    options = options or Options()
    began = time.perf_counter()
    _refuse_without_features(runs)
    experiment = Experiment.of(model, runs)
    _refuse_undetermined(experiment)
    stated = list(limits)
    if len(runs) == 1:
        stated.append("One run only: nothing is held out, and repeatability comes from its prior.")
    with Workers(experiment, options.workers, options.progress, options.cancelled) as workers:
        study = _Study(experiment, library, options, workers, measured=bool(material(findings)))
        study.fit_all()
        result = study.conclude(stated)
    return replace(with_findings(result, findings, options.policy), seconds=time.perf_counter() - began)


def _refuse_without_features(runs: Sequence[Run]) -> None:
    if not runs:
        raise CannotDiagnose("There is no run to diagnose.", "Give at least one recorded run.")
    for run in runs:
        if len(run.features) == 0:
            raise CannotDiagnose(f"Run {run.name} has no features.", "Check its recording.")


def _refuse_undetermined(experiment: Experiment) -> None:
    features = sum(len(run.features) for run in experiment.runs)
    unknowns = len(Problem(experiment, ()))
    if features <= unknowns:
        raise CannotDiagnose(
            f"{features} features cannot determine {unknowns} unknowns.", "Give more runs or longer ones."
        )


class _Study(Hypotheses):
    """The fits of one diagnosis, and what follows from them."""

    def conclude(self, limits: list[str]) -> Diagnosis:
        """Ranking, held-out scores, what remains, decision."""
        ranked = self.ranked()
        best = answers(ranked, self.library)[0].effects
        self._finish([best], "the best once more")
        fit, null = self.fits[best], self.fits[NULL]
        forms = self.free_forms(best)
        ranked = with_other_forms(ranked, best, forms, self.library, self.policy.prior_other_form)
        classes = answers(ranked, self.library)
        rest = remainder(self.experiment, self.library, null, fit, forms, self._gains(best), self.policy)
        detection = self._detection()
        decision, following = decide(
            Evidence(self.library, classes, fit, rest, detection, self._usual(fit)), self.policy
        )
        gap, alone = self._held_out(best)
        if not fit.converged:
            limits.append(f"The fit of {' + '.join(best) or 'nothing missing'} has not settled.")
        known = rest.known(self.policy)
        scales = self._scales(fit)
        return Diagnosis(
            model=self.experiment.model.name,
            runs=tuple(run.name for run in self.experiment.runs),
            where=gap_map(null.residuals, scales, self.experiment.runs, self.policy),
            which=tuple(replace(r, probability=known * r.probability) for r in ranked),
            set95=tuple(
                r for answer in credible_set(classes, self.policy.set_content) for r in answer.alternatives
            ),
            decision=decision,
            parameters=self._estimates(fit, nuisance=True),
            effect_parameters=self._estimates(fit, nuisance=False),
            scatter=self._scatter(fit),
            gap=gap,
            remaining=gap_map(fit.residuals, scales, self.experiment.runs, self.policy),
            rest=rest,
            causes=self._causes(ranked, fit, alone),
            free_forms=tuple(forms),
            probes=self._probes(),
            probe_shapes=self._shapes(),
            detection=detection,
            next_measurement=following,
            limits=tuple(limits),
        )

    def _gains(self, best: Hypothesis) -> dict[str, float]:
        """What each effect of a hypothesis adds to the log evidence of the others, where they were fitted."""
        without = {name: tuple(n for n in best if n != name) for name in best}
        own = self.fits[best].log_evidence
        return {
            name: own - self.fits[others].log_evidence
            for name, others in without.items()
            if others in self.fits
        }

    def _scales(self, fit: Fit) -> list[np.ndarray[tuple[int], np.dtype[np.float64]]]:
        """What each feature scatters by when nothing is missing and the model is exact."""
        problem, sizes = Problem(self.experiment, effects_of(fit.effects, self.library)), fit.sizes
        exact, u = sizes.without_discrepancy(), problem.start(fit.known())
        return [
            exact.covariance(self.experiment, i, problem.predict(i, u)).marginal_sd
            for i in range(len(self.experiment.runs))
        ]

    def _held_out(self, best: Hypothesis) -> tuple[GapSize | None, dict[str, float]]:
        """The gap on held-out runs, and the share of it that each cause alone closes."""
        single: list[Hypothesis] = [(name,) for name in best] if len(best) > 1 else []
        missing = [h for h in single if h not in self.fits]
        for result in self.workers.run(
            [
                FitTask(effects_of(h, self.library), self.fits[best].known(), self.fits[best].sizes, False)
                for h in missing
            ],
            "held-out runs",
        ):
            self.fits[result.effects] = result
        wanted: list[Hypothesis] = list(dict.fromkeys([NULL, best, *single]))
        tasks = [ScoreTask(effects_of(h, self.library), self.fits[h], self.options.hold_out) for h in wanted]
        scores: dict[Hypothesis, list[HeldOutRun]] = dict(
            zip(wanted, self.workers.run(tasks, "held-out runs"), strict=True)
        )
        yardstick = self.fits[best].sizes

        def against_null(hypothesis: Hypothesis) -> GapSize | None:
            return gap_size(self.experiment, scores[NULL], scores[hypothesis], yardstick)

        gap = against_null(best)
        alone = {h[0]: against_null(h) for h in (single or ([best] if best else []))}
        return gap, {name: size.closure if size else math.nan for name, size in alone.items()}

    def _causes(self, ranked: Sequence[Ranked], fit: Fit, alone: dict[str, float]) -> tuple[Cause, ...]:
        estimates = self._estimates(fit, nuisance=False)
        causes = []
        for name, probability in inclusion(ranked).items():
            if probability < self.policy.listed or self.library[name].kind != "effect":
                continue
            of_effect = tuple(e for e in estimates if e.name.rpartition(".")[0] == name)
            closes = alone.get(name, math.nan)
            effect = self.library[name]
            causes.append(
                Cause(
                    name,
                    _in_words(effect.signature or name, of_effect),
                    effect.family,
                    probability,
                    of_effect,
                    closes,
                    name in alone and not closes < self.policy.cause_closes,
                )
            )
        return tuple(sorted(causes, key=lambda c: (-c.material, -np.nan_to_num(c.closes), -c.probability)))

    def _estimates(self, fit: Fit, *, nuisance: bool) -> tuple[Estimate, ...]:
        problem = Problem(self.experiment.only([0]), effects_of(fit.effects, self.library))
        wanted = [q for q in problem.unknowns if bool(q.effect) != nuisance and (q.run is None or q.effect)]
        return tuple(
            Estimate(
                q.key,
                *(fit.values[q.key] if q.run is None else _mean_of_runs(fit, q.key)),
                q.parameter.unit,
                q.parameter.mean,
                q.parameter.sd,
                q.parameter.meaning + ("" if q.run is None else PER_RUN),
            )
            for q in wanted
        )

    def _scatter(self, fit: Fit) -> tuple[Estimate, ...]:
        return tuple(
            Estimate(s.name, fit.sigmas[s.name], math.nan, math.nan, s.unit, s.median, s.log_sd, s.meaning)
            for s in self.experiment.model.scatters
        )

    def _usual(self, fit: Fit) -> tuple[Usual, ...]:
        """What the model has of effects in any case, as far as the library has these.

        Those of one family are judged together: a lean and unequal edges are hard to tell apart.
        """
        families: dict[str, list[tuple[Parameter, Estimate]]] = {}
        estimates = self._estimates(fit, nuisance=True)
        for parameter, estimate in zip(self.experiment.model.nuisance, estimates, strict=True):
            if parameter.usual_of in self.library:
                families.setdefault(self.library[parameter.usual_of].family, []).append((parameter, estimate))
        found = []
        for members in families.values():
            most, shown = max(members, key=lambda m: abs(m[1].value / m[0].sd))
            sd = fit.distance({parameter.name for parameter, _ in members})
            found.append(Usual(most.usual_of, _in_words("", (shown,)).lstrip(": "), sd))
        return tuple(found)

    def _detection(self) -> tuple[Detection, ...]:
        """Strength at which each effect would be as many posterior sd from none as detection needs."""
        return tuple(
            Detection(effect.name, p.name, self.policy.detected_sd * sd * p.sd, p.unit)
            for effect in self.library.named
            for p, sd in zip(effect.shared, self.alone[effect.name].sd, strict=True)
            if p.scale != "log"
        )

    def _probes(self) -> tuple[Ranked, ...]:
        """The free forms by what each gains on top of nothing."""
        null = self.fits[NULL].log_evidence
        ranked = [
            Ranked((p.name,), p.family, 0.0, null + self.alone[p.name].robust.evidence)
            for p in self.library.probes
        ]
        return tuple(sorted(ranked, key=lambda r: -r.log_evidence))

    def _shapes(self) -> dict[str, dict[str, tuple[float, float, float]]]:
        """Probe → coefficient → (value, low, high), on top of nothing."""
        return {
            probe.name: {
                probe.key(p): (
                    p.value(self.alone[probe.name].robust.known[(probe.key(p), None)]),
                    *p.interval(self.alone[probe.name].robust.known[(probe.key(p), None)], sd),
                )
                for p, sd in zip(probe.shared, self.alone[probe.name].sd, strict=True)
            }
            for probe in self.library.probes
        }


def _in_words(what: str, estimates: Sequence[Estimate]) -> str:
    """``viscous damping: damping ratio 0.011 ± 0.0004``."""
    sizes = [
        f"{e.meaning} {e.value:.3g} ± {0.5 * (e.high - e.low):.1g} {e.unit if e.unit != '1' else ''}".rstrip()
        for e in estimates
    ]
    return f"{what.rstrip('.')}: {', '.join(sizes)}" if sizes else what.rstrip(".")


def _mean_of_runs(fit: Fit, key: str) -> tuple[float, float, float]:
    """A parameter that every run has for itself: mean over the runs with the interval of that mean."""
    values = np.array([local[key] for local in fit.local_values if key in local])
    sd = (values[:, 2] - values[:, 1]) / (2.0 * NORMAL_95)
    between = float(values[:, 0].std(ddof=1)) if len(values) > 1 else 0.0
    half = NORMAL_95 * math.sqrt((float(np.mean(sd**2)) + between**2) / len(values))
    middle = float(values[:, 0].mean())
    return middle, middle - half, middle + half
