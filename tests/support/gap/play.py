"""A drum with play, as the tests put it on a wire."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt


def behind(reading_m: NDArray[np.float64], play_m: float, rate_hz: float) -> NDArray[np.float64]:
    """A reading (n,), m, of a drum that moves only once the slack on one side is used up.

    The drum follows the wall; the noise of the reading comes after it.
    """
    moved = sosfiltfilt(butter(4, 15.0, fs=rate_hz, output="sos"), reading_m)
    shown, held = np.empty_like(moved), moved[0]
    for k, value in enumerate(moved.tolist()):
        held = min(max(held, value - 0.5 * play_m), value + 0.5 * play_m)
        shown[k] = held
    return reading_m + shown - moved
