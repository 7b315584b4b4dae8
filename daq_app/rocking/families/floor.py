"""Does the floor shake? What the accelerometers show together while the wall stands at rest."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.means import block_means

Floats = NDArray[np.float64]

SHAKES_M_S2: Final = 0.02
"""Common acceleration at rest, rms, from which a floor is said to shake: one of 0.035 moves r by up to 0.005.
Raising it leaves such floors unsaid."""
_MEAN_S: Final = 0.025
_SHORTEST_S: Final = 0.7
"""A wave of 1.5 Hz shows most of its size in such a time."""
_TOGETHER: Final = 3.0
"""What all show over what single ones show beside it. Raising it overlooks floors in noisy laboratories;
lowering it takes loose cables for a floor."""


def shaking_of_floor(rest: Floats, rate_hz: float) -> float | None:
    """Rms acceleration, m/s², that horizontal accelerometers, (k, n), share at rest; None where it is none.

    A common wave is that of the ground under the wall; noise and loose cables are each channel's own.
    """
    size = max(1, round(_MEAN_S * rate_hz))
    if rest.shape[0] < 2 or rest.shape[1] < _SHORTEST_S * rate_hz:
        return None
    means = block_means(rest, size)
    means = means[:, np.isfinite(means).all(axis=0)]
    if means.shape[1] * size < _SHORTEST_S * rate_hz:
        return None
    means = means - means.mean(axis=1, keepdims=True)
    common = np.median(means, axis=0)
    own = float(np.median(np.std(means - common, axis=1)))
    rms = float(np.std(common))
    return rms if rms > max(SHAKES_M_S2, _TOGETHER * own) else None
