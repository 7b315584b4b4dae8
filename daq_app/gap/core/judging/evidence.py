"""Hypotheses, their probabilities and the 95 % set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from daq_app.gap.core.effects import Effect, Library
from daq_app.gap.core.fitting.fit import Fit
from daq_app.gap.core.parameters import NORMAL_95
from daq_app.gap.core.policy import POLICY, Policy

Hypothesis = tuple[str, ...]
"""Names of the effects that are missing, sorted."""
NULL: Hypothesis = ()


def log_prior(effects: Hypothesis, library: Library, policy: Policy) -> float:
    """ln prior probability of a hypothesis.

    What "nothing missing" leaves is shared by how many causes there are, then equally among the families,
    within a family among what sensors tell apart, and there among its effects: nothing is more probable for
    being written down in more forms.
    """
    if not effects:
        return math.log(policy.prior_null)
    count = len(effects)
    orders = math.log(math.factorial(count))
    return (
        math.log((1 - policy.prior_null) * policy.prior_count[count - 1])
        + math.fsum(_share(name, library) for name in effects)
        + orders
    )


def _share(name: str, library: Library) -> float:
    family = library[name].family
    siblings = [library.class_of([e.name]) for e in library.named if e.family == family]
    families = len({e.family for e in library.named})
    return -math.log(families * len(set(siblings)) * siblings.count(library.class_of([name])))


@dataclass(frozen=True, slots=True)
class Ranked:
    """One hypothesis with its probability."""

    effects: tuple[str, ...]
    family: str
    probability: float
    log_evidence: float


def rank(
    evidence: Mapping[Hypothesis, float],
    library: Library,
    policy: Policy,
    *,
    measured: bool = False,
) -> list[Ranked]:
    """Hypotheses by probability ∝ prior · evidence, most probable first; `evidence` is its logarithm.

    `measured`: something material was measured directly, beside which a first cause is a further one already.
    """
    logs = {
        effects: log_prior(effects, library, policy)
        + value
        - policy.further_nats * max(len(effects) - (not measured), 0)
        for effects, value in evidence.items()
    }
    top = max(logs.values())
    weights = {effects: math.exp(value - top) for effects, value in logs.items()}
    total = math.fsum(weights.values())
    ranked = [
        Ranked(effects, family_of(effects, library), weight / total, evidence[effects])
        for effects, weight in weights.items()
    ]
    return sorted(ranked, key=lambda r: (-r.probability, len(r.effects), r.effects))


def inclusion(ranked: Sequence[Ranked]) -> dict[str, float]:
    """Posterior inclusion probabilities (Barbieri and Berger, Ann. Stat. 32, 2004)."""
    found: dict[str, float] = {}
    for entry in ranked:
        for name in entry.effects:
            found[name] = found.get(name, 0.0) + entry.probability
    return found


def family_of(effects: tuple[str, ...], library: Library) -> str:
    """Family of a hypothesis; families of several joined by `` + ``."""
    return " + ".join(dict.fromkeys(library[name].family for name in effects)) or "none"


@dataclass(frozen=True, slots=True)
class Answer:
    """One hypothesis, or several that differ only by effects that no sensor tells apart."""

    alternatives: tuple[Ranked, ...]
    """Most probable first."""

    @property
    def first(self) -> Ranked:
        return self.alternatives[0]

    @property
    def effects(self) -> tuple[str, ...]:
        return self.first.effects

    @property
    def others(self) -> tuple[tuple[str, ...], ...]:
        """Effects of the alternatives beside the first."""
        return tuple(r.effects for r in self.alternatives[1:])

    @property
    def probability(self) -> float:
        """Probability of the whole class: which of its forms it is, no recording can say."""
        return math.fsum(r.probability for r in self.alternatives)


def answers(ranked: Sequence[Ranked], library: Library) -> list[Answer]:
    """Hypotheses by what sensors can tell apart, most probable first."""
    groups: dict[tuple[str, ...], list[Ranked]] = {}
    for hypothesis in ranked:
        groups.setdefault(library.class_of(hypothesis.effects), []).append(hypothesis)
    return sorted((Answer(tuple(g)) for g in groups.values()), key=lambda a: -a.probability)


def credible_set(found: Sequence[Answer], content: float = POLICY.set_content) -> list[Answer]:
    """Smallest set of answers that holds `content` of the probability."""
    kept, total = [], 0.0
    for answer in found:
        kept.append(answer)
        total += answer.probability
        if total >= content:
            break
    return kept


def strength(found: Fit, effect: Effect) -> float:
    """How many posterior sd an effect is from none.

    By the parameters that know a zero, which is none: on a linear scale about zero. One about something else
    is a form of the effect (how evenly a force falls), and its prior's centre is as much of an effect as any
    other value. Where an effect has logarithmic scales only, the parameter that is known worst counts, by
    how many of its sd its value is: a time of 80 ± 20 ms is 4 sd.
    """
    zeros = [effect.key(p) for p in effect.parameters if p.scale == "linear" and p.mean == 0.0]
    if zeros:
        return found.strength(effect.name, zeros)
    widths = [
        math.log(high / low) / (2.0 * NORMAL_95)
        for _, low, high in (found.values[effect.key(p)] for p in effect.shared if p.scale == "log")
        if low > 0.0
    ]
    return 1.0 / max(widths) if widths and max(widths) > 0.0 else math.inf
