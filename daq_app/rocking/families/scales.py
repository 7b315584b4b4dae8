"""Signs and units: families that show one wall with factors like −1, 10 or 57.3 between them.

Looked at before anything is known of the test, on means over a quarter of a second in which nothing moves: a
family of the wrong sign or unit hides the hold, so that no test would be found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.means import means_over

Floats = NDArray[np.float64]

_STEP_S = 0.05
_MEAN_S = 0.25
"""A period of a wall that rings at 4 Hz: shorter means of it are not still. Raising it loses short holds."""
_STILL_S = 0.75
_STILL_RAD = 1.5e-3
"""Largest change of a mean over that time that counts as still: the steadiness of a hold."""
_LEAST_SPAN_RAD = 5e-3
_ALIKE = 0.22
"""Difference of the logarithm of a ratio from a known factor's, of which the nearest two are 0.55 apart.
What a bent wall or a range that ends makes of a family at rest, a fifth of the rotation, is less; raising it
takes a twentieth for inches."""
_FACTORS = (1e3, 1e2, 180.0 / math.pi, 25.4, 10.0)
_FACTOR_WORDS = {
    1e3: "1000: a unit is wrong (m for mm)",
    1e2: "100: a unit is wrong",
    180.0 / math.pi: "57.3: degrees are taken for radians, or the other way round",
    25.4: "25.4: inches are taken for millimetres, or the other way round",
    10.0: "10: centimetres are taken for millimetres, or the other way round",
}


def wrong_scales(rotations: Mapping[str, Floats], rate_hz: float) -> dict[str, float]:
    """By family of `rotations` (n,): the factor by which it is wrong (−1: reversed); only those that are.

    A family is wrong where its ratio to another is such a factor and a third agrees with that other.
    """
    means = {family: _means(rotation, rate_hz) for family, rotation in rotations.items()}
    ratios: dict[tuple[str, str], float] = {}
    for one, other in combinations(means, 2):
        ratio = _ratio(means[one], means[other], rate_hz)
        if ratio is not None:
            ratios[one, other], ratios[other, one] = ratio, 1.0 / ratio
    wrong: dict[str, float] = {}
    for family in means:
        factors = {other: _factor(ratios[family, other]) for other in means if (family, other) in ratios}
        known = {other: factor for other, factor in factors.items() if factor is not None and factor != 1.0}
        agreeing = [
            (a, b)
            for a, b in combinations(known, 2)
            if (a, b) in ratios and _factor(ratios[a, b]) == 1.0 and known[a] == known[b]
        ]
        if agreeing:
            wrong[family] = known[agreeing[0][0]]
    return wrong


def factor_words(factor: float) -> str:
    """What a wrong factor usually means."""
    if factor == -1.0:
        return "reversed: its sign is wrong"
    size = max(abs(factor), 1.0 / abs(factor))
    words = _FACTOR_WORDS[min(_FACTOR_WORDS, key=lambda known: abs(math.log(known / size)))]
    return (
        ("too large" if abs(factor) > 1.0 else "too small")
        + f" by a factor of {words}"
        + (", and its sign is wrong" if factor < 0 else "")
    )


def _means(rotation: Floats, rate_hz: float) -> Floats:
    steps = means_over(rotation, max(1, round(_STEP_S * rate_hz)))
    count = min(round(_MEAN_S / _STEP_S), max(steps.size, 1))
    return np.asarray(np.lib.stride_tricks.sliding_window_view(steps, count).mean(axis=1))


def _ratio(one: Floats, other: Floats, rate_hz: float) -> float | None:
    """Slope of `one` against `other` over the still means; None where they do not span enough."""
    count = round((_STILL_S - _MEAN_S) / _STEP_S) + 1
    if one.size < 2 * count:
        return None
    smaller = min(float(np.nanmax(np.abs(row - np.nanmedian(row)), initial=0.0)) for row in (one, other))
    still = np.ones(one.size, dtype=bool)
    for row in (one, other):
        # Where one family is ten times too large, what counts as still is too: judged by its own span.
        span = float(np.nanmax(np.abs(row), initial=0.0))
        limit = _STILL_RAD * max(span / max(smaller, 1e-12), 1.0)
        windows = np.lib.stride_tricks.sliding_window_view(row, count)
        quiet = np.ptp(windows, axis=1) < limit
        still[: count - 1] = False
        still[count - 1 :] &= quiet
    x, y = other[still], one[still]
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good] - np.median(x[good]) if good.any() else x[good], y[good]
    if x.size < 4 or max(np.ptp(x), np.ptp(y)) < _LEAST_SPAN_RAD or not np.ptp(x) or not np.ptp(y):
        return None
    x, y = x - x.mean(), y - y.mean()
    correlation = float(x @ y) / math.sqrt(float(x @ x) * float(y @ y))
    if abs(correlation) < 0.95:
        return None
    return math.copysign(math.sqrt(float(y @ y) / float(x @ x)), correlation)


def _factor(ratio: float) -> float | None:
    """The known factor that a ratio is nearest to; None where it is none of them."""
    for size in (1.0, *_FACTORS, *(1.0 / factor for factor in _FACTORS)):
        if abs(math.log(abs(ratio) / size)) < _ALIKE:
            return math.copysign(size, ratio)
    return None
