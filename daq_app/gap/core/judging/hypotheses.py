"""Forward search: which causes, up to three together, explain the runs, and with what evidence."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.effects import Effect, Library
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.fit import Fit, effects_of
from daq_app.gap.core.fitting.likelihood import Sizes
from daq_app.gap.core.fitting.parallel import Workers
from daq_app.gap.core.fitting.screen import Screened, Step
from daq_app.gap.core.fitting.tasks import FitTask, FormsTask, ScreenTask
from daq_app.gap.core.judging.evidence import NULL, Hypothesis, Ranked, rank
from daq_app.gap.core.judging.other_forms import FreeForm
from daq_app.gap.core.policy import POLICY, Policy

REFITTED = 6
"""Effects that are refitted by either ranking, with and without the discrepancy of the fit they stand on."""
LEADS = 2
LEAD_SHARE = 0.5
"""A second cause is sought to the two best single ones, to the second of them if it explains half as much."""
POLISHED = 3
POLISH_REACH = 12.0
"""The best three hypotheses within 12 in log evidence are fitted to the end with exact Jacobians."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a diagnosis is run."""

    causes: int = 3
    """The largest number of causes that are sought together."""
    hold_out: str = "level"
    workers: int = 1
    policy: Policy = POLICY
    progress: Callable[[int, int, str], None] | None = None
    cancelled: Callable[[], bool] | None = None


