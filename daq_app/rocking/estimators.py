"""r from impact speeds (EAV, 4.4) and from peaks (CRT, 4.5): points, plain mean, weighted mean.

The plain mean is the paper's. The weighted mean is the generalised least-squares slope of ln |θ̇_n|
(EAV: each side with a level of its own, so that only pairs of the same side count) or ½ ln E_n (CRT)
against n, with two sources of error: what each speed or peak is known to (large for the last, small
cycles), and the scatter of r from impact to impact, which all later values inherit (a random walk).
How large the scatter is, few impacts tell: every size counts by its restricted likelihood, so that the
standard error holds what is not known of it. Where even fewer are left, the usual scatter is taken.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its `special` is loaded with the first use: the window starts without it
from numpy.typing import NDArray

from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.housner import exact_energy

Floats = NDArray[np.float64]

_USABLE_RELATIVE_SIGMA = 0.15
"""Speeds and energies known worse than this are listed but not used."""
SCATTERS = np.concatenate(([0.0], np.geomspace(5e-5, 0.15, 56)))
"""Relative sizes of the scatter of r, (k,), that are tried."""
_USUAL_SCATTER = 0.004
"""Relative scatter of r that walls have (assumed: `campaign simulate` draws this). Lowering it makes standard
errors of tests with few impacts too small, raising it makes them too large: with all sizes up to 15 % alike,
intervals from six values held r in 99 to 100 % of tests whose r scatters by 0.4 to 2 %."""
SCATTER_WEIGHTS = np.gradient(SCATTERS) / np.maximum(SCATTERS, _USUAL_SCATTER)
"""Weight of each size of the scatter before the values are seen: all sizes alike up to the usual one, beyond
it all ratios alike (the scale-invariant prior of Jeffreys)."""
_SURELY = 0.05
"""Chance of less scatter than what is stated as its least."""
FEWEST_POINTS = 4
"""Points below which the scatter of r cannot be told from the values' own errors: the usual one is taken."""


@dataclass(frozen=True, slots=True)
class RestitutionPoint:
    """One value of r and what it came from."""

    impact: int
    """The impact that completed it."""
    first: int
    """Impact or peak at the start of the pair."""
    last: int
    r: float
    sigma: float
    """From the measurement alone, without scatter of r."""


@dataclass(frozen=True, slots=True)
class RestitutionEstimate:
    """r of a whole test by one method."""

    method: str
    points: tuple[RestitutionPoint, ...]
    r: float | None = None
    """Weighted mean; None with fewer points than needed."""
    standard_error: float | None = None
    degrees_of_freedom: float = 0.0
    """Infinite where the standard error holds the scatter of r."""
    scatter: float = 0.0
    """Relative standard deviation of r from impact to impact that is the likeliest; the usual one where
    points are too few to tell it."""
    least_scatter: float = 0.0
    """What the scatter is below with a chance of 5 %."""
    plain_mean: float | None = None
    """Mean of the points, as in the paper."""
    plain_standard_error: float | None = None

    def interval95(self) -> tuple[float, float] | None:
        """95 % interval: Student's, or normal where the error holds the scatter of r."""
        if self.r is None or self.standard_error is None or self.degrees_of_freedom < 1:
            return None
        reach = float(scipy.special.stdtrit(self.degrees_of_freedom, 0.975)) * self.standard_error
        return self.r - reach, self.r + reach


@dataclass(frozen=True, slots=True)
class DecaySeries:
    """What falls by ln r from one impact to the next in one test by one method, and its points."""

    method: str
    points: tuple[RestitutionPoint, ...]
    """Without points there is no estimate."""
    values: Floats
    """(n,)"""
    variances: Floats
    usable: NDArray[np.bool_]
    levels: Floats
    """(n, levels) 1 where a value counts from this level."""
    may_scatter: bool = True
    """Whether few points are assumed to have the usual scatter. Differences of two families of one wall have
    none."""


