"""The result of a diagnosis, and its JSON (format version 2, see docs/reference/gap-result.md)."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from daq_app.gap.core.findings import Finding
from daq_app.gap.core.fitting.held_out import GapSize
from daq_app.gap.core.judging.evidence import Ranked
from daq_app.gap.core.judging.other_forms import FreeForm
from daq_app.gap.core.judging.remainder import Remainder
from daq_app.gap.core.judging.where import GapMap
from daq_app.plain import plain

FORMAT_VERSION: Final = 2

Verdict = Literal[
    "effect",
    "pair",
    "several",
    "parameters",
    "nothing_missing",
    "cannot_tell",
    "none_of_these",
    "below_detection",
]


NAMING: Final[tuple[Verdict, ...]] = ("effect", "pair", "several")
"""Verdicts that name one, two, or more things that are missing."""
NO_CAUSE: Final[tuple[Verdict, ...]] = ("nothing_missing", "parameters", "below_detection")
"""Verdicts that name none, as nothing that is missing shows."""


class CannotDiagnose(Exception):
    """The runs do not allow any diagnosis; the message says why and what to do."""

    def __init__(self, reason: str, what_to_do: str = "") -> None:
        super().__init__(f"{reason} {what_to_do}".strip())
        self.reason = reason
        self.what_to_do = what_to_do


def verdict_of(count: int) -> Verdict:
    """The verdict that names so many things; 1 or more."""
    return NAMING[min(count, len(NAMING)) - 1]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A parameter with its 95 % interval and its prior."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    prior_mean: float
    prior_sd: float
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Detection:
    """How strong an effect would have to be to be seen in these runs (four posterior sd)."""

    effect: str
    parameter: str
    limit: float
    unit: str


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause in the wall, the release or a sensor, judged given everything else."""

    name: str
    words: str
    family: str
    probability: float
    """That it is part of the answer, over all hypotheses."""
    estimates: tuple[Estimate, ...]
    closes: float
    """Share of the held-out gap that it alone closes; NaN with one run only."""
    material: bool
    """Whether it closes enough to be spoken of as a cause."""


@dataclass(frozen=True, slots=True)
class Decision:
    """The verdict with its reason in words."""

    verdict: Verdict
    effects: tuple[str, ...]
    family: str
    sentence: str
    confidence: float
    alternatives: tuple[tuple[str, ...], ...] = ()
    """Hypotheses that the answer stands for too: they differ from it only by effects that no sensor tells
    apart. `confidence` is that of all of them together."""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Everything a diagnosis says."""

    model: str
    runs: tuple[str, ...]
    where: GapMap
    which: tuple[Ranked, ...]
    set95: tuple[Ranked, ...]
    decision: Decision
    parameters: tuple[Estimate, ...]
    effect_parameters: tuple[Estimate, ...]
    scatter: tuple[Estimate, ...]
    gap: GapSize | None
    remaining: GapMap
    rest: Remainder
    probes: tuple[Ranked, ...]
    probe_shapes: dict[str, dict[str, tuple[float, float, float]]]
    """Probe → knot → (value, low, high): the non-parametric shape of what is missing."""
    detection: tuple[Detection, ...]
    next_measurement: str
    findings: tuple[Finding, ...] = ()
    """What was measured directly about instruments; material ones are part of the answer."""
    free_forms: tuple[FreeForm, ...] = ()
    """What freer forms of its families gain on top of the best hypothesis."""
    causes: tuple[Cause, ...] = ()
    """Causes that any hypothesis with a chance names, in the order of what they close."""
    limits: tuple[str, ...] = ()
    """Stated limits: one run only, channels left out, gaps in the record …"""
    seconds: float = 0.0
    notes: dict[str, Any] = field(default_factory=dict)

    @property
    def best(self) -> tuple[str, ...]:
        """The most probable hypothesis of the library: what was fitted, simulated and held out."""
        probes = {name for probe in self.probes for name in probe.effects}
        measured = {finding.name for finding in self.findings}
        first = next(entry.effects for entry in self.which if not probes.intersection(entry.effects))
        return tuple(name for name in first if name not in measured)

    @property
    def p_unknown(self) -> float:
        """Probability of something that is not in the library: unknown, or another form of a law."""
        probes = {name for probe in self.probes for name in probe.effects}
        forms = (entry.probability for entry in self.which if probes.intersection(entry.effects))
        return min(self.rest.unknown + math.fsum(forms), 1.0)

    def in_words(self, effects: tuple[str, ...]) -> str:
        """A hypothesis as people read it: a probe stands for another form of its family."""
        families = {name: probe.family for probe in self.probes for name in probe.effects}
        words = [f"another form of {families[name]}" if name in families else name for name in effects]
        return " + ".join(words) or "nothing missing"

    def to_dict(self) -> dict[str, Any]:
        """Plain data, with the keys of the documented format."""
        data: dict[str, Any] = plain(self)
        data["format"] = FORMAT_VERSION
        data["decision_detail"] = data["decision"]
        data["decision"] = self.decision.verdict
        data["p_unknown"] = plain(self.p_unknown)
        return data

    def to_json(self, indent: int | None = 1) -> str:
        return json.dumps(self.to_dict(), indent=indent, ensure_ascii=False, allow_nan=False)

    def save(self, path: Path) -> None:
        path.write_text(self.to_json(), encoding="utf-8")
