"""The exact motion against an independent high-precision integration and against quadrature."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from daq_app.rocking.theory import classic as theory
from daq_app.rocking.theory.housner import (
    exact_amplitude,
    exact_energy,
    exact_impact_speed,
    exact_period,
    free_rocking,
)

P, ALPHA = 2.2, 0.215


def integrate(theta0: float, r: float, impacts: int, lean: float = 0.0):
    """Peaks, impact times and a dense θ(t) by event integration: shares nothing with the product."""

    def motion(_, y):
        return [y[1], -(P**2) * np.sin(ALPHA * side + lean - y[0])]

    def crossing(_, y):
        return y[0]

    crossing.terminal = True
    time, state, side = 0.0, np.array([theta0, 0.0]), np.sign(theta0)
    times, samples = [], []
    for _ in range(impacts):
        crossing.direction = -side
        part = solve_ivp(
            motion,
            (time, time + 10),
            state,
            "DOP853",
            events=crossing,
            rtol=1e-13,
            atol=1e-15,
            dense_output=True,
        )
        time = part.t_events[0][0]
        samples.append((part.t[:-1], part.y[0, :-1], part.y[1, :-1]))
        times.append((time, part.y_events[0][0][1]))
        side = -side
        state = np.array([0.0, r * part.y_events[0][0][1]])
    return times, samples


@pytest.mark.parametrize(
    ("phi", "r", "side", "lean"),
    [
        (0.15, 0.82, 1, 0.0),
        (0.35, 0.9, -1, 0.0),
        (0.9, 0.97, 1, 0.0),
        (0.4, 0.9, 1, 2e-3),
        (0.4, 0.9, -1, 2e-3),
    ],
)
def test_motion_matches_an_independent_integration(phi, r, side, lean):
    """A tilted base turns gravity: θ̈ = −p² sin(α·sgn θ + lean − θ)."""
    times, samples = integrate(side * phi * ALPHA, r, 8, lean=lean)
    motion = free_rocking(side * phi * ALPHA, r, P, ALPHA, lean_rad=lean)
    np.testing.assert_allclose(motion.impacts_s[:8], [t for t, _ in times], atol=1e-9)
    np.testing.assert_allclose(motion.speeds_before_rad_s[:8], [abs(v) for _, v in times], atol=1e-10)
    for t, theta, omega in samples:
        got_theta, got_omega = motion.at(t[1:])
        np.testing.assert_allclose(got_theta, theta[1:], atol=1e-9)
        np.testing.assert_allclose(got_omega, omega[1:], atol=1e-8)
        np.testing.assert_allclose(motion.rotation(t[1:]), got_theta, atol=2e-8)


def test_a_release_beyond_the_alpha_of_its_side_is_refused():
    with pytest.raises(ValueError, match=r"between 0 and α = 0\.205"):
        free_rocking(-0.21, 0.9, P, ALPHA, lean_rad=0.01)


@pytest.mark.parametrize("phi", [0.01, 0.15, 0.4, 0.8])
def test_exact_period_by_quadrature(phi):
    """T = 4 ∫ dθ/θ̇ with θ̇² = 2p²(cos(α−φα) − cos(α−θ)); θ = φα(1 − s²) removes the end's singularity."""
    peak = phi * ALPHA

    def integrand(s):
        theta = peak * (1 - s * s)
        drop = 2 * np.sin(ALPHA - (peak + theta) / 2) * np.sin((peak - theta) / 2)
        return 2 * peak * s / (P * np.sqrt(2 * drop)) if s else np.sqrt(2 * peak / np.sin(ALPHA - peak)) / P

    reference = 4 * quad(integrand, 0, 1, epsabs=1e-12, epsrel=1e-12)[0]
    assert exact_period(peak, P, ALPHA) == pytest.approx(reference, rel=1e-9)
    # The linearised form is close but not the same: never mixed silently.
    assert 1e-4 < exact_period(peak, P, ALPHA) / theory.period(phi, P) - 1 < 6e-3


def test_energy_and_amplitude_are_inverse():
    peaks = ALPHA * np.array([1e-4, 0.01, 0.3, 0.99])
    np.testing.assert_allclose(exact_amplitude(exact_energy(peaks, ALPHA), ALPHA), peaks, rtol=1e-9)


def test_energy_is_kept_within_a_half_cycle():
    motion = free_rocking(0.3 * ALPHA, 0.9, P, ALPHA)
    start, stop = motion.impacts_s[:2]
    theta, omega = motion.at(np.linspace(start, stop, 500)[1:-1])
    total = omega**2 / (2 * P**2) + np.cos(ALPHA - np.abs(theta))
    np.testing.assert_allclose(total, total[0], rtol=1e-9)
    assert exact_impact_speed(motion.peaks_rad[1], P, ALPHA) == pytest.approx(motion.speeds_after_rad_s[0])


def test_restitution_may_change_from_impact_to_impact():
    rs = [0.9, 0.8, 0.95, 0.85]
    motion = free_rocking(0.3 * ALPHA, rs, P, ALPHA, max_impacts=4)
    np.testing.assert_allclose(motion.speeds_before_rad_s[1:] / motion.speeds_before_rad_s[:-1], rs[:3])


def test_release_beyond_alpha_is_refused():
    with pytest.raises(ValueError, match="between 0 and α"):
        free_rocking(0.22, 0.9, P, ALPHA)
