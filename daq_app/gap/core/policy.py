"""Every threshold that decides in a diagnosis: quantity, unit, source, consequence.

Nothing outside this module decides by a number of its own. Search widths and tolerances, which cost time and
not answers, stand where they are used.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Policy:
    """The thresholds of one diagnosis."""

    finding_in_noise: float = 1.0
    """Size of a pick-up or of a reading step over the rms noise of one reading, from which it is material.
    Below it averaging over a half-cycle leaves nothing (assumed); raising it hides loud pick-up."""


POLICY = Policy()
