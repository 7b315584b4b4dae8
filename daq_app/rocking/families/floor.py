"""Does the floor shake? What the accelerometers show together while the wall stands at rest."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.means import block_means

Floats = NDArray[np.float64]

_SHAKES_M_S2: Final = 0.02
"""Common acceleration at rest, rms, from which a floor is said to shake: one of 0.035 moves r by up to 0.005.
Raising it leaves such floors unsaid."""
_MEAN_S: Final = 0.025
_FEWEST: Final = 3
"""Accelerometers from which a straight line says how well it fits."""
_SHORTEST_S: Final = 0.7
"""A wave of 1.5 Hz shows most of its size in such a time."""
_STANDS_OUT: Final = 4.0
"""The same over what noise and loose cables leave of it. Raising it overlooks floors in noisy laboratories;
lowering it takes loose cables for a floor."""
_LEAST_SPAN_M: Final = 0.5
"""Heights that tell a floor, which moves all alike, from a wall that rocks, which moves its top most."""


def shaking_of_floor(rest: Floats, heights_m: Floats, rate_hz: float) -> float | None:
    """Rms acceleration, m/s², of the ground under horizontal accelerometers (k, n) at rest; None for none.

    `heights_m`: (k,). A wall that rocks on its joint accelerates with the height: the ground's part is what a
    straight line through the heights leaves at the base.
    """
    size = max(1, round(_MEAN_S * rate_hz))
    if rest.shape[0] < _FEWEST or np.ptp(heights_m) < _LEAST_SPAN_M or rest.shape[1] < _SHORTEST_S * rate_hz:
        return None
    means = block_means(rest, size)
    means = means[:, np.isfinite(means).all(axis=0)]
    if means.shape[1] * size < _SHORTEST_S * rate_hz:
        return None
    means = means - means.mean(axis=1, keepdims=True)
    design = np.column_stack([np.ones(heights_m.size), heights_m])
    to_line = np.linalg.pinv(design)
    line = to_line @ means
    left = means - design @ line
    own = float(np.sqrt(np.sum(left**2) / (left.shape[1] * (heights_m.size - 2)) * np.sum(to_line[0] ** 2)))
    rms = float(np.std(line[0]))
    return rms if rms > max(_SHAKES_M_S2, _STANDS_OUT * own) else None
