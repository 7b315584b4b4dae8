"""Many half-cycles at once: local basis, least squares, choice of basis, zero crossings and extremum.

Everything is written over a stack of half-cycles, one row each, on x ∈ [−1, 1]: x = (t − centre)/half
length. A basis that leaves out powers has zeros among its coefficients and in their covariance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STIFF: Final = 3
"""Columns of every basis: 1, cosh, sinh."""
ALL_POWERS: Final = (3, 4, 5, 6)
POWERS: Final[tuple[tuple[int, ...], ...]] = ((), (4,), (3,), (3, 4), ALL_POWERS)
"""Candidate additions to the basis, from stiff to free."""
_N: Final = np.array(ALL_POWERS)
_N_SQUARED_LESS_N: Final = _N * (_N - 1)
_ONES: Final = np.ones(_N.size)
_COLUMNS: Final = STIFF + len(ALL_POWERS)
_NESTED: Final = (0, 2, 3, 4)
"""Candidates that are the first columns of the freest: one decomposition serves all of them."""
_ODD: Final = POWERS.index((3,))
_CLEARLY: Final = 10.0
"""How much better in BIC a freer basis must be: noise alone must not choose it."""
_MODEL_SHARE: Final = 1e-4
"""Standard uncertainty of speeds and peaks that the basis itself leaves, as a share of the value."""


@dataclass(frozen=True, slots=True)
class ArcFits:
    """Fitted bases of a stack of half-cycles."""

    kappa: Floats
    """(arcs,) q · half length"""
    coefficients: Floats
    """(arcs, 7)"""
    covariance: Floats
    """(arcs, 7, 7)"""
    candidate: NDArray[np.intp]
    """(arcs,) index into `POWERS`"""
    residual: Floats
    """(arcs,) rms of what the fit leaves"""
    odd_coefficients: Floats
    """(arcs, 7) of the basis with the third power, which lets an arc end at another speed than it begins."""
    odd_covariance: Floats
    """(arcs, 7, 7)"""

    def rows(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Value, first and second derivative by x (…, arcs) of every column: (…, arcs, 7) each."""
        k = self.kappa
        c, s = np.cosh(k * x), np.sinh(k * x)
        even, odd = np.cosh(k) - 1.0, np.sinh(k)
        value, slope, curve = np.empty((3, *x.shape, _COLUMNS))
        value[..., 0], slope[..., 0], curve[..., 0] = 1.0, 0.0, 0.0
        value[..., 1], slope[..., 1], curve[..., 1] = (c - 1.0) / even, k * s / even, k * k * c / even
        value[..., 2], slope[..., 2], curve[..., 2] = s / odd, k * c / odd, k * k * s / odd
        x = x[..., None]
        power = np.multiply.accumulate(x * _ONES, axis=-1)  # x to the (n − 2)
        np.multiply(_N_SQUARED_LESS_N, power, out=curve[..., STIFF:])
        np.multiply(_N * power, x, out=slope[..., STIFF:])
        np.multiply(power * x, x, out=value[..., STIFF:])
        return value, slope, curve


def design(x: Floats, kappa: Floats) -> Floats:
    """(arcs, points, 7) columns that reach about 1, at x (arcs, points)."""
    k = kappa[:, None]
    grow = np.exp(k * x)
    shrink = 1.0 / grow
    columns = np.empty((_COLUMNS, *x.shape))
    columns[0] = 1.0
    columns[1] = (0.5 * (grow + shrink) - 1.0) / (np.cosh(k) - 1.0)
    columns[2] = 0.5 * (grow - shrink) / np.sinh(k)
    columns[STIFF] = x * x * x
    for column in range(STIFF + 1, _COLUMNS):
        np.multiply(columns[column - 1], x, out=columns[column])
    return np.moveaxis(columns, 0, -1)


