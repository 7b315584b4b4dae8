"""A doubt about a family or channel: what kind, how large, what was done about it, in words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

Kind = Literal[
    "slow", "late", "gain", "zero", "hum", "reversed", "unit", "drift", "motion",
    "speed", "side", "loss", "pause", "hop", "duration", "scatter", "release",
    "misfit", "pivot", "bending", "alpha", "lean", "edge", "p", "slide", "slip", "turn",
    "hysteresis", "steps", "still", "leaps", "noise", "vibration",
]  # fmt: skip
Treatment = Literal["none", "left out", "put in step", "put right", "removed"]


@dataclass(frozen=True, slots=True)
class FamilyFinding:
    """One instrument, or a whole family, that disagrees with the rest; or the wall, with a rigid block."""

    family: str
    """``wires``, ``LVDTs``, ``tiltmeters``, ``accelerometers``, ``survey``, ``wall``, ``floor``; or several,
    joined by "or" where nothing says which of them it is."""
    channels: tuple[str, ...]
    """The channels concerned; none where it is the whole family."""
    kind: Kind
    size: float
    """SI; a share for gain, p, loss, pause, hop, scatter and release, the factor for unit, a change of r for
    speed, side and alpha, standard errors for duration, times the rig file's for noise, a count for leaps."""
    unit: str
    treatment: Treatment
    severity: Literal["info", "warning"]
    text: str
    """A sentence for the reader of the result."""


_NOT_THE_WALL: Final = frozenset({"steps", "still", "leaps", "motion", "slide", "slip"})
"""Kinds of finding by which a whole family does not even show how far the wall is held from upright; a slide
moves a zero that is taken from the rest."""


def families_left_out(findings: Iterable[FamilyFinding], *, held_as_well: bool = False) -> frozenset[str]:
    """Whole families that are left out, by name; `held_as_well`: those that tell nothing of the held wall."""
    return frozenset(
        finding.family
        for finding in findings
        if finding.treatment == "left out"
        and not finding.channels
        and (not held_as_well or finding.kind in _NOT_THE_WALL)
    )
