"""What one run shows of a condition of the electronics, and the simulator's effect that does it."""

from __future__ import annotations

import math
from dataclasses import dataclass

EFFECT_SIZES: dict[str, str] = {
    "hum": "amplitude",
    "quantisation": "step",
    "dropout": "share",
    "saturation": "limit",
    "polarity": "on",
    "swap": "places",
}
"""Effect behind a finding, and the parameter that is its size."""


@dataclass(frozen=True, slots=True)
class RunFinding:
    """One condition of one channel or family in one run: 0 ± sd on a healthy one."""

    key: str
    """``hum@LV-A03``: the effect that explains it; or a plain word that no effect explains."""
    observable: str
    unit: str
    value: float
    sd: float
    family: str = ""
    """Family of the channel."""
    noise: float = math.nan
    """Rms noise of one reading of the family, in `unit`; NaN where it has another unit."""
