"""The classic theory beside the measured motion: what the wall would do with the r found so far."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.messages.published import EstimateMessage
from daq_app.config.rig import Specimen
from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.housner import free_rocking

Array = NDArray[np.float64]


def current_restitution(estimate: EstimateMessage) -> tuple[str, float] | None:
    """The r that the overlay uses and the name of its estimator: CRT, else EAV, else r_max."""
    for name, mean in (("CRT", estimate.crt_mean), ("EAV", estimate.eav_mean), ("r_max", estimate.r_max)):
        if mean is not None and 0.0 < mean <= 1.0:
            return name, mean
    return None


def housner_motion(
    specimen: Specimen, estimate: EstimateMessage, duration_s: float, rate_hz: float, points: int = 800
) -> tuple[Array, Array, Array]:
    """(time since release in s, θ in rad, θ̇ in rad/s) of Housner's block with the current r.

    The theory is set to the measured first impact, because the instant at which a hand-made release
    lets go is less certain than the impact. Empty arrays while there is no motion to compare with.
    """
    empty = np.empty(0)
    chosen = current_restitution(estimate)
    if chosen is None or not 0.0 < abs(estimate.theta0_rad) < specimen.alpha0_rad or duration_s <= 0:
        return empty, empty, empty
    motion = free_rocking(estimate.theta0_rad, chosen[1], specimen.p_rad_s, specimen.alpha0_rad)
    shift = 0.0
    if estimate.impact_samples:
        first_impact_s = (estimate.impact_samples[0] - estimate.release_sample) / rate_hz
        shift = first_impact_s - float(motion.impacts_s[0])
    time = np.linspace(0.0, duration_s, points)
    rotation, velocity = motion.at(time - shift)
    return time, rotation, velocity


def period_curve(specimen: Specimen, largest_phi: float = 0.6) -> tuple[Array, Array]:
    """(φ, T in s) of Eqn. 4.1, as in Figure 4.2."""
    phi = np.linspace(0.002, largest_phi, 120)
    return phi, np.asarray(theory.period(phi, specimen.p_rad_s))


def measured_periods(estimate: EstimateMessage, alpha_rad: float, rate_hz: float) -> tuple[Array, Array]:
    """(φ, T in s) of each half-cycle between two impacts: its peak over α, and twice its duration."""
    impacts = np.asarray(estimate.impact_samples)
    peaks = np.abs(np.asarray(estimate.peaks_rad))
    count = min(impacts.size - 1, peaks.size - 1)
    if count < 1:
        return np.empty(0), np.empty(0)
    return peaks[1 : count + 1] / alpha_rad, 2.0 * np.diff(impacts)[:count] / rate_hz
