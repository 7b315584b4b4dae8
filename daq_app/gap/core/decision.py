"""From fits to a verdict. The thresholds are in one place, and `calibration` says how they are set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from daq_app.gap.core.effects import Library
from daq_app.gap.core.evidence import NULL, Answer, Priors, credible_set, strength
from daq_app.gap.core.fit import Fit
from daq_app.gap.core.goodness import Goodness
from daq_app.gap.core.other_forms import FreeForm, is_other_form, together
from daq_app.gap.core.result import Decision, Verdict


@dataclass(frozen=True, slots=True)
class Thresholds:
    """What a verdict needs."""

    name_probability: float = 0.90
    """An effect is named alone from this probability on."""
    minimum_strength: float = 4.0
    """Posterior sd below which an effect is `below_detection`."""
    second_strength: float = 5.0
    """Posterior sd that each effect of a pair needs: a second one also takes up what the first one's form
    leaves, so it needs more than an effect that stands alone."""
    probe_log_bayes: float = 6.0
    """Log evidence by which a probe must beat the best named hypothesis of its family to say that the
    family's form is unknown."""
    form_p: float = 0.005
    """Chance below which free forms of its family gain on top of the best hypothesis. It is one question,
    asked once; the gate asks hundreds."""
    form_share: float = 0.03
    """Share of what the best hypothesis gains over none that a free form of its family must gain on top of
    it: where an effect is strong, less than that is the limit of our model of it."""
    goodness_p: float = 1e-3
    goodness_tolerated: float = 0.35
    temperature: float = 1.0
    remainder: float = 0.15
    """Structure that a named hypothesis may leave in any group, as a share of the gap that it explains …"""
    closed: float = 0.95
    """… if it closes this share of the gap's excess over the floor …"""
    leftover: float = 1.25
    """… and the gap that it leaves is no larger than this."""
    parameters_gap: float = 1.3
    """Gap at nominal parameters, over the floor, from which the answer is "parameters"."""
    priors: Priors = field(default_factory=Priors)


@dataclass(slots=True)
class Material:
    """What the verdict is made from."""

    library: Library
    answers: Sequence[Answer]
    """By what sensors can tell apart, most probable first, with other forms of the best hypothesis."""
    fits: Mapping[tuple[str, ...], Fit]
    probes: Mapping[tuple[str, ...], Fit]
    goodness: Mapping[tuple[str, ...], Goodness]
    """Of the null, the best hypothesis and the best probe at least."""
    free_forms: Sequence[FreeForm]
    """Of the families and forms of the best hypothesis."""
    null_gap: float
    """Gap of the fit without any effect, in the noise and scatter units of the best hypothesis."""
    best_gap: float
    """Gap that the best hypothesis leaves in the runs it was fitted to, in the same units."""
    nominal_gap: float
    """Gap with all shared parameters at their nominal values, in noise and scatter units."""

    @property
    def best(self) -> Answer:
        """The most probable answer of the library: the best hypothesis is its first."""
        return next(a for a in self.answers if not is_other_form(a.effects, self.library))

    @property
    def other_form(self) -> float:
        """Probability that the family is right, and its form another than the library's."""
        return sum(a.probability for a in self.answers if is_other_form(a.effects, self.library))

    @property
    def margin(self) -> float:
        """Log evidence by which the best probe beats the best hypothesis; −inf without probes."""
        best = self.fits[self.best.effects].log_evidence
        return max((fit.log_evidence for fit in self.probes.values()), default=-math.inf) - best

    @property
    def rest_p(self) -> float:
        """Chance of the largest departure from the best hypothesis, were it right.

        The smallest of the gate's, that of free forms on top of it, and the odds against the best probe.
        """
        gate = self.goodness[self.best.effects].p_value
        return min(gate, together(self.free_forms), math.exp(-max(self.margin, 0.0)))


def decide(material: Material, thresholds: Thresholds) -> tuple[Decision, str]:
    """The verdict and the next measurement."""
    library, best = material.library, material.best
    unexplained = _unexplained(material, thresholds)
    if unexplained is not None:
        return unexplained
    if not best.effects:
        return _null(material, thresholds)
    fit = material.fits[best.effects]
    words = describe(best, library)
    weakest = min(strength(fit, library[name]) for name in best.effects)
    null = next((a.probability for a in material.answers if not a.effects), 0.0)
    others = tuple(r.effects for r in best.alternatives[1:])
    members = credible_set(material.answers)
    # Too weak to be sure that it is there at all; or it is there, and which of several it is stays open.
    unseen = any(not a.effects for a in members) or best.probability >= thresholds.name_probability
    if weakest < thresholds.minimum_strength and null > 1e-3 and unseen:
        sentence = (
            f"{words} fits best, but at {weakest:.1f} posterior sd it is below detection "
            f"(nothing missing: {100 * null:.0f} %)."
        )
        advice = f"Repeat at the highest level: {library[best.effects[0]].name} needs a stronger signal."
        return Decision(
            "below_detection", best.effects, best.first.family, sentence, best.probability, others
        ), advice
    if best.probability >= thresholds.name_probability or len(members) == 1:
        verdict: Verdict = "effect" if len(best.effects) == 1 else "pair"
        sentence = f"{words} ({best.first.family}) explains the gap, probability {best.probability:.3f}."
        decision = Decision(verdict, best.effects, best.first.family, sentence, best.probability, others)
        return decision, _check_advice(library, best)
    return _cannot_tell(library, members)


