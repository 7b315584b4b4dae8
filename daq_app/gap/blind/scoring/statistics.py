"""The few statistics of a score: intervals of shares and medians, calibration, separation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_Z95: Final = 1.959963984540054
_RESAMPLES: Final = 2000
_BINS: Final = 10
"""Equal parts of the claimed probability, 0 to 1."""
_DEAR_RESAMPLES: Final = 500
"""Of statistics that cost more than a median."""


@dataclass(frozen=True, slots=True)
class Value:
    """A number with its 95 % interval and how many cases it stands on; NaN where there are none."""

    value: float
    low: float
    high: float
    n: int


def number(value: float) -> str:
    """Three significant digits; a dash where there is none."""
    return "–" if not math.isfinite(value) else f"{value:.3g}"


NOTHING: Final = Value(math.nan, math.nan, math.nan, 0)


def share(flags: Sequence[bool]) -> Value:
    """Share of true flags with Wilson's interval."""
    n = len(flags)
    if n == 0:
        return NOTHING
    p = sum(flags) / n
    z2 = _Z95**2
    centre = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = _Z95 * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    # Rounding leaves 1e-18 where no flag is true, and as little to one where all are.
    low, high = 0.0 if p == 0.0 else centre - half, 1.0 if p == 1.0 else centre + half
    return Value(p, low, high, n)


def bootstrap(
    values: Sequence[float], statistic: Callable[[NDArray[np.float64]], float] = np.median
) -> Value:
    """A statistic of numbers with its percentile bootstrap interval (2000 resamples, fixed seed)."""
    data = np.array([v for v in values if math.isfinite(v)], dtype=np.float64)
    return _resampled(statistic, data) if data.size else NOTHING


def _resampled(statistic: Callable[..., float], *groups: NDArray[Any], resamples: int = _RESAMPLES) -> Value:
    """A statistic of one or several groups of cases, each drawn anew by itself (first axis)."""
    rng = np.random.default_rng(0)
    draws = [
        float(statistic(*(group[rng.integers(0, len(group), len(group))] for group in groups)))
        for _ in range(resamples)
    ]
    low, high = np.quantile(draws, [0.025, 0.975])
    return Value(float(statistic(*groups)), float(low), float(high), sum(map(len, groups)))


@dataclass(frozen=True, slots=True)
class Bin:
    """One bar of a reliability diagram."""

    claimed: float
    """Mean claimed probability."""
    found: Value
    """Share that was right."""


def reliability(claimed: Sequence[float], right: Sequence[bool]) -> list[Bin]:
    """Claimed probability against the share that was right, in equal bins; empty bins left out."""
    p, hit = np.asarray(claimed, dtype=np.float64), np.asarray(right, dtype=bool)
    index = np.minimum((p * _BINS).astype(int), _BINS - 1)
    return [
        Bin(float(p[index == k].mean()), share(hit[index == k].tolist()))
        for k in range(_BINS)
        if np.any(index == k)
    ]


def calibration_error(claimed: Sequence[float], right: Sequence[bool]) -> float:
    """Expected calibration error: Σ n_bin/n · |claimed − found|; NaN without cases."""
    found = reliability(claimed, right)
    n = sum(b.found.n for b in found)
    return sum(b.found.n * abs(b.claimed - b.found.value) for b in found) / n if n else math.nan


def calibration(claimed: Sequence[float], right: Sequence[bool]) -> Value:
    """Expected calibration error with its bootstrap interval over the cases."""
    cases = np.column_stack([claimed, right])
    if not len(cases):
        return NOTHING
    return _resampled(lambda drawn: calibration_error(*drawn.T), cases, resamples=_DEAR_RESAMPLES)


def calibration_error_by_chance(claimed: Sequence[float]) -> Value:
    """Calibration error of answers that are right exactly as often as they claim: mean and 95 % range.

    A bin of few cases is off by chance alone, so the error of a finite number of cases is never zero.
    """
    p = np.asarray(claimed, dtype=np.float64)
    if not p.size:
        return NOTHING
    index = np.minimum((p * _BINS).astype(int), _BINS - 1)
    right = np.random.default_rng(0).random((_RESAMPLES, p.size)) < p
    off = [np.abs((right - p)[:, index == k].sum(axis=1)) for k in range(_BINS)]
    errors = np.sum(off, axis=0) / p.size
    low, high = np.quantile(errors, [0.025, 0.975])
    return Value(float(errors.mean()), float(low), float(high), p.size)


def auroc(positive: Sequence[float], negative: Sequence[float]) -> float:
    """Probability that a positive scores above a negative, ties half; NaN if one side is empty."""
    a, b = np.asarray(positive, dtype=np.float64), np.asarray(negative, dtype=np.float64)
    if not a.size or not b.size:
        return math.nan
    above = (a[:, None] > b[None, :]).mean()
    equal = (a[:, None] == b[None, :]).mean()
    return float(above + 0.5 * equal)


def auroc_interval(positive: Sequence[float], negative: Sequence[float]) -> Value:
    """AUROC with its bootstrap interval over both groups."""
    if not (positive and negative):
        return NOTHING
    return _resampled(auroc, np.asarray(positive), np.asarray(negative), resamples=_DEAR_RESAMPLES)


def at_false_alarms(negative: Sequence[float], share_of_false: float) -> float:
    """Lowest threshold (flag if score > threshold) that flags at most this share of the negatives."""
    ranked = np.sort(np.asarray(negative, dtype=np.float64))[::-1]
    if not ranked.size:
        return math.nan
    allowed = int(share_of_false * ranked.size)
    return float(ranked[min(allowed, ranked.size - 1)])
