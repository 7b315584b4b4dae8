"""Half-cycles of a test with every stated error: measurement, zero, timing, p and the gain of the family."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.analysis.own_body import ImpactSpeeds
from daq_app.rocking.analysis.results import HalfCycle
from daq_app.rocking.motion.swings import ImpactTime, MotionTrack
from daq_app.rocking.motion.transients import Onset
from daq_app.rocking.theory import classic as theory

Floats = NDArray[np.float64]

_TIMING_S = 2e-5
"""Standard uncertainty of the time base between channels that the task plan leaves."""


def half_cycles_of(
    track: MotionTrack,
    speeds: ImpactSpeeds,
    filtered_peaks_rad_s: Floats,
    onsets: Sequence[Onset | None],
    gain_sigma: float,
) -> tuple[HalfCycle, ...]:
    """One for the release and one per impact; `gain_sigma` is the relative error of the family's gain."""
    settings = track.settings
    impacts = track.impacts
    starts = [track.release.time_s, *(impact.time_s for impact in impacts)]
    sigma_starts = [math.nan, *(math.hypot(one.noise_s, one.zero_s, _TIMING_S) for one in impacts)]
    sigma_durations = [math.nan, *map(_sigma_between, impacts, impacts[1:]), math.nan]
    before, after = [math.nan, *speeds.before_rad_s.tolist()], [math.nan, *speeds.after_rad_s.tolist()]
    sigma_before = [math.nan, *speeds.sigma_before_rad_s.tolist()]
    sigma_after = [math.nan, *speeds.sigma_after_rad_s.tolist()]
    filtered = [math.nan, *filtered_peaks_rad_s.tolist()]
    heard = [None, *onsets]
    peak, sigma = [*track.peaks_rad, math.nan], [*track.sigma_peaks_rad, math.nan]
    cycles = []
    for n, start in enumerate(starts):
        phi = abs(peak[n]) / settings.alpha_rad
        theoretical = float(theory.period(phi, settings.p_rad_s)) if 0.0 <= phi < 1.0 else math.nan
        shock = heard[n]
        last = n + 1 >= len(starts)
        cycles.append(
            HalfCycle(
                n=n,
                start_s=start,
                sigma_start_s=sigma_starts[n],
                duration_s=math.nan if last else starts[n + 1] - start,
                sigma_duration_s=sigma_durations[n],
                peak_rad=peak[n],
                sigma_peak_rad=math.hypot(sigma[n], gain_sigma * peak[n]),
                phi=phi,
                speed_before_rad_s=before[n],
                sigma_speed_before_rad_s=math.hypot(sigma_before[n], gain_sigma * before[n]),
                speed_after_rad_s=after[n],
                sigma_speed_after_rad_s=math.hypot(sigma_after[n], gain_sigma * after[n]),
                speed_filtered_rad_s=filtered[n],
                jump_ratio=abs(after[n] / before[n]) if before[n] else math.nan,
                accelerometer_s=math.nan if shock is None else shock.time_s,
                period_theory_s=theoretical / (4.0 if n == 0 else 2.0),
            )
        )
    return tuple(cycles)


def _sigma_between(first: ImpactTime, second: ImpactTime) -> float:
    """Standard uncertainty of the time between two impacts, s.

    A wrong zero moves one forwards and the other backwards; a wrong time base moves both alike.
    """
    return math.hypot(first.noise_s, second.noise_s, first.zero_s + second.zero_s)
