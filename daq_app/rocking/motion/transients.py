"""Impact times from the accelerometers: when the shock arrives, to a fraction of a millisecond."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_REACH_S = 0.03
_SHOCK_SIGMAS = 8.0
_AGREE_S = 1.5e-3
_MIN_SAMPLES = 16


@dataclass(frozen=True, slots=True)
class Accelerations:
    """What accelerometers show: sample k lies at first_s + k / rate + its channel's offset."""

    read: Callable[[int, int], Floats]
    """(start, stop) → acceleration (channels, stop − start), any unit."""
    n_samples: int
    rate_hz: float
    first_s: float
    offsets_s: Sequence[float]


@dataclass(frozen=True, slots=True)
class Onset:
    """The shock of one impact."""

    time_s: float
    """Median over the channels that show it, known time offsets taken out."""
    channels: int


def find_onsets(shown: Accelerations, impacts_s: Sequence[float]) -> list[Onset | None]:
    """Shock near each impact time; None where fewer than two channels show one and agree.

    Only what lies about the impacts is read.
    Each channel is differenced (slow motion falls away, the shock stays), and its onset is where
    two variances, before and after, describe the window best (Akaike's criterion on a split).
    """
    first_s, rate_hz = shown.first_s, shown.rate_hz
    gaps = np.diff(np.asarray(impacts_s, dtype=np.float64), prepend=-math.inf, append=math.inf)
    windows: list[_Window] = []
    for k, impact in enumerate(impacts_s):
        reach = min(_REACH_S, 0.45 * gaps[k], 0.45 * gaps[k + 1])
        for channel, offset in enumerate(shown.offsets_s):
            low = max(round((impact - reach - first_s - offset) * rate_hz), 0)
            high = min(round((impact + reach - first_s - offset) * rate_hz), shown.n_samples)
            windows.append(_Window(k, channel, low, max(high, low)))
    if not windows:
        return [None] * len(impacts_s)
    start = min(window.start for window in windows)
    acceleration = shown.read(start, max(window.stop for window in windows))
    alike: dict[int, list[_Window]] = {}
    for window in windows:
        alike.setdefault(window.stop - window.start, []).append(window)
    picks_s: list[list[float]] = [[] for _ in impacts_s]
    for together in alike.values():
        parts = np.array([acceleration[w.channel, w.start - start : w.stop - start] for w in together])
        for window, (sample, strength) in zip(together, _picks(parts), strict=True):
            if strength >= _SHOCK_SIGMAS:
                time_s = first_s + (window.start + sample) / rate_hz + shown.offsets_s[window.channel]
                picks_s[window.impact].append(time_s)
    return [_agreement(picks) for picks in picks_s]


@dataclass(frozen=True, slots=True)
class _Window:
    """Samples start … stop of one channel about one impact."""

    impact: int
    channel: int
    start: int
    stop: int


def _picks(windows: Floats) -> list[tuple[float, float]]:
    """Sample of the onset in each window (channels, n) and its strength in sigmas, 0 where there is none."""
    if windows.shape[1] < 2 * _MIN_SAMPLES:
        return [(0.0, 0.0)] * windows.shape[0]
    known = np.asarray(np.isfinite(windows).all(axis=1))
    change = np.diff(np.where(known[:, None], windows, 0.0), axis=1)
    square = np.cumsum(change**2, axis=1)
    n = change.shape[1]
    split = np.arange(_MIN_SAMPLES // 2, n - _MIN_SAMPLES // 2)
    before = square[:, split - 1] / split
    after = (square[:, -1:] - square[:, split - 1]) / (n - split)
    tiny = 1e-12 * (square[:, -1:] / n + 1e-300)
    score = split * np.log(before + tiny) + (n - split) * np.log(after + tiny)
    best = split[np.argmin(score, axis=1)]
    rows = np.arange(best.size)
    noise = np.sqrt(square[rows, best - 1] / best)
    # The shock's own samples: those that the end of the window cuts off count as still.
    reached = best[:, None] + np.arange(_MIN_SAMPLES)
    shaken = np.abs(change[rows[:, None], np.minimum(reached, n - 1)]) * (reached < n)
    strength = np.divide(shaken.max(axis=1), noise, out=np.zeros(best.size), where=known & (noise > 0.0))
    # change[i] = window[i+1] − window[i]: the first shaken sample is best + 1, the shock came within
    # the sampling interval before it.
    return list(zip((best + 0.5).tolist(), strength.tolist(), strict=True))


def _agreement(picks_s: list[float]) -> Onset | None:
    """The onset that at least half of the picks, one of each channel that shows a shock, agree on."""
    if len(picks_s) < 2:
        return None
    middle = median(picks_s)
    near = [time for time in picks_s if abs(time - middle) <= _AGREE_S]
    if len(near) < max(2, (len(picks_s) + 1) // 2):
        return None
    return Onset(median(near), len(near))
