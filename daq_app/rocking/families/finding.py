"""A doubt about a family or channel: what kind, how large, what was done about it, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Family = Literal["wires", "LVDTs", "tiltmeters", "accelerometers", "survey"]
Kind = Literal["slow", "late", "gain", "zero", "hum", "reversed", "unit", "drift", "motion"]
Treatment = Literal["none", "left out", "put in step", "put right", "removed"]


@dataclass(frozen=True, slots=True)
class FamilyFinding:
    """One instrument, or a whole family, that disagrees with the rest."""

    family: str
    """A `Family`, or several joined by "or" where nothing says which of them it is."""
    channels: tuple[str, ...]
    """The channels concerned; none where it is the whole family."""
    kind: Kind
    size: float
    """SI; a share for gain, the factor for unit."""
    unit: str
    treatment: Treatment
    severity: Literal["info", "warning"]
    text: str
    """A sentence for the reader of the result."""
