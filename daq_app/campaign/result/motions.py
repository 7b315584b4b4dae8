"""Motion and periods of one test beside the classic theory: numbers, without a library that draws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from daq_app.campaign.summaries.summary import TestSummary
from daq_app.rocking.theory.classic import period
from daq_app.rocking.theory.housner import free_rocking

Floats = NDArray[np.float64]


def theory_motion(test: TestSummary) -> tuple[Floats, Floats, Floats] | None:
    """(seconds after the release, θ, θ̇) of Housner's block with the test's r by CRT; None without one.

    Set to the measured first impact, whose instant is known better than the release's.
    """
    method = test.methods.get("CRT") or test.methods.get("EAV")
    if method is None or not 0.0 < method.r <= 1.0 or not 0.0 < abs(test.theta0_rad) < test.alpha_rad:
        return None
    motion = free_rocking(test.theta0_rad, method.r, test.p_rad_s, test.alpha_rad)
    shift = test.impacts_s[0] - float(motion.impacts_s[0]) if test.impacts_s else 0.0
    rotation, velocity = motion.at(test.time_s - shift)
    return test.time_s, rotation, velocity


def measured_periods(test: TestSummary) -> tuple[Floats, Floats]:
    """(φ, T in s) of each half-cycle between two impacts: its peak over α, and twice its duration."""
    durations = np.diff(np.asarray(test.impacts_s))
    peaks = np.abs(test.phi)[1 : durations.size + 1]
    return peaks, 2.0 * durations[: peaks.size]


def period_deviation(test: TestSummary) -> float | None:
    """Mean relative deviation of the measured periods from Eqn 4.1; None without two impacts."""
    phi, measured = measured_periods(test)
    inside = (phi > 0.0) & (phi < 1.0)
    if not inside.any():
        return None
    return float((measured[inside] / period(phi[inside], test.p_rad_s) - 1.0).mean())
