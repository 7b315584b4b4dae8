"""When the accelerometers show the impacts against when a rotation passes zero: how late one of them is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.motion.transients import Accelerations, find_onsets

Floats = NDArray[np.float64]

LATE_SHOCKS_S = 4e-3
"""Shocks further from the crossings than this are named late: a wall's contact lasts some milliseconds."""
_MOST_IMPACTS = 12
_REACH_S = 0.06
_BIN_S = 0.001
_CLIP = 30.0
"""A shock counts for no more than this many times the usual size: one knock is not the whole answer."""
_FEWEST = 3


@dataclass(frozen=True, slots=True)
class ShockTiming:
    """Shocks less zero crossings of the rotation."""

    lag_s: float
    """Median; positive where the shocks come after the crossings."""
    heard: int
    impacts: int


def shock_timing(shown: Accelerations, crossings_s: Sequence[float]) -> ShockTiming | None:
    """Lag of the shocks behind the first crossings; None where fewer than three impacts show one."""
    times = np.asarray(crossings_s, dtype=np.float64)[:_MOST_IMPACTS]
    if len(shown.offsets_s) < 2 or times.size < _FEWEST:
        return None
    first_s, rate_hz = shown.first_s, shown.rate_hz
    start = max(round((times[0] - 2 * _REACH_S - first_s) * rate_hz), 0)
    stop = min(round((times[-1] + 2 * _REACH_S - first_s) * rate_hz), shown.n_samples)
    if stop - start < rate_hz * 4 * _REACH_S:
        return None
    start_s = first_s + start / rate_hz + float(np.mean(shown.offsets_s))
    coarse = _coarse(shown.read(start, stop), rate_hz, start_s, times)
    if coarse is None:
        return None
    onsets = find_onsets(shown, (times + coarse).tolist())
    lags = [onset.time_s - time for onset, time in zip(onsets, times, strict=True) if onset is not None]
    if len(lags) < max(_FEWEST, times.size // 3):
        return None
    return ShockTiming(float(np.median(lags)), len(lags), int(times.size))


def _coarse(values: Floats, rate_hz: float, start_s: float, times: Floats) -> float | None:
    """The lag at which the accelerometers shake most, to a millisecond; None where none stands out."""
    change = np.abs(np.diff(np.nan_to_num(values), axis=1))
    usual = np.median(change, axis=1, keepdims=True)
    shaken = np.minimum(change / np.where(usual > 0.0, usual, np.inf), _CLIP).mean(axis=0)
    size = max(1, round(_BIN_S * rate_hz))
    groups = shaken.size // size
    envelope = shaken[: groups * size].reshape(groups, size).mean(axis=1)
    # A step from quiet to shaken: the onset, not the ringing after it.
    width = 5
    sums = np.concatenate(([0.0], np.cumsum(envelope)))
    rise = np.zeros(groups)
    rise[width:-width] = (
        sums[2 * width : -1] - 2.0 * sums[width : -width - 1] + sums[: -2 * width - 1]
    ) / width
    bins = np.round((times - start_s) * rate_hz / size).astype(np.intp)
    lags = np.arange(-round(_REACH_S / _BIN_S), round(_REACH_S / _BIN_S) + 1)
    places = bins[:, None] + lags
    inside = (places >= 0) & (places < groups)
    score = np.where(inside, rise[np.clip(places, 0, groups - 1)], 0.0).mean(axis=0)
    best = int(np.argmax(score))
    others = np.delete(score, slice(max(best - 6, 0), best + 7))
    if score[best] < 3.0 * max(float(np.std(others)), 1e-12):
        return None
    return float(lags[best]) * size / rate_hz