def eav_series(
    speeds_rad_s: Sequence[float] | Floats, sigmas_rad_s: Sequence[float] | Floats, *, method: str = "EAV"
) -> DecaySeries:
    """EAV (4.4): speeds at impacts 1, 2, …, pairs two impacts apart (same side).

    Signs are ignored. Speeds that are not finite, or known worse than 15 %, make no pair.
    """
    speeds, sigmas = np.abs(np.asarray(speeds_rad_s)), np.asarray(sigmas_rad_s)
    usable = _usable(speeds, sigmas)
    log, relative = np.log(np.where(usable, speeds, 1.0)), np.where(usable, sigmas / speeds, 0.0)
    logs, shares = log.tolist(), relative.tolist()
    points = []
    for first in np.flatnonzero(usable[:-2] & usable[2:]).tolist():
        last = first + 2
        r = math.exp(0.5 * (logs[last] - logs[first]))
        sigma = 0.5 * r * math.hypot(shares[first], shares[last])
        points.append(RestitutionPoint(last + 1, first + 1, last + 1, r, sigma))
    side = np.arange(speeds.size) % 2
    levels = np.stack([side == 0, side == 1], axis=1).astype(np.float64)
    return DecaySeries(method, tuple(points), log, relative**2, usable, levels)


def crt_series(
    peaks_rad: Sequence[float],
    sigmas_rad: Sequence[float],
    alpha_rad: float,
    *,
    exact: bool = False,
    method: str = "CRT",
) -> DecaySeries:
    """CRT (4.5): peaks_rad[0] is the release, peaks_rad[n] the peak that follows impact n.

    `exact` uses the nonlinear potential 1 − cos(α − |θ|) in place of the paper's (α − |θ|)²/2; the
    caller names the method accordingly. A peak whose sigma is NaN is not used; points begin at the first
    that is.
    """
    peaks, sigmas = np.abs(np.asarray(peaks_rad)), np.asarray(sigmas_rad)
    inside = np.isfinite(peaks) & (peaks > 0.0) & (peaks < alpha_rad)
    safe = np.where(inside, peaks, alpha_rad / 2.0)
    energies = exact_energy(safe, alpha_rad) if exact else theory.energy(safe / alpha_rad)
    slope = 2.0 * (1.0 - safe / alpha_rad) / alpha_rad
    usable = inside & _usable(energies, slope * sigmas)
    relative = np.where(usable, slope * sigmas / energies, 0.0)
    log = np.log(energies)
    logs, shares = log.tolist(), relative.tolist()
    points = []
    usable_peaks = np.flatnonzero(usable).tolist()
    for first, n in [(usable_peaks[0], n) for n in usable_peaks[1:]]:
        steps = 2 * (n - first)
        r = math.exp((logs[n] - logs[first]) / steps)
        sigma = r * math.hypot(shares[first], shares[n]) / steps
        points.append(RestitutionPoint(n, first, n, r, sigma))
    levels = np.ones((peaks.size, 1))
    return DecaySeries(method, tuple(points), log / 2.0, (relative / 2.0) ** 2, usable, levels)


def _usable(values: Floats, sigmas: Floats) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore", divide="ignore"):
        return (
            np.isfinite(values) & (values > 0) & (sigmas >= 0) & (sigmas <= _USABLE_RELATIVE_SIGMA * values)
        )


def estimate_all(
    wanted: Sequence[DecaySeries], weights: Floats = SCATTER_WEIGHTS
) -> list[RestitutionEstimate]:
    """Weighted mean of each series from values that fall by ln r per impact, and plain mean of its points.

    They are worked on together: many cost little more than one. `weights` (k,) of `SCATTERS` are those before
    the values are seen.
    """
    slopes = iter(_slopes([series for series in wanted if series.points], weights))
    return [
        _estimate(series, *next(slopes)) if series.points else RestitutionEstimate(series.method, ())
        for series in wanted
    ]


def _estimate(
    series: DecaySeries, slope: float, variance: float, scatter: float, least_scatter: float
) -> RestitutionEstimate:
    single = np.array([point.r for point in series.points])
    r = math.exp(slope)
    return RestitutionEstimate(
        method=series.method,
        points=series.points,
        r=r,
        standard_error=r * math.sqrt(variance),
        degrees_of_freedom=math.inf
        if series.may_scatter or len(series.points) >= FEWEST_POINTS
        else max(len(series.points) - 1, 1),
        scatter=scatter,
        least_scatter=least_scatter,
        plain_mean=float(single.mean()),
        plain_standard_error=float(single.std(ddof=1) / math.sqrt(single.size)) if single.size > 1 else None,
    )


