"""The moment of release, found backwards from the fall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from daq_app.rocking.theory.housner import exact_quarter_period, half_cycle_rotation

Floats = NDArray[np.float64]

_SHARE: Final = 0.001
"""Misfit, as a share of θ0, that weighs as much as one sigma of the time scale."""
_SCALE_SIGMA: Final = 0.02
_STEP_RAD: Final = 1e-7


@dataclass(frozen=True, slots=True)
class Release:
    """When the wall began to move freely, as its fall shows it."""

    time_s: float
    rotation_rad: float
    """Signed rotation it fell from."""
    residual_rad: float
    """rms misfit: large where the release was no clean one."""


def locate_release(
    time_s: Floats, rotation_rad: Floats, theta0_rad: float, p_rad_s: float, alpha_rad: float
) -> Release | None:
    """Fit hold and fall, θ0 up to t_r and Housner's free fall from rest after it.

    `time_s`, `rotation_rad` (n,): from some time before the release to some time in the fall, at
    least past a drop of 10 %. t_r, θ0 and a time scale (p may differ) are free. None where the
    record shows no such fall.
    """
    side = 1.0 if theta0_rad > 0 else -1.0
    good = np.isfinite(rotation_rad)
    t, y = time_s[good], side * rotation_rad[good]
    level = abs(theta0_rad)
    fallen = np.flatnonzero(y < 0.9 * level)
    if t.size < 10 or fallen.size < 5 or not 0.0 < level < 0.98 * alpha_rad:
        return None
    quarter = float(exact_quarter_period(level, p_rad_s, alpha_rad))
    lag = np.arccosh(1.0 + 0.1 * level / (alpha_rad - level)) / p_rad_s
    guess = float(t[fallen[0]]) - lag
    fall = _Fall(t - guess, y, level, quarter, p_rad_s, alpha_rad)
    start, height, rms = fall.fitted()
    return Release(float(guess + start * quarter), float(side * height * alpha_rad), rms)


@dataclass(frozen=True, slots=True)
class _Fall:
    """Least squares of hold and fall over (start / quarter, height / α, time scale)."""

    time_s: Floats
    rotation_rad: Floats
    level_rad: float
    quarter_s: float
    p_rad_s: float
    alpha_rad: float

    def fitted(self) -> tuple[float, float, float]:
        """start / quarter, height / α, and the rms misfit in rad."""
        start = np.array([0.0, self.level_rad / self.alpha_rad, 1.0])
        solution = least_squares(self._residual, start, jac=self._jacobian, method="lm", max_nfev=60)
        rms = math.sqrt(float(np.mean(solution.fun[:-1] ** 2))) * _SHARE * self.level_rad
        return float(solution.x[0]), float(solution.x[1]), rms

    def _elapsed(self, x: Floats) -> tuple[Floats, Floats]:
        """Time in the fall, and whether it lies within what the model knows."""
        free = (self.time_s - x[0] * self.quarter_s) / x[2]
        elapsed = np.minimum(np.maximum(free, 0.0), 1.3 * self.quarter_s)
        return elapsed, free == elapsed

    def _peak(self, x: Floats) -> float:
        return float(min(max(x[1], 0.01), 0.99)) * self.alpha_rad

    def _residual(self, x: Floats) -> Floats:
        model = half_cycle_rotation(self._elapsed(x)[0], self._peak(x), self.p_rad_s, self.alpha_rad)[0]
        # The time scale is known to a few per cent: without the last one, a short fall trades it for t_r.
        residuals = np.empty(model.size + 1)
        np.divide(model - self.rotation_rad, _SHARE * self.level_rad, out=residuals[:-1])
        residuals[-1] = (x[2] - 1.0) / _SCALE_SIGMA
        return residuals

    def _jacobian(self, x: Floats) -> Floats:
        elapsed, inside = self._elapsed(x)
        peaks = self._peak(x) + np.array([[0.0], [_STEP_RAD]])
        (model, other), (speed, _) = half_cycle_rotation(elapsed, peaks, self.p_rad_s, self.alpha_rad)
        slopes = np.zeros((elapsed.size + 1, 3))
        slopes[:-1, 0] = -(speed * inside) * self.quarter_s / x[2]
        slopes[:-1, 1] = (other - model) / _STEP_RAD * self.alpha_rad
        slopes[:-1, 2] = -(speed * inside) * elapsed / x[2]
        slopes /= _SHARE * self.level_rad
        slopes[-1, 2] = 1.0 / _SCALE_SIGMA
        return slopes
