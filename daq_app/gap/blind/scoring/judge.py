"""One diagnosis against its label: what was claimed, and what of it is right."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any, Final, get_args

from daq_app.gap.blind.names import COMPARABLE, base_name, class_of, comparable, families_of
from daq_app.gap.blind.running.runner import Outcome
from daq_app.gap.core.result import NAMING, NO_CAUSE, Verdict

_CLEARLY_VISIBLE: Final = 4.0
"""Standard deviations from which an effect must be found."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One line of `which` or `set95`."""

    effects: tuple[str, ...]
    family: str
    probability: float


@dataclass(frozen=True, slots=True)
class Judged:
    """A diagnosis and what of it was right; None where the question does not arise."""

    case: str
    category: str
    truth: tuple[str, ...]
    families: tuple[str, ...]
    strength: float
    """Strength of the weakest effect, in standard deviations (detectability); infinite for null cases."""
    decision: str
    named: tuple[str, ...]
    """Effects of the answer; empty for answers that name none."""
    named_family: str
    claimed: float
    """Probability that the diagnosis gives its first answer: of all forms that no sensor tells apart. NaN
    where it names a measured fault that no effect does: its probabilities are then no claim about that."""
    first_right: bool
    """Whether the likeliest hypothesis is what was hidden."""
    named_right: bool
    """The same of what the decision names."""
    family_right: bool
    in_set: bool
    set_size: int
    """Forms that no sensor tells apart count once."""
    outside_score: float
    """How much it says "none of these", for ranking."""
    closure: float
    after_to_floor: float
    parameter_error: float
    """Relative error of the strength parameter; NaN where the names or units do not meet."""
    parameter_covered: bool | None
    next_measurement: str
    seconds: float
    known: bool
    """Whether the truth was among the hypotheses (an effect of the library) or what was measured directly."""
    laboratory: str = "own"
    failure: str = ""

    @property
    def visible(self) -> bool:
        return self.strength >= _CLEARLY_VISIBLE

    @property
    def blames(self) -> bool:
        return self.decision in NAMING

    @property
    def exact(self) -> bool:
        """Whether the decision names what was hidden, all of it and nothing else."""
        return self.blames and self.named_right

    @property
    def answered_rightly(self) -> bool:
        """Whether the decision as a whole was right, for the confusion matrix of decisions."""
        match self.category:
            case "null":
                return self.decision in NO_CAUSE
            case "outside" if not self.known:
                return self.decision == "none_of_these"
            case _:
                if self.decision == "cannot_tell":
                    return self.in_set and bool(self.next_measurement)
                return self.exact or (self.decision == "below_detection" and not self.visible)


def judge(label: dict[str, Any], outcome: Outcome) -> Judged:
    """Compare. A diagnosis that failed counts as one that said nothing.

    What a result measured directly about instruments (`findings`) is no cause and counts neither for nor
    against one; where such a fault is what was hidden, a material finding of it is the right answer.
    """
    result = outcome.result or {}
    findings = _findings(result.get("findings"))
    which = _hypotheses(result.get("which"), findings)
    set95 = _hypotheses(result.get("set95"), findings)
    effects = label["effects"]
    accept = [tuple(effect["accept"]) for effect in effects]
    sought = [names for names in accept if not _measured(names, findings)]
    decision = _decision(result, which, measured=len(sought) < len(accept))
    named, family, claimed = _answer(decision, result, which, findings)
    if decision != "none_of_these" and result.get("decision") == "none_of_these":
        claimed = math.nan
    gap = result.get("gap") or {}
    error, covered = _parameter(label, result, decision)
    return Judged(
        case=outcome.case,
        category=label["category"],
        truth=tuple(effect["name"] for effect in effects),
        families=tuple(effect["family"] for effect in effects),
        strength=min(label["detectability"], default=math.inf),
        decision=decision,
        named=named,
        named_family=family,
        claimed=claimed,
        first_right=bool(which) and _matches(_first(which)[0].effects, sought),
        named_right=_matches(named, sought),
        family_right=set(families_of(family)) == {effect["family"] for effect in effects},
        in_set=any(_matches(hypothesis.effects, sought) for hypothesis in set95),
        set_size=len({class_of(hypothesis.effects) for hypothesis in set95}),
        outside_score=_outside_score(decision, result, which),
        closure=_number(gap, "closure"),
        after_to_floor=_ratio(_number(gap, "after"), _number(gap, "floor")),
        parameter_error=error,
        parameter_covered=covered,
        next_measurement=str(result.get("next_measurement") or ""),
        seconds=outcome.seconds,
        known=any(_matches(hypothesis.effects, sought) for hypothesis in which),
        laboratory=str(label.get("laboratory", "own")),
        failure=outcome.failure,
    )


def _findings(entries: Any) -> dict[str, bool]:
    """Name of what was measured directly → whether it belongs into the answer."""
    return {str(entry.get("name", "")): bool(entry.get("material")) for entry in entries or []}


def _measured(names: Sequence[str], findings: Mapping[str, bool]) -> bool:
    """Whether a fault is among the material findings, under one of these names."""
    return any(material and base_name(name) in names for name, material in findings.items())


