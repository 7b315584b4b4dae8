"""What one run shows of a condition of the electronics, and the simulator's effect that does it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

EFFECT_SIZES: dict[str, str] = {
    "hum": "amplitude",
    "quantisation": "step",
    "dropout": "share",
    "saturation": "limit",
    "polarity": "on",
    "swap": "places",
    "ambient": "amplitude",
    "acceleration": "share",
    "noise": "factor",
    "sliding": "slip",
    "corner_twist": "turn",
}
"""Findings of which it is known what does them, and the parameter that is the size."""


@dataclass(frozen=True, slots=True)
class RunFinding:
    """One condition of one channel or family in one run: 0 ± sd on a healthy one."""

    key: str
    """``hum@LV-A03``: what it is, and who has it."""
    observable: str
    unit: str
    value: float
    sd: float
    noise: float = math.nan
    """Rms noise of one reading of the family, in `unit`; NaN where it has another unit."""

    @property
    def target(self) -> str:
        """The channel or family that has it; empty for a condition of the rig."""
        return self.key.partition("@")[2]

    @property
    def spoils(self) -> bool:
        """Whether the readings of who has it are not fit to be used."""
        return self.value > 0.0 and self.key.startswith(("quantisation", "dropout", "saturation", "spikes"))


def merged(*findings: Sequence[Sequence[RunFinding]]) -> list[list[RunFinding]]:
    """Findings of all runs, each run's own in the order given."""
    return [list(itertools.chain.from_iterable(rows)) for rows in zip(*findings, strict=True)]
