"""Findings: what is measured directly about an instrument or the floor, before any model is fitted.

A finding is taken out of the data by whoever measured it, so it never competes with a cause for a place
in a hypothesis; any number can be there at once. Material findings join the answer; the others are listed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong, or merely ordinary, about an instrument or the floor."""

    name: str
    """``hum@LV-A03``: what it is and of which channel or family."""
    words: str
    """For engineers: ``mains hum of 0.03 mm in the LVDTs``."""
    family: str
    probability: float
    """That it is there."""
    size: float
    low: float
    """Lower end of the 95 % interval of the size."""
    high: float
    unit: str
    where: str
    """Where it shows, e.g. ``5 of 8 runs``."""
    material: bool
    """Whether it belongs into the answer; an ordinary one is listed only."""
    parameter: str = ""
    """Name of its size; empty where it is not known what does this."""
    in_noise: float = math.nan
    """Size over the rms noise of one reading of its family; NaN where that has no meaning."""
    unknown: float = 0.0
    """Probability that it matters and that nobody knows what does it."""

    @property
    def explained(self) -> bool:
        """Whether it is known what does this."""
        return bool(self.parameter)


def material(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings that join the answer: material, and with an effect that does the same."""
    return tuple(f for f in findings if f.material and f.explained)


def unknown(findings: Sequence[Finding]) -> float:
    """Probability that any finding matters without it being known what does it."""
    return 1.0 - math.prod(1.0 - finding.unknown for finding in findings)
