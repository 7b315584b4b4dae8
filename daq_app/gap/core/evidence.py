"""Hypotheses, their probabilities and the 95 % set."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from daq_app.gap.core.effects import Effect, Library
from daq_app.gap.core.fit import Fit

NULL: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Priors:
    """Prior probabilities: of nothing missing, and of a pair against a single effect.

    The rest is shared equally among the families, and within a family among its effects: a family
    of many forms is not more probable because it was written down in more forms.
    """

    null: float = 0.2
    pair: float = 0.15
    other_form: float = 0.5
    """Odds of any other form of a law against the library's, where the law is one of an effect's family."""

    def log_prior(self, effects: tuple[str, ...], library: Library) -> float:
        if not effects:
            return math.log(self.null)
        per_effect = sum(self._share(name, library) for name in effects)
        if len(effects) == 1:
            return math.log((1 - self.null) * (1 - self.pair)) + per_effect
        return math.log((1 - self.null) * self.pair) + per_effect + math.log(2.0)

    @staticmethod
    def _share(name: str, library: Library) -> float:
        family = library[name].family
        siblings = sum(1 for e in library.named if e.family == family)
        families = len({e.family for e in library.named})
        return -math.log(families * siblings)


@dataclass(frozen=True, slots=True)
class Ranked:
    """One hypothesis with its probability."""

    effects: tuple[str, ...]
    family: str
    probability: float
    log_evidence: float


def rank(
    fits: Mapping[tuple[str, ...], Fit], library: Library, priors: Priors, temperature: float = 1.0
) -> list[Ranked]:
    """Hypotheses by probability ∝ prior · evidence^(1/temperature), most probable first.

    `temperature` above 1 flattens; it is what calibration sets so that probabilities mean what they say.
    """
    logs = {
        effects: priors.log_prior(effects, library) + found.log_evidence / temperature
        for effects, found in fits.items()
    }
    top = max(logs.values())
    weights = {effects: math.exp(value - top) for effects, value in logs.items()}
    total = sum(weights.values())
    ranked = [
        Ranked(effects, family_of(effects, library), weight / total, fits[effects].log_evidence)
        for effects, weight in weights.items()
    ]
    return sorted(ranked, key=lambda r: (-r.probability, len(r.effects), r.effects))


def family_of(effects: tuple[str, ...], library: Library) -> str:
    """Family of a hypothesis; families of a pair joined by `` + ``."""
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
    def probability(self) -> float:
        """Of the whole class: which of its forms it is, no recording can say."""
        return math.fsum(r.probability for r in self.alternatives)


def answers(ranked: Sequence[Ranked], library: Library) -> list[Answer]:
    """Hypotheses by what sensors can tell apart, most probable first."""
    groups: dict[tuple[str, ...], list[Ranked]] = {}
    for hypothesis in ranked:
        groups.setdefault(library.class_of(hypothesis.effects), []).append(hypothesis)
    return sorted((Answer(tuple(g)) for g in groups.values()), key=lambda a: -a.probability)


def credible_set(found: Sequence[Answer], content: float = 0.95) -> list[Answer]:
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
    other value. Of an effect that has logarithmic scales only, the one that is known worst counts, by how
    many of its sd its value is: a time of 80 ± 20 ms is 4 sd.
    """
    zeros = [effect.key(p) for p in effect.parameters if p.scale == "linear" and p.mean == 0.0]
    if zeros:
        return found.strength(effect.name, zeros)
    widths = [
        math.log(high / low) / 3.92
        for _, low, high in (found.values[effect.key(p)] for p in effect.shared if p.scale == "log")
        if low > 0.0
    ]
    return 1.0 / max(widths) if widths and max(widths) > 0.0 else math.inf


def pair_candidates(
    singles: Mapping[tuple[str, ...], Fit], library: Library, width: int = 6
) -> list[tuple[str, str]]:
    """Pairs worth fitting: the best single with every other, and all pairs of the best `width`.

    An effect masked by another does not stand out alone, which is why the best one is paired with
    everything and not only with the runners-up.
    """
    order = sorted((e for e in singles if len(e) == 1), key=lambda e: -singles[e].log_evidence)
    best = [e[0] for e in order[:width]]
    pairs = set()
    if best:
        pairs |= {tuple(sorted((best[0], e[0]))) for e in order[1:]}
    pairs |= {tuple(sorted(pair)) for pair in itertools.combinations(best, 2)}
    names = {e.name for e in library.named}
    return sorted((a, b) for a, b in pairs if a in names and b in names)
