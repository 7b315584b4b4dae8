"""One half-cycle at a time: peak, times and one-sided speeds from a local model of the rotation.

θ̇ jumps at each impact, so no symmetric filter can show the speeds just before and after it. Each
half-cycle ("arc") is therefore fitted by itself, strictly between its two impacts, with

    θ(t) = a + b cosh q(t−t_c) + c sinh q(t−t_c)  [+ powers 3…6 of (t−t_c) where the data ask for them]

with q² = p² cos(mean of α − |θ|). The first three terms are the general motion, linearised about the
middle of the half-cycle, with free constants; the powers take up another p, a yielding joint, what
else the wall does. They are used only where the data ask for them clearly (Bayesian information
criterion with a margin). Nothing is assumed about energy or the neighbouring half-cycles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_GUARD_S = 0.002
_GUARD_SHARE = 0.015
"""Kept clear of each impact: the crossing's own error, filters of the sensors, the shock itself."""
_FALL_SHARE = 0.7
"""Part of the fall from release to first impact that is used: its beginning depends on the release."""
_POINTS = 160
"""Samples are averaged to about this many points: noise becomes white and fits become cheap."""
_MIN_POINTS = 12
_POWERS: tuple[tuple[int, ...], ...] = ((), (4,), (3,), (3, 4), (3, 4, 5, 6))
"""Candidate additions to the basis, from stiff to free."""
_CLEARLY = 10.0
"""How much better in BIC a freer basis must be: noise alone must not choose it."""
_MODEL_SHARE = 1e-4
"""Standard uncertainty of speeds and peaks that the basis itself leaves, as a share of the value."""


@dataclass(frozen=True, slots=True)
class Arc:
    """One half-cycle, signed values; arc 0 is the fall from the release to impact 1."""

    index: int
    """Number of the impact that starts it; 0 for the fall."""
    start_s: float
    """Zero crossing at which the arc starts (the release for arc 0), as this arc shows it."""
    end_s: float
    sigma_start_s: float
    sigma_end_s: float
    peak_rad: float
    peak_s: float
    sigma_peak_rad: float
    """NaN with the peak where the arc has none (the fall: its peak is the hold)."""
    speed_start_rad_s: float
    """θ̇⁺ just after the impact that starts it; NaN for the fall."""
    sigma_speed_start_rad_s: float
    speed_end_rad_s: float
    """θ̇⁻ just before the impact that ends it."""
    sigma_speed_end_rad_s: float
    powers: tuple[int, ...]
    """Powers that were added to the basis."""
    residual_rad: float
    """rms of what the fit leaves, at the averaged points."""
    points: int

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True)
class _Basis:
    """Columns on x ∈ [−1, 1], x = (t − centre)/half length, scaled to reach about 1."""

    kappa: float
    powers: tuple[int, ...]

    def design(self, x: Floats) -> Floats:
        """(points, columns)"""
        k = self.kappa
        stacked: Floats = np.empty((x.size, 3 + len(self.powers)))
        stacked[:, 0] = 1.0
        stacked[:, 1] = (np.cosh(k * x) - 1.0) / (math.cosh(k) - 1.0)
        stacked[:, 2] = np.sinh(k * x) / math.sinh(k)
        for column, n in enumerate(self.powers, start=3):
            stacked[:, column] = x**n
        return stacked

    def rows(self, x: float) -> tuple[Floats, Floats, Floats]:
        """Value, first and second derivative by x of every column at one place."""
        k = self.kappa
        c, s = math.cosh(k * x), math.sinh(k * x)
        even, odd = math.cosh(k) - 1.0, math.sinh(k)
        value = [1.0, (c - 1.0) / even, s / odd, *(x**n for n in self.powers)]
        slope = [0.0, k * s / even, k * c / odd, *(n * x ** (n - 1) for n in self.powers)]
        curve = [0.0, k * k * c / even, k * k * s / odd, *(n * (n - 1) * x ** (n - 2) for n in self.powers)]
        return np.array(value), np.array(slope), np.array(curve)


@dataclass(frozen=True, slots=True)
class _Fit:
    basis: _Basis
    coefficients: Floats
    covariance: Floats
    residual: float
    score: float


def fit_arc(
    time_s: Floats,
    rotation_rad: Floats,
    start_s: float,
    end_s: float,
    *,
    index: int,
    p_rad_s: float,
    alpha_rad: float,
    zero_sigma_rad: float = 2e-5,
) -> Arc | None:
    """Fit the half-cycle between two zero crossings (for `index` 0 between release and crossing).

    `time_s`, `rotation_rad` (n,) must cover it; NaN samples are left out. `zero_sigma_rad` is what
    the zero of the rotation may be wrong by: it moves the crossings. None where too little is left
    to fit, or where the fit has no zero crossing or peak where it should.
    """
    length = end_s - start_s
    guard = max(_GUARD_S, _GUARD_SHARE * length)
    first = start_s + (1.0 - _FALL_SHARE) * length if index == 0 else start_s + guard
    points = _averaged(time_s, rotation_rad, first, end_s - guard)
    if points is None:
        return None
    left = first if index == 0 else start_s
    centre, half = (left + end_s) / 2.0, (end_s - left) / 2.0
    x, y = (points[0] - centre) / half, points[1]
    middle = max(alpha_rad - float(np.mean(np.abs(y))), 0.0)
    fit = _best_fit(x, y, p_rad_s * math.sqrt(math.cos(middle)) * half)
    end = _crossing(fit, 1.0, half, zero_sigma_rad)
    start = None if index == 0 else _crossing(fit, -1.0, half, zero_sigma_rad)
    if end is None or (index > 0 and start is None):
        return None
    peak = _peak(fit) if index > 0 else (0.0, math.nan, math.nan)
    if peak is None:
        return None
    nan = math.nan
    x_start, sigma_x_start, v_start, sigma_v_start = start or (0.0, nan, nan, nan)
    return Arc(
        index=index,
        start_s=start_s if start is None else centre + half * x_start,
        end_s=centre + half * end[0],
        sigma_start_s=half * sigma_x_start,
        sigma_end_s=half * end[1],
        peak_rad=peak[1],
        peak_s=start_s if index == 0 else centre + half * peak[0],
        sigma_peak_rad=math.hypot(peak[2], zero_sigma_rad),
        speed_start_rad_s=v_start,
        sigma_speed_start_rad_s=sigma_v_start,
        speed_end_rad_s=end[2],
        sigma_speed_end_rad_s=end[3],
        powers=fit.basis.powers,
        residual_rad=fit.residual,
        points=x.size,
    )


