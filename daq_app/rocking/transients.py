"""Impact times from the accelerometers: when the shock arrives, to a fraction of a millisecond."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_REACH_S = 0.03
_SHOCK_SIGMAS = 8.0
_AGREE_S = 1.5e-3
_MIN_SAMPLES = 16


@dataclass(frozen=True, slots=True)
class Onset:
    """The shock of one impact."""

    time_s: float
    """Median over the channels that show it, known time offsets taken out."""
    spread_s: float
    """Median absolute deviation of those channels."""
    channels: int
    strength_sigmas: float
    """Largest shock over the noise before it, of the clearest channel."""


def find_onsets(
    acceleration: Floats,
    rate_hz: float,
    first_s: float,
    offsets_s: Sequence[float],
    impacts_s: Sequence[float],
) -> list[Onset | None]:
    """Shock near each impact time; None where fewer than two channels show one and agree.

    `acceleration` (channels, n) in any unit, sample k at first_s + k / rate + its channel's offset.
    Each channel is differenced (slow motion falls away, the shock stays), and its onset is where
    two variances, before and after, describe the window best (Akaike's criterion on a split).
    """
    gaps = np.diff(np.asarray(impacts_s, dtype=np.float64), prepend=-math.inf, append=math.inf)
    found: list[Onset | None] = []
    for k, impact in enumerate(impacts_s):
        reach = min(_REACH_S, 0.45 * gaps[k], 0.45 * gaps[k + 1])
        picks = []
        for row, offset in zip(acceleration, offsets_s, strict=True):
            low = round((impact - reach - first_s - offset) * rate_hz)
            high = round((impact + reach - first_s - offset) * rate_hz)
            pick = _pick(row[max(low, 0) : max(high, 0)])
            if pick is not None:
                picks.append((first_s + (max(low, 0) + pick[0]) / rate_hz + offset, pick[1]))
        found.append(_agreement(picks))
    return found


def _pick(window: Floats) -> tuple[float, float] | None:
    """Sample of the onset in the window and its strength; None where there is no shock."""
    if window.size < 2 * _MIN_SAMPLES or not np.isfinite(window).all():
        return None
    change = np.diff(window)
    square = np.cumsum(change**2)
    n = change.size
    split = np.arange(_MIN_SAMPLES // 2, n - _MIN_SAMPLES // 2)
    before = square[split - 1] / split
    after = (square[-1] - square[split - 1]) / (n - split)
    tiny = 1e-12 * (square[-1] / n + 1e-300)
    score = split * np.log(before + tiny) + (n - split) * np.log(after + tiny)
    best = int(split[np.argmin(score)])
    noise = math.sqrt(float(square[best - 1]) / best)
    shock = float(np.abs(change[best : best + _MIN_SAMPLES]).max())
    if noise <= 0.0 or shock < _SHOCK_SIGMAS * noise:
        return None
    # change[i] = window[i+1] − window[i]: the first shaken sample is best + 1, the shock came within
    # the sampling interval before it.
    return best + 0.5, shock / noise


def _agreement(picks: list[tuple[float, float]]) -> Onset | None:
    if len(picks) < 2:
        return None
    times = np.array([time for time, _ in picks])
    middle = float(np.median(times))
    near = np.abs(times - middle) <= _AGREE_S
    if np.count_nonzero(near) < max(2, (times.size + 1) // 2):
        return None
    time = float(np.median(times[near]))
    spread = float(np.median(np.abs(times[near] - time)))
    return Onset(time, spread, int(np.count_nonzero(near)), max(strength for _, strength in picks))
