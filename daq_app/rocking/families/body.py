"""α and p of the wall from half-cycles alone: how long each takes for its peak. Cheap, so once per family."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.theory.housner import exact_quarter_period

Floats = NDArray[np.float64]

_ROUNDS = 8
_STEP = 1e-5
_FEWEST = 4
_MODEL_SHARE = 2e-4
"""Relative standard uncertainty of a duration that is not Housner's."""


@dataclass(frozen=True, slots=True)
class BodyEstimate:
    """α and p with their standard uncertainties; the gain of the family is not in them."""

    alpha_rad: float
    sigma_alpha_rad: float
    p_rad_s: float
    sigma_p_rad_s: float


def body_of_half_cycles(
    peaks_rad: Floats,
    sigma_peaks_rad: Floats,
    durations_s: Floats,
    sigma_durations_s: Floats,
    alpha_rad: float,
    p_rad_s: float,
) -> BodyEstimate | None:
    """Least squares of T/2 = 2 K(peak; α, p) over whole half-cycles, arrays (n,); starts at nominal values.

    None with fewer than four half-cycles, or where they do not settle on a wall that exists.
    """
    peaks = np.abs(peaks_rad)
    good = np.isfinite(peaks) & np.isfinite(durations_s) & (durations_s > 0.0) & (peaks > 0.02 * alpha_rad)
    good &= np.isfinite(sigma_peaks_rad) & np.isfinite(sigma_durations_s)
    peaks, durations = peaks[good], durations_s[good]
    if peaks.size < _FEWEST:
        return None
    x = np.log([alpha_rad, p_rad_s])
    normal = np.eye(2)
    excess = 1.0
    for _ in range(_ROUNDS):
        alpha, p = float(np.exp(x[0])), float(np.exp(x[1]))
        if not (1.02 * float(peaks.max()) < alpha < 1.5 and 0.1 < p < 50.0):
            return None
        model = 2.0 * exact_quarter_period(peaks, p, alpha)
        by_alpha = 2.0 * exact_quarter_period(peaks, p, alpha * math.exp(_STEP)) / _STEP - model / _STEP
        by_peak = (2.0 * exact_quarter_period(peaks * (1.0 + _STEP), p, alpha) - model) / (_STEP * peaks)
        sigma = np.sqrt(
            sigma_durations_s[good] ** 2
            + (by_peak * sigma_peaks_rad[good]) ** 2
            + (_MODEL_SHARE * durations) ** 2
        )
        table = np.column_stack([by_alpha, -model]) / sigma[:, None]
        left = (durations - model) / sigma
        normal = table.T @ table
        change = np.linalg.solve(normal, table.T @ left)
        x = x + np.clip(change, -0.2, 0.2)
        excess = max(1.0, float(left @ left) / max(peaks.size - 2, 1))
        if float(np.abs(change).max()) < 1e-7:
            break
    deviations = np.sqrt(np.diag(np.linalg.inv(normal)) * excess)
    alpha, p = float(np.exp(x[0])), float(np.exp(x[1]))
    return BodyEstimate(alpha, alpha * float(deviations[0]), p, p * float(deviations[1]))