def _decision(result: dict[str, Any], which: Sequence[Hypothesis], measured: bool) -> str:
    """What was decided about causes: to name instruments' findings alone is to say that none is missing.

    Where such a finding is what was hidden (`measured`), the answer names an effect.
    """
    if not result:
        return "failed"
    decision = str(result.get("decision", ""))
    if decision not in get_args(Verdict):
        return "failed"
    if decision in NAMING and not measured and which and not _first(which)[0].effects:
        return "nothing_missing"
    if measured and decision in (*NO_CAUSE, "none_of_these") and which and not _first(which)[0].effects:
        return "effect"
    return decision


def _hypotheses(entries: Any, findings: Collection[str]) -> list[Hypothesis]:
    """Hypotheses about causes; what was measured directly is left out of them."""
    found = []
    for entry in entries or []:
        names = tuple(str(name) for name in entry.get("effects", ()) if str(name) not in findings)
        found.append(Hypothesis(names, str(entry.get("family", "")), float(entry.get("probability") or 0.0)))
    return sorted(found, key=lambda hypothesis: -hypothesis.probability)


def _answer(
    decision: str, result: dict[str, Any], which: Sequence[Hypothesis], findings: Collection[str]
) -> tuple[tuple[str, ...], str, float]:
    """(effects named, family named, claimed probability of the first hypothesis).

    A decision may name less than its first hypothesis has: a slip that was measured, and not what fits best
    beside it and is below detection. Forms that no sensor tells apart are named as that hypothesis has them.
    """
    first, claimed = _first(which) if which else (Hypothesis((), "", 0.0), 0.0)
    detail = result.get("decision_detail") or {}
    if decision not in NAMING:
        return (), str(detail.get("family") or ""), claimed
    decided = {str(name) for name in detail.get("effects", first.effects)}
    if findings and len(decided - set(findings)) < len(first.effects):
        return tuple(sorted(decided - set(findings))), str(detail.get("family") or ""), claimed
    return first.effects, first.family, claimed


def _first(which: Sequence[Hypothesis]) -> tuple[Hypothesis, float]:
    """(likeliest hypothesis, probability) of the most probable class of forms that no sensor tells apart.

    The scorer's own classes hold, not what a diagnosis says that it cannot tell apart.
    """
    classes: dict[tuple[str, ...], list[Hypothesis]] = {}
    for hypothesis in which:
        classes.setdefault(class_of(hypothesis.effects), []).append(hypothesis)
    best = max(classes.values(), key=lambda forms: math.fsum(h.probability for h in forms))
    return best[0], math.fsum(h.probability for h in best)


def _matches(claimed: Sequence[str], accept: Sequence[tuple[str, ...]]) -> bool:
    """Whether each hidden effect is claimed under an accepted name, and nothing else is."""
    if len(claimed) != len(accept):
        return False
    names = [base_name(name) for name in claimed]
    return any(
        all(name in accepted for name, accepted in zip(names, order, strict=True))
        for order in permutations(accept)
    )


def _outside_score(decision: str, result: dict[str, Any], which: Sequence[Hypothesis]) -> float:
    """How strongly a result speaks for "none of these", in [0, 2]; 1 and more where it decides so.

    Within a decision its probability of an unknown cause ranks, or what its first hypothesis leaves over.
    """
    given = result.get("p_unknown")
    left_over = 1.0 - (_first(which)[1] if which else 0.0)
    inner = min(1.0, max(0.0, float(given))) if isinstance(given, int | float) else left_over
    return inner + (1.0 if decision == "none_of_these" else 0.0)


def _parameter(label: dict[str, Any], result: dict[str, Any], decision: str) -> tuple[float, bool | None]:
    """Relative error and coverage of the strength of a single effect, where the two numbers compare.

    Names are ``zeta`` or ``viscous.zeta``. Which side is + is a matter of convention: a result with
    the other sign is turned round before it is compared.
    """
    effects = label["effects"]
    if label["category"] != "single" or decision != "effect" or effects[0]["name"] not in COMPARABLE:
        return math.nan, None
    wanted = COMPARABLE[effects[0]["name"]]
    truth = comparable(effects[0]["name"], float(next(iter(effects[0]["parameters"].values()))))
    for estimate in [*(result.get("effect_parameters") or []), *(result.get("parameters") or [])]:
        effect, dot, parameter = str(estimate.get("name", "")).rpartition(".")
        if parameter != wanted or (dot and base_name(effect) != effects[0]["name"]):
            continue
        try:
            value, low, high = (float(estimate[key]) for key in ("value", "low", "high"))
        except (KeyError, TypeError, ValueError):
            continue
        if value * truth < 0:
            value, low, high = -value, -high, -low
        return abs(value - truth) / abs(truth), low <= truth <= high
    return math.nan, None


def _number(values: dict[str, Any], key: str) -> float:
    value = values.get(key)
    return float(value) if isinstance(value, int | float) else math.nan


def _ratio(above: float, below: float) -> float:
    return above / below if below and math.isfinite(below) else math.nan
