"""Another form of the family: how far do the runs bear out the one form that the library has?

A law of nature is no straight line because the library has one. Where an effect is strong its form shows;
where it is only just there, other forms of its family look the same, and to name it for certain would claim
too much.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import chi2, norm

from daq_app.gap.core.effects import Effect, Library
from daq_app.gap.core.fitting.screen import Score
from daq_app.gap.core.judging.evidence import Ranked, family_of
from daq_app.gap.core.policy import POLICY

_LARGEST: Final = 300.0
"""Logarithm of the largest factor that is told from certainty."""


@dataclass(frozen=True, slots=True)
class FreeForm:
    """Score test of a probe or a departure on top of the best hypothesis."""

    name: str
    family: str
    equation: str
    gain: float
    """In log posterior."""
    p_value: float
    """Probability of a gain as large by chance, where the named form is the right one."""
    excess: float
    """Gain less one nat for each coefficient that the runs determine (Akaike, IEEE Trans. Autom. Control 19,
    1974): half of it is what chance gives, the other half what the next runs would lose again."""
    log_bayes: float = math.nan
    """Log of how much likelier what is seen is under another form of the family than under the named one.
    NaN for what is no departure."""

    @classmethod
    def of(cls, form: Effect, score: Score, strength: float = 0.0) -> FreeForm:
        """`strength`: the effect's own parameter that the form departs from, in its unit.

        Twice the gain is χ² where there is nothing to gain, with as many degrees of freedom as the runs
        determine coefficients of the form: r at five speeds includes r itself and its slope, which the model
        or the named form have already. What is determined in part makes the chance a little too large.
        """
        known = score.gain > 0.0 and score.determined > 0.0
        chance = float(chi2.sf(2.0 * score.gain, score.determined)) if known else 1.0
        return cls(
            form.name,
            form.family,
            form.equation,
            score.gain,
            chance,
            score.gain - score.determined,
            _log_bayes(score, form.typical * strength, form.directed),
        )


def _log_bayes(score: Score, typical: float, directed: bool) -> float:
    """Evidence for a coefficient of ± `typical`, half of it its sd, over one of nearly none; of `typical`
    alone where its sign is known (`directed`).

    Each is seen with the score's error. Another form is no form that departs by next to nothing.
    """
    if typical == 0.0 or not math.isfinite(score.error):
        return math.nan
    named_form = math.hypot(score.error, POLICY.own_form * typical)
    other_form = math.hypot(score.error, 0.5 * typical)
    sides = np.array([1.0] if directed else [-1.0, 1.0])
    elsewhere = np.logaddexp.reduce(norm.logpdf(score.coefficient, sides * typical, other_form))
    return float(elsewhere - math.log(sides.size) - norm.logpdf(score.coefficient, 0.0, named_form))


def with_other_forms(
    ranked: Sequence[Ranked], best: tuple[str, ...], forms: Sequence[FreeForm], library: Library, odds: float
) -> list[Ranked]:
    """The hypotheses with "the same, but in another form of its family", which the family's probe stands for.

    `forms` are those on top of the hypothesis `best`; `odds` are the prior odds of any other form against the
    library's. All other probabilities give way. The other forms have no fit: their evidence is the named
    form's and the Bayes factor, the mean over the departures of the family.
    """
    named = next(entry for entry in ranked if entry.effects == best)
    factors: dict[str, list[float]] = {}
    for form in forms:
        if math.isfinite(form.log_bayes):
            factors.setdefault(form.family, []).append(math.exp(min(form.log_bayes, _LARGEST)))
    probes = {probe.family: probe.name for probe in reversed(library.probes)}
    others = []
    for family in factors.keys() & probes.keys():
        factor = sum(factors[family]) / len(factors[family])
        effects = tuple(
            dict.fromkeys(sorted(probes[family] if library[n].family == family else n for n in best))
        )
        evidence = named.log_evidence + math.log(factor)
        others.append(
            Ranked(effects, family_of(effects, library), named.probability * odds * factor, evidence)
        )
    total = sum(entry.probability for entry in (*ranked, *others))
    reweighted = [replace(entry, probability=entry.probability / total) for entry in (*ranked, *others)]
    return sorted(reweighted, key=lambda r: (-r.probability, len(r.effects), r.effects))


def is_other_form(effects: Collection[str], library: Library) -> bool:
    """Whether a hypothesis is one of another form."""
    return any(library[name].kind == "probe" for name in effects)
