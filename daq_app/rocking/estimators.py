"""r from impact speeds (EAV, 4.4) and from peaks (CRT, 4.5): points, plain mean, weighted mean.

The plain mean is the paper's. The weighted mean is generalised least squares on ln r with two
sources of error: what each speed or peak is known to (large for the last, small cycles) and the
scatter of r itself from impact to impact, which every later speed and peak inherits. The scatter is
found from the points by maximum likelihood; its standard error is part of the answer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from daq_app.rocking import theory
from daq_app.rocking.housner import exact_energy

Floats = NDArray[np.float64]

_USABLE_RELATIVE_SIGMA = 0.15
"""Speeds and energies known worse than this are listed but not used."""
_SCATTERS = np.concatenate(([0.0], np.geomspace(5e-4, 0.15, 48)))


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
    degrees_of_freedom: int = 0
    scatter: float = 0.0
    """Relative standard deviation of r from impact to impact that the points suggest."""
    plain_mean: float | None = None
    """Mean of the points, as in the paper."""
    plain_standard_error: float | None = None

    def interval95(self) -> tuple[float, float] | None:
        """95 % confidence interval (Student t)."""
        if self.r is None or self.standard_error is None or self.degrees_of_freedom < 1:
            return None
        reach = float(stdtrit(self.degrees_of_freedom, 0.975)) * self.standard_error
        return self.r - reach, self.r + reach


def eav(
    speeds_rad_s: Sequence[float], sigmas_rad_s: Sequence[float], *, method: str = "EAV"
) -> RestitutionEstimate:
    """EAV (4.4): speeds at impacts 1, 2, …, pairs two impacts apart (same side).

    Signs are ignored. Speeds that are not finite, or known worse than 15 %, make no pair.
    """
    speeds, sigmas = np.abs(np.asarray(speeds_rad_s)), np.asarray(sigmas_rad_s)
    usable = _usable(speeds, sigmas)
    pairs = [(k, k + 2) for k in range(speeds.size - 2) if usable[k] and usable[k + 2]]
    if not pairs:
        return RestitutionEstimate(method, ())
    log, relative = np.log(np.where(usable, speeds, 1.0)), np.where(usable, sigmas / speeds, 0.0)
    rows = np.zeros((len(pairs), speeds.size))
    for row, (first, last) in zip(rows, pairs, strict=True):
        row[first], row[last] = -0.5, 0.5
    values = rows @ log
    own = np.sqrt((rows**2) @ relative**2)
    points = tuple(
        RestitutionPoint(last + 1, first + 1, last + 1, math.exp(value), math.exp(value) * sigma)
        for (first, last), value, sigma in zip(pairs, values, own, strict=True)
    )
    # Impact k inherits the scatter of the impacts before it: ln v_k = ln v_1 + Σ ln r.
    return _combine(method, points, values, rows, relative**2, np.arange(speeds.size))


def crt(
    peaks_rad: Sequence[float],
    sigmas_rad: Sequence[float],
    alpha_rad: float,
    *,
    exact: bool = False,
    method: str = "CRT",
) -> RestitutionEstimate:
    """CRT (4.5): peaks_rad[0] is the release, peaks_rad[n] the peak that follows impact n.

    `exact` uses the nonlinear potential 1 − cos(α − |θ|) in place of the paper's (α − |θ|)²/2; the
    caller names the method accordingly.
    """
    peaks, sigmas = np.abs(np.asarray(peaks_rad)), np.asarray(sigmas_rad)
    inside = np.isfinite(peaks) & (peaks > 0.0) & (peaks < alpha_rad)
    safe = np.where(inside, peaks, alpha_rad / 2.0)
    energies = exact_energy(safe, alpha_rad) if exact else theory.energy(safe / alpha_rad)
    slope = 2.0 * (1.0 - safe / alpha_rad) / alpha_rad
    usable = inside & _usable(energies, slope * sigmas)
    if peaks.size < 2 or not usable[0]:
        return RestitutionEstimate(method, ())
    counts = [n for n in range(1, peaks.size) if usable[n]]
    if not counts:
        return RestitutionEstimate(method, ())
    relative = np.where(usable, slope * sigmas / energies, 0.0)
    rows = np.zeros((len(counts), peaks.size))
    for row, n in zip(rows, counts, strict=True):
        row[0], row[n] = -0.5 / n, 0.5 / n
    values = rows @ np.log(energies)
    own = np.sqrt((rows**2) @ relative**2)
    points = tuple(
        RestitutionPoint(n, 0, n, math.exp(value), math.exp(value) * sigma)
        for n, value, sigma in zip(counts, values, own, strict=True)
    )
    # ln E_n = ln E_0 + 2 Σ ln r: in units of ln r the walk counts twice.
    return _combine(method, points, values, rows, relative**2, np.arange(peaks.size), walk_factor=2.0)


def _usable(values: Floats, sigmas: Floats) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore", divide="ignore"):
        return (
            np.isfinite(values) & (values > 0) & (sigmas >= 0) & (sigmas <= _USABLE_RELATIVE_SIGMA * values)
        )


def _combine(
    method: str,
    points: tuple[RestitutionPoint, ...],
    values: Floats,
    rows: Floats,
    variances: Floats,
    steps: NDArray[np.int_],
    walk_factor: float = 1.0,
) -> RestitutionEstimate:
    """Weighted mean of the points, with the scatter of r as a random walk over the impacts."""
    # Rounding and model error of a perfect recording: keeps the matrix well conditioned.
    measured = (rows * variances) @ rows.T + 1e-12 * np.eye(values.size)
    walk = walk_factor**2 * rows @ np.minimum.outer(steps, steps) @ rows.T
    mean, variance, scatter = _weighted_mean(values, measured, walk)
    spread = np.exp(values)
    r = math.exp(mean)
    return RestitutionEstimate(
        method=method,
        points=points,
        r=r,
        standard_error=r * math.sqrt(variance),
        degrees_of_freedom=_degrees(rows, variances / walk_factor**2, scatter),
        scatter=scatter,
        plain_mean=float(spread.mean()),
        plain_standard_error=float(spread.std(ddof=1) / math.sqrt(values.size)) if values.size > 1 else None,
    )


def _degrees(rows: Floats, variances: Floats, scatter: float) -> int:
    """Degrees of freedom of the standard error: how many impacts tell something of the scatter.

    Steps between neighbouring values whose own error exceeds the scatter tell little of it.
    """
    if scatter == 0.0:
        return max(len(rows) - 1, 1)
    used = variances[np.any(rows != 0.0, axis=0)]
    step = used[1:] + used[:-1]
    informative = float(np.sum(scatter**2 / (scatter**2 + step)))
    return max(round(informative) - 1, 1)


def _weighted_mean(values: Floats, measured: Floats, walk: Floats) -> tuple[float, float, float]:
    """Generalised least-squares mean, its variance, and the scatter s of covariance C + s² W.

    In the basis that makes C the identity and W diagonal, every s is tried at once; the one with the
    largest restricted likelihood counts. Fewer than four points cannot tell: s = 0.
    """
    lower = np.linalg.cholesky(measured)
    half = np.linalg.solve(lower, walk)
    eigenvalues, vectors = np.linalg.eigh(np.linalg.solve(lower, half.T))
    ones, y = (vectors.T @ np.linalg.solve(lower, column) for column in (np.ones(values.size), values))
    scatters = _SCATTERS if values.size >= 4 else _SCATTERS[:1]
    spread = 1.0 + scatters[:, None] ** 2 * np.maximum(eigenvalues, 0.0)
    information = (ones**2 / spread).sum(axis=1)
    means = (ones * y / spread).sum(axis=1) / information
    misfit = ((y - means[:, None] * ones) ** 2 / spread).sum(axis=1)
    likelihood = -0.5 * (np.log(spread).sum(axis=1) + np.log(information) + misfit)
    best = int(np.argmax(likelihood))
    return float(means[best]), float(1.0 / information[best]), float(scatters[best])
