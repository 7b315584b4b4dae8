"""What each method gets wrong by itself: the same analysis on simulated motion like the test's.

Exact Housner motion with a known r, this test's amplitude, number of impacts and noise, is put
through the same half-cycle fits, filter, peaks and fits as the recording. The mean error of each
method is its bias; no sensor fault and no physics beyond Housner is in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.results import Bias
from daq_app.rocking.estimators import RestitutionEstimate, eav_series, estimate_all
from daq_app.rocking.motion.filtered_peaks import corrected_peaks, filtered_peaks
from daq_app.rocking.motion.motion_fit import MotionFit, fit_motion
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.motion.velocity import VelocityFilter
from daq_app.rocking.theory.housner import FreeRocking, free_rocking

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
    for r_by_method in _estimates(settings):
        for method, r in r_by_method.items():
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


@dataclass(frozen=True, slots=True)
class _Simulated:
    """One simulated motion, tracked as a recording is."""

    time_s: Floats
    rotation_rad: Floats
    track: MotionTrack
    filtered_rad_s: Floats
    """Peaks of the filtered velocity."""


@dataclass(frozen=True, slots=True)
class _Exact:
    """The motion that all simulated tests share before noise comes to it."""

    motion: FreeRocking
    time_s: Floats
    rotation_rad: Floats

    @classmethod
    def of(cls, wanted: BiasSettings) -> _Exact:
        settings = wanted.settings
        p, alpha = settings.p_rad_s, settings.alpha_rad
        theta0 = math.copysign(min(abs(wanted.theta0_rad), 0.95 * alpha), wanted.theta0_rad)
        motion = free_rocking(theta0, wanted.r, p, alpha, release_s=0.6, max_impacts=max(wanted.impacts, 2))
        time = np.arange(round((motion.impacts_s[-1] + 0.1) * settings.rate_hz)) / settings.rate_hz
        return cls(motion, time, motion.rotation(time))

    @property
    def theta0_rad(self) -> float:
        """Signed release rotation."""
        return self.motion.side * float(self.motion.peaks_rad[0])


def _simulated(wanted: BiasSettings, exact: _Exact, rng: np.random.Generator) -> _Simulated:
    motion, time = exact.motion, exact.time_s
    rotation = exact.rotation_rad + wanted.noise_rad * rng.standard_normal(time.size)
    first = int(np.searchsorted(time, motion.impacts_s[0] + 1e-3))
    track = MotionTrack.begin(
        wanted.settings, time[:first], rotation[:first], motion.release_s, exact.theta0_rad
    )
    # The detector finds a crossing from some 80 samples around it.
    jitter = wanted.noise_rad / np.maximum(motion.speeds_before_rad_s, 1e-3) / 6.0
    track.add_impacts((motion.impacts_s + rng.normal(0.0, jitter)).tolist(), time, rotation)
    velocity = partial(wanted.velocity_filter.velocity_of_part, rotation)
    return _Simulated(time, rotation, track, filtered_peaks(time, velocity, track.impacts_s))


def _estimates(wanted: BiasSettings) -> list[dict[str, float]]:
    """r by every method on each simulated motion; the slopes of all of them are found together."""
    rng = np.random.default_rng(wanted.seed)
    exact = _Exact.of(wanted)
    runs = [_simulated(wanted, exact, rng) for _ in range(wanted.runs)]
    p, alpha = wanted.settings.p_rad_s, wanted.settings.alpha_rad
    filtered = np.array([run.filtered_rad_s for run in runs])
    corrected = corrected_peaks(filtered, wanted.velocity_filter, p, alpha)
    noise = np.full(filtered.shape[1], wanted.velocity_filter.noise_rad_s(wanted.noise_rad))
    series = {
        "eav": [run.track.eav_series() for run in runs],
        "crt": [run.track.crt_series() for run in runs],
        "crt_exact": [run.track.crt_exact_series() for run in runs],
        "eav_filtered": [eav_series(row, noise) for row in filtered],
        "eav_filtered_corrected": [eav_series(row, noise) for row in corrected],
    }
    flat = iter(estimate_all([one for rows in series.values() for one in rows]))
    estimates = {method: [next(flat) for _ in rows] for method, rows in series.items()}
    r_by_run: list[dict[str, float]] = []
    for number, run in enumerate(runs):
        of_run = {method: rows[number] for method, rows in estimates.items()}
        known = {method: estimate.r for method, estimate in of_run.items() if estimate.r is not None}
        fit = _fitted(wanted, run, of_run) if wanted.with_fit and number < _FIT_RUNS else None
        r_by_run.append(known if fit is None else {**known, "fit": fit.r})
    return r_by_run


def _fitted(
    wanted: BiasSettings, run: _Simulated, estimates: Mapping[str, RestitutionEstimate]
) -> MotionFit | None:
    by_speeds, by_peaks = estimates["eav"], estimates["crt"]
    return fit_motion(
        run.time_s,
        run.rotation_rad,
        release_s=run.track.release.time_s,
        theta0_rad=run.track.theta0_rad,
        impacts_s=run.track.impacts_s,
        peaks_rad=run.track.peaks_rad,
        speeds_rad_s=run.track.speeds_before_rad_s,
        r=by_peaks.r or wanted.r,
        scatter=max(by_speeds.scatter, by_peaks.scatter),
        noise_rad=wanted.noise_rad,
        p_rad_s=wanted.settings.p_rad_s,
        alpha_rad=wanted.settings.alpha_rad,
        edges_yield=False,
    )
