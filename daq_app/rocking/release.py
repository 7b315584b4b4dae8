"""The moment of release, found backwards from the fall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from daq_app.rocking.housner import exact_quarter_period, half_cycle_rotation

Floats = NDArray[np.float64]


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

    def residual(parameters: Floats) -> Floats:
        start, height, scale = parameters
        elapsed = np.clip((t - guess - start * quarter) / scale, 0.0, 1.3 * quarter)
        model = half_cycle_rotation(elapsed, np.clip(height, 0.01, 0.99) * alpha_rad, p_rad_s, alpha_rad)[0]
        # The time scale is known to a few per cent: without this, a short fall trades it for t_r.
        return np.append((model - y) / (0.001 * level), (scale - 1.0) / 0.02)

    result = least_squares(residual, [0.0, level / alpha_rad, 1.0], method="lm", max_nfev=60)
    start, height, _ = result.x
    rms = float(np.sqrt(np.mean(result.fun[:-1] ** 2))) * 0.001 * level
    return Release(float(guess + start * quarter), float(side * height * alpha_rad), rms)
