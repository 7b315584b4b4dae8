"""What each method gets wrong by itself: the same analysis on simulated motion like the test's.

Exact Housner motion with a known r, this test's amplitude, number of impacts and noise, is put
through the same half-cycle fits, filter, peaks and fits as the recording. The mean error of each
method is its bias; no sensor fault and no physics beyond Housner is in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.estimators import RestitutionEstimate, eav
from daq_app.rocking.filtered_peaks import corrected_peaks, filtered_peaks
from daq_app.rocking.housner import free_rocking
from daq_app.rocking.motion import MotionSettings, MotionTrack
from daq_app.rocking.motion_fit import fit_motion
from daq_app.rocking.results import Bias
from daq_app.rocking.velocity import VelocityFilter

Floats = NDArray[np.float64]

_FIT_RUNS = 3
"""The fit of the whole motion costs more and scatters less: fewer runs are enough."""


@dataclass(frozen=True, slots=True)
class BiasSettings:
    """The test to imitate."""

    settings: MotionSettings
    velocity_filter: VelocityFilter
    theta0_rad: float
    sigma_theta0_rad: float
    r: float
    impacts: int
    noise_rad: float
    with_fit: bool = True
    runs: int = 6
    seed: int = 0


def method_bias(settings: BiasSettings) -> dict[str, Bias]:
    """Bias by method (keys of `TestAnalysis.estimates`, and ``fit``)."""
    errors: dict[str, list[float]] = {}
    rng = np.random.default_rng(settings.seed)
    for run in range(settings.runs):
        for method, r in _one(settings, rng, with_fit=settings.with_fit and run < _FIT_RUNS).items():
            errors.setdefault(method, []).append(r - settings.r)
    return {method: summarise(values) for method, values in errors.items()}


def summarise(errors: list[float]) -> Bias:
    """Mean error, its standard error and the scatter of single runs."""
    values = np.asarray(errors)
    scatter = float(values.std(ddof=1)) if values.size > 1 else math.nan
    return Bias(float(values.mean()), scatter / math.sqrt(values.size), scatter, values.size)


def bias_by(
    analyse: Callable[[int], Mapping[str, RestitutionEstimate]], true_r: float, runs: int
) -> dict[str, Bias]:
    """Bias from whole simulated tests: `analyse(seed)` simulates one with `true_r` and gives its estimates.

    The simulator is the caller's: this package knows none.
    """
    errors: dict[str, list[float]] = {}
    for seed in range(runs):
        for method, estimate in analyse(seed).items():
            if estimate.r is not None:
                errors.setdefault(method, []).append(estimate.r - true_r)
    return {method: summarise(values) for method, values in errors.items()}


def _one(wanted: BiasSettings, rng: np.random.Generator, *, with_fit: bool) -> dict[str, float]:
    """r by every method on one simulated motion."""
    settings = wanted.settings
    p, alpha, rate = settings.p_rad_s, settings.alpha_rad, settings.rate_hz
    theta0 = math.copysign(min(abs(wanted.theta0_rad), 0.95 * alpha), wanted.theta0_rad)
    motion = free_rocking(theta0, wanted.r, p, alpha, release_s=0.6, max_impacts=max(wanted.impacts, 2))
    time = np.arange(round((motion.impacts_s[-1] + 0.1) * rate)) / rate
    rotation = motion.at(time)[0] + rng.normal(0.0, wanted.noise_rad, time.size)
    first = int(np.searchsorted(time, motion.impacts_s[0] + 1e-3))
    track = MotionTrack.begin(settings, time[:first], rotation[:first], motion.release_s, theta0)
    for crossing, speed in zip(motion.impacts_s, motion.speeds_before_rad_s, strict=True):
        # The detector finds a crossing from some 80 samples around it.
        jitter = wanted.noise_rad / max(speed, 1e-3) / 6.0
        track.add_impact(float(crossing + rng.normal(0.0, jitter)), time, rotation)
    velocity = wanted.velocity_filter.velocity(rotation)
    peaks = filtered_peaks(time, velocity, track.impacts_s)
    noise = np.full(peaks.size, wanted.velocity_filter.noise_rad_s(wanted.noise_rad)).tolist()
    corrected = corrected_peaks(peaks, wanted.velocity_filter, p, alpha)
    by_speeds, by_peaks = track.eav(), track.crt()
    found = {
        "eav": by_speeds.r,
        "crt": by_peaks.r,
        "crt_exact": track.crt_exact().r,
        "eav_filtered": eav(peaks.tolist(), noise).r,
        "eav_filtered_corrected": eav(corrected.tolist(), noise).r,
    }
    if with_fit:
        fit = fit_motion(
            time,
            rotation,
            release_s=track.release.time_s,
            theta0_rad=track.theta0_rad,
            impacts_s=track.impacts_s,
            peaks_rad=track.peaks_rad,
            speeds_rad_s=track.speeds_before_rad_s,
            r=found["crt"] or wanted.r,
            scatter=max(by_speeds.scatter, by_peaks.scatter),
            noise_rad=wanted.noise_rad,
            p_rad_s=p,
            alpha_rad=alpha,
        )
        found["fit"] = None if fit is None else fit.r
    return {method: r for method, r in found.items() if r is not None}
