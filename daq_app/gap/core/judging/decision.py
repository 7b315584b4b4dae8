"""The decision in words, from probabilities and what remains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from daq_app.gap.core.effects import Library
from daq_app.gap.core.fitting.fit import Fit
from daq_app.gap.core.judging.evidence import Answer, credible_set, strength
from daq_app.gap.core.judging.other_forms import is_other_form
from daq_app.gap.core.judging.remainder import Remainder
from daq_app.gap.core.policy import Policy
from daq_app.gap.core.result import Decision, Detection, verdict_of


@dataclass(frozen=True, slots=True)
class Usual:
    """As much of an effect as any sound specimen has, where the runs show it."""

    effect: str
    words: str
    sd: float
    """How many posterior sd it is from none."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a decision is made from."""

    library: Library
    answers: Sequence[Answer]
    """By what sensors can tell apart, most probable first, with other forms of the best hypothesis."""
    fit: Fit
    """Fit of the best hypothesis of the library."""
    rest: Remainder
    detection: Sequence[Detection]
    usual: Sequence[Usual] = ()

    @property
    def best(self) -> Answer:
        """The most probable answer of the library."""
        return next(a for a in self.answers if not is_other_form(a.effects, self.library))

    @property
    def other_form(self) -> float:
        """Probability that the family is right, and its form another than the library's."""
        return sum(a.probability for a in self.answers if is_other_form(a.effects, self.library))


def decide(evidence: Evidence, policy: Policy) -> tuple[Decision, str]:
    """The decision and the next measurement."""
    library, best, rest = evidence.library, evidence.best, evidence.rest
    if evidence.other_form >= policy.name_probability or (rest.unknown >= policy.refused and rest.form):
        return _another_form(evidence)
    if rest.unknown >= policy.refused:
        words = f"None of these: beside {describe(best, library)} {rest.words}."
        worst = rest.groups[0]
        advice = f"Look at the {worst.observable} of {worst.channel}."
        return Decision("none_of_these", (), "unknown", words, rest.unknown), advice
    if not best.effects:
        return _null(evidence, policy)
    sure = best.probability * rest.known(policy)
    words = describe(best, library)
    weakest = min(best.effects, key=lambda name: strength(evidence.fit, library[name]))
    sd = strength(evidence.fit, library[weakest])
    null = next((a.probability for a in evidence.answers if not a.effects), 0.0)
    members = credible_set(evidence.answers, policy.set_content)
    unseen = any(not a.effects for a in members) or best.probability >= policy.name_probability
    if sd < policy.detected_sd and null > policy.null_excluded and unseen:
        sentence = (
            f"{words} fits best, but at {sd:.1f} posterior sd it is below detection (nothing missing: "
            f"{100 * null:.0f} %){_would_need(evidence, weakest)}."
        )
        return _below_detection(best, weakest, sentence, sure)
    if best.probability >= policy.name_probability or len(members) == 1:
        sentence = f"{words} ({best.first.family}) explains the gap, probability {sure:.3f}"
        sentence += f"; {rest.words}." if rest.share > policy.cause_closes else "."
        verdict = verdict_of(len(best.effects))
        decision = Decision(verdict, best.effects, best.first.family, sentence, sure, best.others)
        return decision, _check_advice(library, best)
    return _cannot_tell(library, members)


def _below_detection(answer: Answer, weakest: str, sentence: str, probability: float) -> tuple[Decision, str]:
    advice = f"Repeat at the highest level: {weakest} needs a stronger signal."
    family = answer.first.family
    return Decision("below_detection", answer.effects, family, sentence, probability, answer.others), advice


def _would_need(evidence: Evidence, effect: str) -> str:
    """How strong an effect would have to be; empty where it has no size about zero."""
    limit = next((d for d in evidence.detection if d.effect == effect), None)
    return f"; it would have to be {limit.parameter} = {limit.limit:.2g} {limit.unit}" if limit else ""


