"""The fits of one diagnosis: all hypotheses, each as far as it has a chance."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from daq_app.gap.core.decision import Thresholds
from daq_app.gap.core.effects import Effect, Library
from daq_app.gap.core.evidence import NULL, Ranked, pair_candidates, rank, strength
from daq_app.gap.core.features import Run
from daq_app.gap.core.fit import Fit, effects_of
from daq_app.gap.core.goodness import Goodness, check
from daq_app.gap.core.model import Model
from daq_app.gap.core.other_forms import FreeForm
from daq_app.gap.core.parallel import FitTask, GlanceTask, OnTopTask, PromiseTask, Workers

Hypothesis = tuple[str, ...]
POLISHED = 6
POLISH_REACH = 40.0
"""The best six hypotheses within 40 in log evidence are fitted to the end with exact Jacobians."""
REACH = 60.0
REACH_SHARE = 0.5
"""A hypothesis is fitted if a glance puts it within 60 of the best in log evidence, or if it gains half as
much as the best over the best with one effect less; the others keep what the glance gave them, which leaves
them without a chance."""
FOLLOWED = 3
"""The best few are fitted in any case: a glance may stop far below where its hypothesis ends."""
STRAINED = 4.0
"""Prior sd from which a parameter of the model looks as if it stood for an effect."""
PROMISE = 5.0
"""Gain in log posterior from which a second effect is fitted: one of five posterior sd gains 12.5."""
PRESENT = 2.0
"""Posterior sd from which an effect counts as there, so that another may be sought beside it."""
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


class Hypotheses:
    """The fits of one diagnosis, made by `fit_all`."""

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

    def _screened(
        self,
        hypotheses: Sequence[Hypothesis],
        starts: Sequence[Fit],
        text: str,
        beside: Mapping[Hypothesis, Fit] | None = None,
    ) -> list[Fit]:
        """Fits of hypotheses, of those without a chance (beside all fits so far or those given) a glance."""
        tasks = [self._glance(h, s) for h, s in zip(hypotheses, starts, strict=True)]
        found: list[Fit] = self.workers.run(tasks, text)
        known = self.fits if beside is None else beside
        best = max(f.log_evidence for f in (*known.values(), *found))
        less = max(f.log_evidence for h, f in known.items() if len(h) < max(len(hypotheses[0]), 1))
        bar = best - max(REACH, REACH_SHARE * (best - less))
        # On its way a strength may still be too weak to be an effect: that is judged at the end.
        sizes = sorted((f.log_evidence + f.withheld for f in found), reverse=True)
        bar = min(bar, sizes[min(FOLLOWED, len(sizes)) - 1])
        near = [
            k
            for k, f in enumerate(found)
            if f.log_evidence + f.withheld >= bar and not self._done(f, starts[k].log_evidence, best)
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
        if len(self.library.named) > 1 and self.options.pairs:
            if self._pairs_wanted():
                self._fit_pairs()
            else:
                self._seek_second()
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
        best = self.ranked()[0]
        if best.effects and self._strength(best.effects) < PRESENT:
            return False
        beaten = any(
            p.log_evidence > self.fits[best.effects].log_evidence + self.thresholds.probe_log_bayes
            for p in self.probes.values()
        )
        left = not self.goodness(best.effects).passed or self.leftover(best.effects) > 1.1
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

    def leftover(self, effects: Hypothesis) -> float:
        whitened = np.concatenate(self.fits[effects].whitened)
        return float(np.sqrt(np.mean(whitened**2)))

    def _fit_pairs(self) -> None:
        """Pairs of the best effect with each other, and of the best few among themselves."""
        first = max((h for h in self.fits if len(h) == 1), key=lambda h: self.fits[h].log_evidence)
        candidates = pair_candidates(self.fits, self.library, self.options.pair_width)
        near = [pair for pair in candidates if first[0] in pair]
        likely = self._promising(self.fits[first], near)
        self._fit_likely([*likely, *(p for p in candidates if p not in near)])
        self._fit_scattered(first, near)

    def _fit_scattered(self, first: Hypothesis, pairs: Sequence[Hypothesis]) -> None:
        """The same once more where a scatter is beyond what repeatability explains.

        It has grown until nothing stood out any more, so that what a second effect explains is within it,
        and a step that leaves it as it is gains nothing. At the largest that may be, an effect can gain.
        """
        excessive = self.goodness(first).excessive_scatter
        if not excessive:
            return
        start = self._repeating(self.fits[first], excessive)
        likely = self._promising(start, pairs)
        if not likely:
            return
        found = self._screened(likely, [start] * len(likely), "pairs at less scatter", {first: start})
        for pair, result in zip(likely, found, strict=True):
            if pair not in self.fits or result.log_evidence > self.fits[pair].log_evidence:
                self.fits[pair] = result

    def _repeating(self, found: Fit, excessive: Collection[str]) -> Fit:
        """A fit with the scatters named at the largest that the gate lets pass, and what it is worth then."""
        largest = {s.name: s.high for s in self.model.scatters if s.name in excessive}
        start = replace(found, sigmas={**found.sigmas, **largest})
        task = PromiseTask((replace(self._glance(found.effects, start), columns={}),), found.columns)
        ((objective,),) = self.workers.run([task], "less scatter")
        lost = objective - found.objective
        return replace(
            start,
            log_likelihood=found.log_likelihood - lost,
            log_evidence=found.log_evidence - lost,
        )

    def _seek_second(self) -> None:
        """Pairs of the best effect with each other that promises to gain on top of it.

        A second effect can hide where the first leaves nothing that a gate sees: in the scatter, or in few
        of many features.
        """
        first = self.ranked()[0].effects
        if len(first) == 1 and self._strength(first) >= PRESENT:
            others = [e.name for e in self.library.named if e.name != first[0]]
            pairs: list[Hypothesis] = [tuple(sorted((first[0], name))) for name in others]
            self._fit_likely(self._promising(self.fits[first], pairs))

    def _promising(self, start: Fit, pairs: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Those whose second effect passes its score test where the first one was found."""
        share = max(1, -(-len(pairs) // (2 * self.options.workers)))
        tasks = [
            PromiseTask(tuple(replace(self._glance(p, start), columns={}) for p in part), start.columns)
            for part in (pairs[k : k + share] for k in range(0, len(pairs), share))
        ]
        promised = [value for part in self.workers.run(tasks, "second effects") for value in part]
        return [p for p, reached in zip(pairs, promised, strict=True) if start.objective - reached > PROMISE]

    def free_forms(self, best: Hypothesis) -> list[FreeForm]:
        """What each probe of the families of the best hypothesis, and each departure from the forms of its
        effects, gains on top of it, by a score test.

        Another form of a family that is in the library (drag with the square of the speed) leaves little that
        the gate sees, since the named form takes up most of it; what is left has the shape of that family. A
        probe can have any shape, which dilutes a small difference; a departure has one, which most others
        share to some degree.
        """
        start = self.fits[best]
        families = {self.library[name].family for name in best}
        probes = [probe for probe in self.library.probes if probe.family in families]
        forms = [*probes, *self.library.departures(best)]
        effects = effects_of(best, self.library)
        tasks = [
            OnTopTask(GlanceTask((*effects, form), start.known(), start.sigmas, {}, {}), start.columns)
            for form in forms
        ]
        scores = self.workers.run(tasks, "free forms") if tasks else []
        return [
            FreeForm.of(form, score, self._departed_from(form, best))
            for form, score in zip(forms, scores, strict=True)
        ]

    def _departed_from(self, form: Effect, best: Hypothesis) -> float:
        """The first parameter, in its unit, of the effect of the best hypothesis that a form departs from."""
        values, largest = self.fits[best].values, 0.0
        for effect in (self.library[name] for name in best if name in form.of):
            largest = max(largest, abs(values.get(effect.key(effect.parameters[0]), (0.0,))[0]))
        return largest

    def _fit_likely(self, pairs: Sequence[Hypothesis]) -> None:
        if not pairs:
            return
        singles = [[self.fits[(name,)] for name in pair] for pair in pairs]
        starts = [max(known, key=lambda f: f.log_evidence) for known in singles]
        found = self._screened(pairs, starts, "pairs of effects")
        self.fits.update(zip(pairs, found, strict=True))

    def _strength(self, effects: Hypothesis) -> float:
        """Of the weakest effect, in posterior sd from none."""
        return min((strength(self.fits[effects], self.library[name]) for name in effects), default=math.inf)

    def ranked(self) -> list[Ranked]:
        """All hypotheses but pairs of which one effect is too weak to be there beside the other."""
        return self._rank({h: f for h, f in self.fits.items() if not self._weak(h)})

    def suspected(self, best: Hypothesis) -> Hypothesis | None:
        """The pair that would be more probable than the best hypothesis, were it not too weak."""
        first = self._rank(self.fits)[0].effects
        return first if first != best and self._weak(first) else None

    def _weak(self, effects: Hypothesis) -> bool:
        return len(effects) > 1 and self._strength(effects) < self.thresholds.second_strength

    def _rank(self, fits: dict[Hypothesis, Fit]) -> list[Ranked]:
        return rank(fits, self.library, self.thresholds.priors, self.thresholds.temperature)

    def goodness(self, effects: Hypothesis) -> Goodness:
        if effects not in self._goodness:
            found = self.fits.get(effects) or self.probes[effects]
            free = {scatter for name in effects for scatter in self.library[name].unsteady}
            self._goodness[effects] = check(
                found,
                self.runs,
                [s for s in self.model.scatters if s.name not in free],
                self.thresholds.goodness_p,
                self.thresholds.goodness_tolerated,
            )
        return self._goodness[effects]