def fit_stack(x: Floats, y: Floats, present: Bools, kappa: Floats, noise_rad: Floats) -> ArcFits:
    """The candidate with the smallest BIC for each arc; the stiffest unless another is clearly better.

    `x`, `y` (arcs, points) with `present` where there is a point: an absent one has x = y = 0. `noise_rad`
    (arcs,) is the least that a point is uncertain by: noise slower than a point leaves small residuals.
    """
    count = present.sum(axis=1)
    table = design(x, kappa) * present[..., None]
    q, triangle = np.linalg.qr(table)
    inverse = np.linalg.inv(triangle)
    projected = np.einsum("apk,ap->ak", q, y)
    arcs = np.arange(count.size)
    squares = np.full((count.size, len(POWERS)), np.inf)
    left, done = y, 0
    for candidate in _NESTED:
        wide = STIFF + len(POWERS[candidate])
        left = left - np.einsum("apk,ak->ap", q[..., done:wide], projected[:, done:wide])
        squares[:, candidate] = np.einsum("ap,ap->a", left, left)
        done = wide
    variance = np.maximum(squares[:, -1] / (count - _COLUMNS), noise_rad**2)
    apart = _may_gain(squares, count, variance)
    alone: tuple[Floats, Floats] | None = None
    if apart.any():
        columns = [*range(STIFF), STIFF + ALL_POWERS.index(4)]
        alone = _separate(table[apart][..., columns], y[apart])
        squares[apart, 1] = _left(table[apart][..., columns], alone[0], y[apart])
    best = _best(squares, count, variance)
    coefficients = np.zeros((count.size, _COLUMNS))
    covariance = np.zeros((count.size, _COLUMNS, _COLUMNS))
    for candidate in _NESTED:
        chosen = np.flatnonzero(best == candidate)
        if chosen.size:
            wide = STIFF + len(POWERS[candidate])
            part = inverse[chosen, :wide, :wide]
            coefficients[chosen, :wide] = np.einsum("ajk,ak->aj", part, projected[chosen, :wide])
            covariance[chosen, :wide, :wide] = part @ np.swapaxes(part, 1, 2)
    if alone is not None:
        among = np.flatnonzero(best[apart] == 1)
        chosen = np.flatnonzero(apart)[among]
        coefficients[np.ix_(chosen, columns)] = alone[0][among]
        covariance[np.ix_(chosen, columns, columns)] = alone[1][among]
    square = squares[arcs, best]
    widths = np.array([STIFF + len(powers) for powers in POWERS])
    covariance *= np.maximum(square / (count - widths[best]), noise_rad**2)[:, None, None]
    odd_coefficients, odd_covariance = np.zeros_like(coefficients), np.zeros_like(covariance)
    wide = widths[_ODD]
    part = inverse[:, :wide, :wide]
    odd_coefficients[:, :wide] = np.einsum("ajk,ak->aj", part, projected[:, :wide])
    variance = np.maximum(squares[:, _ODD] / (count - wide), noise_rad**2)
    odd_covariance[:, :wide, :wide] = part @ np.swapaxes(part, 1, 2) * variance[:, None, None]
    return ArcFits(
        kappa, coefficients, covariance, best, np.sqrt(square / count), odd_coefficients, odd_covariance
    )