def describe(answer: Answer, library: Library) -> str:
    """The hypothesis in words; effects that no sensor tells apart are all named, the likelier first."""
    if not answer.effects:
        return "nothing missing"
    words = []
    for name in answer.effects:
        if library[name].kind == "probe":
            words.append(f"another form of {library[name].family}")
            continue
        group = library.indistinguishable_from(name)
        if group is None:
            words.append(name)
            continue
        others = [n for r in answer.alternatives for n in r.effects if n in group.names and n != name]
        names = list(dict.fromkeys([name, *others]))
        words.append(" or ".join(names) + (", which no sensor here tells apart," if others else ""))
    return " + ".join(words).removesuffix(",")


def _another_form(evidence: Evidence) -> tuple[Decision, str]:
    """The family of the best hypothesis in a form that the library does not have."""
    library, best = evidence.library, evidence.best
    other = next((a for a in evidence.answers if is_other_form(a.effects, library)), None)
    family = evidence.rest.form or (other.first.family if other else best.first.family)
    words = (
        f"None of the library's effects, but the family is {family}: {describe(best, library)} comes near, "
        f"and a freer form on top of it gains more than our model of it can be wrong by."
    )
    advice = f"Look at the shape of the {family} map; add an effect of that form to the library."
    sure = max(evidence.rest.unknown, evidence.other_form)
    return Decision("none_of_these", (), family, words, sure), advice


def _null(evidence: Evidence, policy: Policy) -> tuple[Decision, str]:
    probability = evidence.best.probability * evidence.rest.known(policy)
    rivals = [a for a in evidence.answers if a.effects and not is_other_form(a.effects, evidence.library)]
    # What the runs themselves speak for, and only its rarity against, is more than nothing.
    least = evidence.best.first.log_evidence + policy.improved_nats
    shown = [a for a in rivals if a.first.log_evidence > least]
    candidates = shown or (rivals if evidence.best.probability < policy.null_probability else [])
    if candidates:
        weak = candidates[0]
        sentence = (
            f"Nothing is missing that these runs show (probability {probability:.2f}); "
            f"{describe(weak, evidence.library)} (probability {weak.probability:.2f}) is below detection"
            f"{_would_need(evidence, weak.effects[0])}."
        )
        return _below_detection(weak, weak.effects[0], sentence, probability)
    if seen := _usual(evidence, policy):
        return seen
    if evidence.rest.nominal > policy.parameters_gap * max(evidence.rest.after, 1.0):
        words = (
            "No effect is missing: other parameter values close the gap "
            f"({evidence.rest.nominal:.1f} times noise and scatter at the nominal ones)."
        )
        return Decision("parameters", (), "none", words, probability), "Use the fitted parameters."
    words = "Nothing is missing within noise and scatter."
    return Decision("nothing_missing", (), "none", words, probability), "None needed at these levels."


def _usual(evidence: Evidence, policy: Policy) -> tuple[Decision, str] | None:
    """What the runs show of an effect, and any sound specimen has; None where they show none."""
    shown = [u for u in evidence.usual if u.sd >= policy.usual_sd]
    alone = {a.effects: a for a in evidence.answers if len(a.effects) == 1}
    seen = max((u for u in shown if (u.effect,) in alone), key=lambda u: u.sd, default=None)
    if seen is None:
        return None
    probability = evidence.best.probability * evidence.rest.known(policy)
    sentence = (
        f"Nothing is missing that these runs show (probability {probability:.2f}); {seen.words} "
        f"is no more than is usual{_would_need(evidence, seen.effect)}."
    )
    answer = alone[(seen.effect,)]
    decision = Decision("below_detection", answer.effects, answer.first.family, sentence, probability)
    return decision, "Use the fitted parameters."


def _check_advice(library: Library, best: Answer) -> str:
    if len(best.alternatives) > 1:
        group = next(g for g in map(library.indistinguishable_from, best.effects) if g is not None)
        return f"To tell {' from '.join(group.names)}: {group.measure}."
    confusions = [c for name in best.effects for c in library[name].confusable_with]
    if not confusions:
        return "Repeat at another level to confirm the parameter."
    return f"To confirm against {confusions[0].effect}: {confusions[0].measure}."


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
    return Decision("cannot_tell", members[0].effects, family, words, total, members[0].others), advice