def describe(answer: Answer, library: Library) -> str:
    """The hypothesis in words; effects that no sensor tells apart are all named, the likelier first."""
    if not answer.effects:
        return "nothing missing"
    words = []
    for name in answer.effects:
        if library[name].kind == "probe":
            words.append(f"another form of {library[name].family}")
            continue
        alike = library.alike_to(name)
        if alike is None:
            words.append(name)
            continue
        others = [n for r in answer.alternatives for n in r.effects if n in alike.names and n != name]
        names = list(dict.fromkeys([name, *others]))
        words.append(" or ".join(names) + (", which no sensor here tells apart," if others else ""))
    return " + ".join(words).removesuffix(",")


def _unexplained(material: Material, thresholds: Thresholds) -> tuple[Decision, str] | None:
    """None of these: the best hypothesis fails the gate, or a probe sees more than it explains."""
    best = material.best
    good = material.goodness[best.effects]
    explained = good.passed or _forgiven(material, thresholds, good)
    leader = max(material.probes, key=lambda k: material.probes[k].log_evidence, default=None)
    margin = material.margin
    if explained and margin < thresholds.probe_log_bayes:
        return _another_form(material, thresholds)
    if leader is not None and margin >= thresholds.probe_log_bayes:
        family = material.library[leader[-1]].family
        probe_good = material.goodness.get(leader)
        words = (
            f"None of the library's effects, but the family is {family}: a free form there fits better than "
            f"{material.fits[best.effects].name} by {margin:.0f} in log evidence."
        )
        if probe_good is not None and not probe_good.passed:
            words += f" Even that leaves structure: {probe_good.worst}."
        return _of_family(family, words, best)
    words = (
        f"None of these: the best hypothesis ({material.fits[best.effects].name}) does not pass the "
        f"goodness-of-fit gate: {good.worst}."
    )
    return (
        Decision("none_of_these", (), "unknown", words, 0.0),
        f"Look where the remaining gap lies: {good.worst}.",
    )


def _another_form(material: Material, thresholds: Thresholds) -> tuple[Decision, str] | None:
    """The family of the best hypothesis in a form that the library does not have."""
    best = material.best
    if not best.effects or not material.free_forms:
        return None
    form = min(material.free_forms, key=lambda f: f.p_value)
    chance = together(material.free_forms)
    explained = material.fits[NULL].objective - material.fits[best.effects].objective
    seen = chance < thresholds.form_p and form.gain >= thresholds.form_share * explained
    if not seen and material.other_form < thresholds.name_probability:
        return None
    words = (
        f"None of the library's effects, but the family is {form.family}: "
        f"{describe(best, material.library)} comes near, and a freer form on top of it ({form.equation}) "
        f"gains {form.gain:.0f} in log posterior (p = {chance:.0e} over {len(material.free_forms)} tried)."
    )
    return _of_family(form.family, words, best)


def _of_family(family: str, words: str, best: Answer) -> tuple[Decision, str]:
    advice = f"Look at the shape of the {family} map; add an effect of that form to the library."
    return Decision("none_of_these", (), family, words, 1.0 - best.probability), advice


def _forgiven(material: Material, thresholds: Thresholds, good: Goodness) -> bool:
    """Whether what a named hypothesis leaves is a limit to be stated rather than another cause.

    No model is perfect: where an effect explains nearly all of a large gap, a small rest in one group
    does not speak for something else. A form that is only near the true one leaves more.
    """
    best = material.best
    if not best.effects or good.excessive_scatter:
        return False
    closed = 1.0 - max(material.best_gap**2 - 1.0, 0.0) / max(material.null_gap**2 - 1.0, 1e-9)
    small = good.worst_size < thresholds.remainder * material.null_gap
    return small and closed >= thresholds.closed and material.best_gap < thresholds.leftover


def _null(material: Material, thresholds: Thresholds) -> tuple[Decision, str]:
    probability = material.best.probability
    if material.nominal_gap > thresholds.parameters_gap:
        words = (
            "No effect is missing: other parameter values close the gap "
            f"({material.nominal_gap:.1f} times noise and scatter at the nominal ones)."
        )
        return Decision("parameters", (), "none", words, probability), "Use the fitted parameters."
    words = "Nothing is missing within noise and scatter."
    return Decision("nothing_missing", (), "none", words, probability), "None needed at these levels."


def _check_advice(library: Library, best: Answer) -> str:
    if len(best.alternatives) > 1:
        alike = next(group for group in map(library.alike_to, best.effects) if group is not None)
        return f"To tell {' from '.join(alike.names)}: {alike.measure}."
    own = [c for name in best.effects for c in library[name].confusable_with]
    if not own:
        return "Repeat at another level to confirm the parameter."
    return f"To confirm against {own[0].effect}: {own[0].measure}."


def _cannot_tell(library: Library, members: Sequence[Answer]) -> tuple[Decision, str]:
    names = [describe(m, library) for m in members]
    advice = ""
    if len(members) > 1:
        first, second = set(members[0].effects), set(members[1].effects)
        for a in sorted(first - second):
            for b in sorted(second - first):
                advice = advice or (library.separating_measurement(a, b) or "")
    families = {m.first.family for m in members}
    family = members[0].first.family if len(families) == 1 else "several"
    if not advice:
        advice = "Repeat over more levels; the held-out score of each hypothesis is in the report."
    words = "Cannot tell " + " from ".join(names[:4]) + f": {advice.rstrip('.')}."
    total = sum(m.probability for m in members)
    others = tuple(r.effects for r in members[0].alternatives[1:])
    return Decision("cannot_tell", members[0].effects, family, words, total, others), advice
