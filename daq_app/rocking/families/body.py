"""α and p of the wall from half-cycles alone: how long each takes for its peak. Cheap, so once per family."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.motion.swings import MotionTrack
from daq_app.rocking.theory.housner import exact_quarter_period

Floats = NDArray[np.float64]

_ROUNDS = 20
_STEP = 1e-5
_FEWEST = 4
SURVEY_P_SHARE: Final = 0.007
"""Relative standard uncertainty of the survey's p: R and I/R² known to 1 % each, assumed. Raising it widens
the errors of speeds of tests whose half-cycles tell no p, and hides sampling rates that are wrong by more."""
_MODEL_SHARE = 2e-4
"""Relative standard uncertainty of a duration that is not Housner's."""


@dataclass(frozen=True, slots=True)
class BodyEstimate:
    """α and p with their standard uncertainties; the gain of the family is not in them.

    All four are NaN where no block comes near the durations.
    """

    alpha_rad: float
    sigma_alpha_rad: float
    p_rad_s: float
    sigma_p_rad_s: float
    misfit: float
    """χ² per degree of freedom of the durations about those of the fitted block."""
    half_cycles: int
    """How many the fit is through."""


def body_of(track: MotionTrack, gain_sigma: float) -> BodyEstimate | None:
    """α and p by the half-cycles of one family; the error of its gain counts for α.

    What lets go slowly may hold the wall back until it first turns: the first half-cycle then is no free one.
    """
    arcs = [arc for arc in track.arcs[1 if track.fell_freely else 2 :] if arc is not None]
    columns = np.array(
        [
            (arc.peak_rad, arc.sigma_peak_rad, arc.duration_s, math.hypot(arc.sigma_start_s, arc.sigma_end_s))
            for arc in arcs
        ]
    ).reshape(-1, 4)
    peaks, sigma_peaks, durations, sigma_durations = columns.T
    body = body_of_half_cycles(
        peaks, sigma_peaks, durations, sigma_durations, track.settings.alpha_rad, track.settings.p_rad_s
    )
    if body is None:
        return None
    return replace(body, sigma_alpha_rad=math.hypot(body.sigma_alpha_rad, gain_sigma * body.alpha_rad))


def body_of_half_cycles(
    peaks_rad: Floats,
    sigma_peaks_rad: Floats,
    durations_s: Floats,
    sigma_durations_s: Floats,
    alpha_rad: float,
    p_rad_s: float,
) -> BodyEstimate | None:
    """Least squares of T/2 = 2 K(peak; α, p) over whole half-cycles, arrays (n,); starts at nominal values.

    α may be another one at either side, for a base that tilts and a zero that is off; their mean is given.
    None with fewer than four half-cycles, where all are to one side, which tell only one of the two, or where
    they lead to a wall that does not exist.
    """
    peaks, side = np.abs(peaks_rad), np.sign(peaks_rad)
    good = np.isfinite(peaks) & np.isfinite(durations_s) & (durations_s > 0.0) & (peaks > 0.02 * alpha_rad)
    good &= np.isfinite(sigma_peaks_rad) & np.isfinite(sigma_durations_s)
    peaks, durations, side = peaks[good], durations_s[good], side[good]
    if peaks.size < _FEWEST or abs(side.sum()) == side.size:
        return None
    # ln α, ln p, and ln of α at + over α at −.
    x = np.array([math.log(alpha_rad), math.log(p_rad_s), 0.0])
    normal = np.eye(x.size)
    misfit = 1.0
    for _ in range(_ROUNDS):
        alpha, p = np.exp(x[0] + 0.5 * side * x[2]), math.exp(x[1])
        if not (np.all(1.02 * peaks < alpha) and alpha.max() < 1.5 and 0.1 < p < 50.0):
            return None
        model = 2.0 * exact_quarter_period(peaks, p, alpha)
        by_alpha = 2.0 * exact_quarter_period(peaks, p, alpha * math.exp(_STEP)) / _STEP - model / _STEP
        by_peak = (2.0 * exact_quarter_period(peaks * (1.0 + _STEP), p, alpha) - model) / (_STEP * peaks)
        sigma = np.sqrt(
            sigma_durations_s[good] ** 2
            + (by_peak * sigma_peaks_rad[good]) ** 2
            + (_MODEL_SHARE * durations) ** 2
        )
        table = np.column_stack([by_alpha, -model, 0.5 * side * by_alpha]) / sigma[:, None]
        left = (durations - model) / sigma
        normal = table.T @ table
        change = np.linalg.solve(normal, table.T @ left)
        x = x + np.clip(change, -0.2, 0.2)
        misfit = float(left @ left) / (peaks.size - x.size)
        if float(np.abs(change).max()) < 1e-7:
            break
    else:
        return BodyEstimate(math.nan, math.nan, math.nan, math.nan, misfit, peaks.size)
    deviations = np.sqrt(np.diag(np.linalg.inv(normal)) * max(1.0, misfit))
    middle, p = math.exp(x[0]), math.exp(x[1])
    return BodyEstimate(
        middle, middle * float(deviations[0]), p, p * float(deviations[1]), misfit, peaks.size
    )