class Hypotheses:
    """The fits of one diagnosis, made by `fit_all`."""

    def __init__(
        self,
        experiment: Experiment,
        library: Library,
        options: Options,
        workers: Workers,
        *,
        measured: bool = False,
    ) -> None:
        """`measured`: whether something material was measured directly about an instrument."""
        self.experiment, self.library, self.options, self.workers = experiment, library, options, workers
        self.policy, self.measured = options.policy, measured
        self.fits: dict[Hypothesis, Fit] = {}
        self.evidence: dict[Hypothesis, float] = {}
        """Log evidence of every hypothesis; where it was not refitted, by one linear step."""
        self.alone: dict[str, Screened] = {}
        """What each effect and probe promises on top of nothing."""

    def fit_all(self) -> None:
        """Nothing, single causes, then further ones on top of the best."""
        start = FitTask((), {}, Sizes.nominal(self.experiment))
        (null,) = self.workers.run([start], "without any effect")
        self.workers.frozen = null.columns
        self._keep(null)
        self._extend(NULL, "single effects", with_probes=True)
        for count in range(2, min(self.options.causes, len(self.policy.prior_count)) + 1):
            leads = self._leads(count - 1)
            self._finish(leads, f"{count} effects together")
            for lead in leads:
                self._extend(lead, f"{count} effects together")
        self._make_consistent()
        self._polish()

    def _keep(self, found: Fit) -> None:
        """The better of two fits of one hypothesis, which may have ended at different discrepancies.

        One that ended at no number says nothing; what was only promised for its hypothesis goes.
        """
        known = self.fits.get(found.effects)
        if not math.isfinite(found.log_evidence):
            if known is None:
                self.evidence.pop(found.effects, None)
            return
        if known is None or found.log_evidence > known.log_evidence:
            self.fits[found.effects] = found
            self.evidence[found.effects] = found.log_evidence

    def _best(self, count: int) -> list[Hypothesis]:
        """Refitted hypotheses of so many causes, best first."""
        refitted = [h for h in self.fits if len(h) == count]
        return sorted(refitted, key=lambda h: -self.fits[h].log_evidence)

    def _leads(self, count: int) -> list[Hypothesis]:
        """Hypotheses of so many causes that a further one is sought to; none where they are not worth it."""
        if count == 1:
            order = self._best(1)[:LEADS]
            least = LEAD_SHARE * (self.evidence[order[0]] - self.evidence[NULL])
            return [h for h in order if self.evidence[h] - self.evidence[NULL] >= least]
        return [h for h in self._best(count)[:1] if self._worth_it(h)]

    def _extend(self, base: Hypothesis, text: str, *, with_probes: bool = False) -> None:
        """Screen every further effect on top of a hypothesis, and refit the most promising."""
        fit = self.fits[base]
        taken = set(self.library.class_of(base))
        taken |= {self.library[name].part_of for name in base}
        further = [
            e
            for e in self.library.named
            if not taken & {*self.library.class_of([e.name]), e.name} and e.part_of not in base
        ]
        probes = list(self.library.probes) if with_probes else []
        screened = self._screened(base, [*further, *probes], text)
        if with_probes:
            self.alone = screened
        gains = {s.effect: max(s.robust.gain, s.strict.gain) for s in screened.values()}
        promising = [e.name for e in further if base == NULL or gains[e.name] > self.policy.further_nats]
        for name in promising:
            hypothesis = tuple(sorted((*base, name)))
            approximate = fit.log_evidence + screened[name].robust.evidence
            self.evidence.setdefault(hypothesis, approximate)
        tasks = [
            self._refit(hypothesis, step, fit)
            for hypothesis, step in self._chosen(base, [screened[name] for name in promising])
        ]
        for result in self.workers.run(tasks, text):
            self._keep(result)

    def _screened(self, base: Hypothesis, effects: Sequence[Effect], text: str) -> dict[str, Screened]:
        """What effects promise on top of a hypothesis; beside causes, from the starts that led on nothing."""
        share = max(1, -(-len(effects) // (3 * self.options.workers)))
        named = effects_of(base, self.library)
        begin = [self.alone[e.name].starts if e.name in self.alone else () for e in effects]
        tasks = [
            ScreenTask(named, self.fits[base], tuple(effects[k : k + share]), tuple(begin[k : k + share]))
            for k in range(0, len(effects), share)
        ]
        return {screened.effect: screened for part in self.workers.run(tasks, text) for screened in part}

    @staticmethod
    def _chosen(base: Hypothesis, screened: Sequence[Screened]) -> list[tuple[Hypothesis, Step]]:
        """The effects to refit, each from where its step ended."""
        chosen = []
        for kind in ("robust", "strict"):
            order = sorted(screened, key=lambda s: -getattr(s, kind).evidence)
            chosen += [(tuple(sorted((*base, s.effect))), getattr(s, kind)) for s in order[:REFITTED]]
        return chosen

    def _refit(self, hypothesis: Hypothesis, step: Step, found: Fit) -> FitTask:
        effects = effects_of(hypothesis, self.library)
        columns = {key: column for key, column in found.columns.items() if "." in key[0]}
        return FitTask(effects, step.known, step.sizes, polish=False, columns=columns)

    def _make_consistent(self) -> None:
        """Refit the parts of the best hypothesis at its discrepancy: a part may have stopped short of it."""
        best = max(self.fits, key=lambda h: self.fits[h].log_evidence)
        whole = self.fits[best]
        parts = [tuple(name for name in best if name != left) for left in best]
        tasks = [
            FitTask(effects_of(part, self.library), whole.known(), whole.sizes, polish=False)
            for part in dict.fromkeys([*parts, NULL])
            if part != best
        ]
        for result in self.workers.run(tasks, "parts of the best"):
            self._keep(result)

    def _polish(self) -> None:
        """Finish the fits that have a chance; the others keep their quick ones."""
        ranked = [r for r in self.ranked() if r.effects in self.fits]
        top = ranked[0].log_evidence
        near = [r.effects for r in ranked[:POLISHED] if r.log_evidence > top - POLISH_REACH]
        self._finish(near, "the best once more")

    def _finish(self, hypotheses: Sequence[Hypothesis], text: str) -> None:
        """Fit hypotheses to the end with exact Jacobians: what stands on one is judged at its end."""
        tasks = [
            FitTask(effects_of(h, self.library), self.fits[h].known(), self.fits[h].sizes)
            for h in hypotheses
            if not self.fits[h].columns
        ]
        for result in self.workers.run(tasks, text):
            # What was worked out exactly takes the place of what was not, better or not.
            self.fits[result.effects] = result
            self.evidence[result.effects] = result.log_evidence

    def ranked(self) -> list[Ranked]:
        """All hypotheses but those of which one cause explains too little beside the others."""
        kept = {h: e for h, e in self.evidence.items() if self._worth_it(h)}
        return rank(kept, self.library, self.policy, measured=self.measured)

    def _worth_it(self, hypothesis: Hypothesis) -> bool:
        """Whether the last of several causes gains what it costs, and more than the others' form is wrong by.

        In the groups of features that it improves, what it takes away is compared with what the others
        explain, both in the noise, scatter and discrepancy of the whole: the square root of their ratio is
        that of two amplitudes. The log evidence cannot say this, since it grows with the logarithm of what
        the others explain.
        """
        if len(hypothesis) < 2 or hypothesis not in self.fits:
            return True
        without = {
            left: self.evidence.get(tuple(name for name in hypothesis if name != left), -math.inf)
            for left in hypothesis
        }
        last = max(without, key=lambda name: without[name])
        if self.evidence[hypothesis] - without[last] < self.policy.further_nats:
            return False
        rest = tuple(name for name in hypothesis if name != last)
        if rest not in self.fits:
            return True
        yardstick = self.fits[hypothesis].sizes
        whole, part, nothing = (
            self.fits[h].misfit_nats(self.experiment, yardstick) for h in (hypothesis, rest, NULL)
        )
        taken = part - whole
        improved = taken > self.policy.improved_nats
        explained = float(np.maximum(nothing - part, 0.0)[improved].sum())
        return float(taken[improved].sum()) >= self.policy.further_share**2 * explained

    def free_forms(self, best: Hypothesis) -> list[FreeForm]:
        """What each probe of the families of the best hypothesis, and each departure from the forms of its
        effects, gains on top of it, by a score test.

        Another form of a family that is in the library (drag with the square of the speed) leaves little,
        since the named form takes up most of it; what is left has the shape of that family. A probe can have
        any shape, which dilutes a small difference; a departure has one, which most others share to some
        degree.
        """
        families = {self.library[name].family for name in best}
        probes = [probe for probe in self.library.probes if probe.family in families]
        forms = (*probes, *self.library.departures(best))
        if not forms:
            return []
        (scores,) = self.workers.run(
            [FormsTask(effects_of(best, self.library), self.fits[best], forms)], "free forms"
        )
        return [
            FreeForm.of(form, score, self._departed_from(form, best))
            for form, score in zip(forms, scores, strict=True)
        ]

    def _departed_from(self, form: Effect, best: Hypothesis) -> float:
        """The first parameter, in its unit, of the effect of the best hypothesis that a form departs from."""
        values = self.fits[best].values
        effects = (self.library[name] for name in best if name in form.of)
        sizes = [values.get(effect.key(effect.parameters[0]), (0.0,))[0] for effect in effects]
        return max(sizes, key=abs, default=0.0)