def _separate(table: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Coefficients (arcs, columns) and their covariance for unit variance."""
    q, triangle = np.linalg.qr(table)
    inverse = np.linalg.inv(triangle)
    coefficients = np.einsum("ajk,apk,ap->aj", inverse, q, y, optimize=True)
    return coefficients, inverse @ np.swapaxes(inverse, 1, 2)


def _left(table: Floats, coefficients: Floats, y: Floats) -> Floats:
    left = y - np.einsum("apk,ak->ap", table, coefficients)
    return np.asarray(np.einsum("ap,ap->a", left, left))


def _scores(squares: Floats, count: NDArray[np.intp], variance: Floats) -> Floats:
    """(arcs, candidates) BIC; infinite where an arc has too few points for the candidate.

    `variance` (arcs,) of a point is that of the stated errors: by what points scatter about a curve, noise
    that is slower than a point would be taken for motion.
    """
    widths = np.array([STIFF + len(powers) for powers in POWERS])
    n = count[:, None]
    scores = squares / np.maximum(variance, 1e-300)[:, None] + widths * np.log(n)
    return np.where(n >= 3 * widths, scores, np.inf)


def _may_gain(squares: Floats, count: NDArray[np.intp], variance: Floats) -> Bools:
    """Whether the candidate that is not nested can be clearly better than the stiffest.

    It leaves at least what the freest leaves, which holds its power too: often it cannot.
    """
    scores = _scores(squares, count, variance)
    spared = (len(ALL_POWERS) - 1) * np.log(count)
    known = np.isfinite(scores[:, -1])
    return np.asarray(~known | (scores[:, -1] - spared < scores[:, 0] - _CLEARLY))


def _best(squares: Floats, count: NDArray[np.intp], variance: Floats) -> NDArray[np.intp]:
    scores = _scores(squares, count, variance)
    best = np.argmin(scores, axis=1)
    clearly = scores[np.arange(best.size), best] < scores[:, 0] - _CLEARLY
    return np.where(clearly, best, 0)


def crossings(fits: ArcFits, half_s: Floats, zero_sigma: float) -> Floats:
    """(2, 4, arcs), start and end: x of the zero there, its sigma, the signed speed (1/s) and its sigma.

    NaN where there is no zero within a quarter of the half length.
    """
    guess = np.repeat([[-1.0], [1.0]], half_s.size, axis=1)
    x = guess
    moving = np.ones(x.shape, dtype=bool)
    with np.errstate(all="ignore"):
        for _ in range(8):
            value, slope, curve = fits.rows(x)
            speed = _dot(slope, fits.coefficients)
            step = _dot(value, fits.coefficients) / speed
            moving &= np.abs(step) >= 1e-10
            if not moving.any():
                break
            x = np.where(moving, x - step, x)
            x = np.where(np.abs(x - guess) <= 0.25, x, np.nan)
        curvature = _dot(curve, fits.coefficients)
        # The speed is read where the fit crosses zero: its error counts through the shift of that place.
        gradient = slope - (curvature / speed)[..., None] * value
        shift = np.hypot(np.sqrt(_square(value, fits.covariance)), zero_sigma) / np.abs(speed)
        variance = np.maximum(_square(gradient, fits.covariance), 0.0)
        sigma = np.sqrt(variance + (curvature / speed * zero_sigma) ** 2 + (_MODEL_SHARE * speed) ** 2)
    zeros = np.stack([x, shift, speed / half_s, sigma / half_s], axis=1)
    return np.where(np.isfinite(zeros).all(axis=1, keepdims=True), zeros, np.nan)


def speed_kept(fits: ArcFits, ends: Floats) -> Floats:
    """(2, arcs): ln of the speed at the end over that at the start, by the odd basis, and its sigma.

    `ends` (2, arcs): x of both zeros. They are those of the chosen basis: the rotation there is what the odd
    one says, so that the speed is read at its own zero to first order.
    """
    with np.errstate(all="ignore"):
        value, slope, curve = fits.rows(ends)
        speed, curvature = _dot(slope, fits.odd_coefficients), _dot(curve, fits.odd_coefficients)
        at_zero = slope - (curvature / speed)[..., None] * value
        log_speed = np.log(np.abs(_dot(at_zero, fits.odd_coefficients)))
        gradient = at_zero / speed[..., None]
        kept = log_speed[1] - log_speed[0]
        sigma = np.sqrt(np.maximum(_square(gradient[1] - gradient[0], fits.odd_covariance), 0.0))
    log_ratio = np.stack([kept, sigma])
    log_ratio[:, ~np.isfinite(log_ratio).all(axis=0)] = np.nan
    return log_ratio


def extrema(fits: ArcFits) -> Floats:
    """(3, arcs): x, value and sigma of the extremum between the impacts; NaN where there is none."""
    grid = np.linspace(-0.9, 0.9, 13)
    shape = (fits.kappa.size, grid.size)
    values = np.einsum("agk,ak->ag", design(np.broadcast_to(grid, shape), fits.kappa), fits.coefficients)
    x = grid[np.argmax(np.abs(values), axis=1)]
    moving = np.ones(x.size, dtype=bool)
    with np.errstate(all="ignore"):
        for _ in range(12):
            _, slope, curve = fits.rows(x)
            step = _dot(slope, fits.coefficients) / _dot(curve, fits.coefficients)
            x = np.where(moving, x - np.minimum(np.maximum(step, -0.3), 0.3), x)
            moving &= np.abs(step) >= 1e-9
            if not moving.any():
                break
        row = fits.rows(x)[0]
        value = _dot(row, fits.coefficients)
        sigma = np.hypot(np.sqrt(_square(row, fits.covariance)), _MODEL_SHARE * value)
    tops = np.stack([x, value, sigma])
    tops[:, ~(np.abs(x) < 1.0)] = np.nan
    return tops


def _dot(rows: Floats, coefficients: Floats) -> Floats:
    return np.asarray(np.einsum("...ak,ak->...a", rows, coefficients))


def _square(rows: Floats, covariance: Floats) -> Floats:
    return np.asarray(np.einsum("...k,...k->...", (rows[..., None, :] @ covariance)[..., 0, :], rows))