def _averaged(
    time_s: Floats, rotation_rad: Floats, first_s: float, last_s: float
) -> tuple[Floats, Floats] | None:
    """Means of consecutive samples within [first, last]; None where fewer than 12 points remain."""
    low, high = np.searchsorted(time_s, [first_s, last_s])
    n = int(high - low)
    size = max(1, n // _POINTS)
    groups = n // size
    if groups < _MIN_POINTS:
        return None
    stop = low + groups * size
    t = time_s[low:stop].reshape(groups, size).mean(axis=1)
    y = rotation_rad[low:stop].reshape(groups, size).mean(axis=1)
    good = np.isfinite(y)
    if np.count_nonzero(good) < _MIN_POINTS:
        return None
    return t[good], y[good]


def _best_fit(x: Floats, y: Floats, kappa: float) -> _Fit:
    """The candidate with the smallest BIC; the stiffest unless another is clearly better."""
    full = _Basis(kappa, _POWERS[-1]).design(x)
    allowed = [powers for powers in _POWERS if x.size >= 3 * (len(powers) + 3)]

    def fit(powers: tuple[int, ...]) -> _Fit:
        columns = [0, 1, 2, *(3 + _POWERS[-1].index(n) for n in powers)]
        return _fit(full[:, columns], y, _Basis(kappa, powers))

    stiff, freest = fit(allowed[0]), fit(allowed[-1])
    # Every candidate leaves at least what one that holds all their powers leaves: often none between
    # can be clearly better.
    spared = (len(allowed[-1]) - 1) * math.log(y.size)
    holds_all = set().union(*allowed) <= set(allowed[-1])
    if holds_all and freest.score - spared >= stiff.score - _CLEARLY:
        return stiff
    best = min((stiff, *map(fit, allowed[1:-1]), freest), key=lambda candidate: candidate.score)
    return best if best.score < stiff.score - _CLEARLY else stiff


def _fit(design: Floats, y: Floats, basis: _Basis) -> _Fit:
    q, triangle = np.linalg.qr(design)
    inverse = np.linalg.inv(triangle)
    coefficients = inverse @ (q.T @ y)
    residual = y - design @ coefficients
    square = float(residual @ residual)
    degrees = y.size - coefficients.size
    covariance = inverse @ inverse.T * (square / degrees)
    score = y.size * math.log(max(square, 1e-300) / y.size) + coefficients.size * math.log(y.size)
    return _Fit(basis, coefficients, covariance, math.sqrt(square / y.size), score)


def _crossing(
    fit: _Fit, guess: float, half_s: float, zero_sigma: float
) -> tuple[float, float, float, float] | None:
    """x of the zero near `guess`, its sigma, the signed speed there (1/s) and its sigma."""
    x = guess
    for _ in range(8):
        value, slope, curve = fit.basis.rows(x)
        speed = float(slope @ fit.coefficients)
        if speed == 0.0:
            return None
        step = float(value @ fit.coefficients) / speed
        if abs(step) < 1e-10:
            break
        x -= step
        if abs(x - guess) > 0.25:
            return None
    curvature = float(curve @ fit.coefficients)
    # The speed is read where the fit crosses zero: its error counts through the shift of that place.
    gradient = slope - curvature / speed * value
    shift = math.hypot(math.sqrt(float(value @ fit.covariance @ value)), zero_sigma) / abs(speed)
    own = float(gradient @ fit.covariance @ gradient)
    sigma = math.hypot(math.sqrt(max(own, 0.0)), curvature / speed * zero_sigma, _MODEL_SHARE * speed)
    return x, shift, speed / half_s, sigma / half_s


def _peak(fit: _Fit) -> tuple[float, float, float] | None:
    """x, value and sigma of the extremum between the impacts."""
    grid = np.linspace(-0.9, 0.9, 13)
    size = np.abs(fit.basis.design(grid) @ fit.coefficients)
    x = float(grid[int(np.argmax(size))])
    for _ in range(12):
        _, slope, curve = fit.basis.rows(x)
        curvature = float(curve @ fit.coefficients)
        if curvature == 0.0:
            return None
        step = float(slope @ fit.coefficients) / curvature
        x -= min(max(step, -0.3), 0.3)
        if abs(step) < 1e-9:
            break
    if not abs(x) < 1.0:
        return None
    row = fit.basis.rows(x)[0]
    value = float(row @ fit.coefficients)
    return x, value, math.hypot(math.sqrt(float(row @ fit.covariance @ row)), _MODEL_SHARE * value)