def _slopes(together: Sequence[DecaySeries], weights: Floats) -> list[tuple[float, float, float, float]]:
    """Generalised least-squares slope of the values against their index, its variance, scatter and its least.

    Errors are independent (`variances`) plus a random walk of step s. Every s of a grid is tried at
    once, and every series, by a Kalman filter that whitens values and regressors
    (Harvey's GLS by prediction errors). Slope and variance are those of the mixture over s, weighted by
    the restricted likelihood; the scatter is the likeliest s, its least the quantile of `_SURELY`.
    """
    if not together:
        return []
    length, levels = np.max([series.levels.shape for series in together], axis=0).tolist()
    # Shorter series end with values that are not used, and have levels from which none counts.
    usable = np.zeros((length, len(together)), dtype=bool)
    # A value that is not used is infinitely uncertain: the filter passes it by.
    variances = np.full((length, len(together), 1), np.inf)
    rows = np.zeros((length, len(together), 1 + levels + 1, 1))
    rows[:, :, -1, 0] = np.arange(length)[:, None]
    for k, series in enumerate(together):
        n, of_series = series.levels.shape
        usable[:n, k] = series.usable
        variances[:n, k, 0][series.usable] = series.variances[series.usable]
        rows[:n, k, 0, 0], rows[:n, k, 1 : 1 + of_series, 0] = series.values, series.levels
    walk = np.broadcast_to(SCATTERS**2, (len(together), SCATTERS.size))
    state, spread = np.zeros((len(together), rows.shape[2], SCATTERS.size)), np.zeros(walk.shape)
    errors, totals = np.empty((length, *state.shape)), np.empty((length, *walk.shape))
    for error, total, row, variance in zip(errors, totals, rows, variances, strict=True):
        np.add(spread, variance, out=total)
        # Rounding and model error of a perfect recording keep the filter well conditioned.
        total += 1e-12
        np.subtract(row, state, out=error)
        gain = spread / total
        state += gain[:, None] * error
        spread *= 1.0 - gain
        spread += walk
    errors[~usable], totals[~usable] = 0.0, 1.0
    errors /= np.sqrt(totals)[:, :, None]
    whitened = np.ascontiguousarray(errors.transpose(1, 3, 0, 2))
    log_spread = np.log(totals).sum(axis=0)
    target, design = whitened[..., :1], whitened[..., 1:]
    normal = np.swapaxes(design, 2, 3) @ design
    # A level that no usable value counts from has no column: a one in its place changes nothing.
    counts = (rows[:, :, 1:-1, 0] != 0.0) & usable[..., None]
    empty = ~np.asarray(counts.any(axis=0))
    for level in range(levels):
        normal[empty[:, level], :, level, level] = 1.0
    inverse = np.linalg.inv(normal)
    solution = inverse @ (np.swapaxes(design, 2, 3) @ target)
    misfit = ((target - design @ solution) ** 2).sum(axis=(2, 3))
    likelihood = -0.5 * (log_spread + np.linalg.slogdet(normal)[1] + misfit)
    _assume_usual_scatter(together, likelihood)
    weights = weights * np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    slopes, variances_of_slope = solution[..., -1, 0], inverse[..., -1, -1]
    slope = (weights * slopes).sum(axis=1)
    variance = (weights * (variances_of_slope + (slopes - slope[:, None]) ** 2)).sum(axis=1)
    best = SCATTERS[np.argmax(likelihood, axis=1)]
    least = SCATTERS[np.argmax(np.cumsum(weights, axis=1) >= _SURELY, axis=1)]
    return list(zip(*(found.tolist() for found in (slope, variance, best, least)), strict=True))


def _assume_usual_scatter(together: Sequence[DecaySeries], likelihood: Floats) -> None:
    """Take the likelihood, (series, scatters), of too few points from every scatter but the usual one.

    A series that may not scatter keeps that of no scatter.
    """
    usual = int(np.argmin(np.abs(SCATTERS - _USUAL_SCATTER)))
    for series, of_each in zip(together, likelihood, strict=True):
        if len(series.points) < FEWEST_POINTS:
            of_each[np.arange(SCATTERS.size) != (usual if series.may_scatter else 0)] = -np.inf
