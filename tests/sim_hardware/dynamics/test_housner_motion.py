"""The plain block against closed forms, a high-precision reference and its own conservation laws."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import DOP853, solve_ivp
from scipy.special import ellipk, ellipkinc

from sim_hardware.dynamics import Body, Motion, Release, Restitution, simulate_motion
from sim_hardware.dynamics.step import TABLE

FR1 = Body(alpha_rad=0.215, p_rad_s=2.20, r0_m=1.525, mass_kg=5229.0, length_m=1.2)


def reference_impacts(body: Body, theta0: float, r: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Impact times and approach speeds by SciPy's DOP853 at 1e-12 with events, half-cycle by half-cycle."""

    def slope(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -(body.p_rad_s**2) * math.sin(body.alpha_rad - y[0])]

    def upright(_: float, y: np.ndarray) -> float:
        return float(y[0])

    upright.terminal = True  # type: ignore[attr-defined]
    upright.direction = -1  # type: ignore[attr-defined]
    t, y, times, speeds = 0.0, [theta0, 0.0], [], []
    for _ in range(n):
        run = solve_ivp(slope, (t, t + 9), y, method="DOP853", rtol=1e-12, atol=1e-15, events=upright)
        t, speed = float(run.t_events[0][0]), -float(run.y_events[0][0][1])
        times.append(t)
        speeds.append(speed)
        y = [0.0, r * speed]
    return np.array(times), np.array(speeds)


def energy(body: Body, motion: Motion, times: np.ndarray) -> np.ndarray:
    """Energy per inertia above upright, rad²/s²."""
    theta, omega, _ = motion.evaluate(times)
    potential = np.cos(body.alpha_rad - np.abs(theta)) - math.cos(body.alpha_rad)
    return np.asarray(0.5 * omega**2 + body.p_rad_s**2 * potential)


@pytest.mark.parametrize(("level", "r"), [(0.40, 0.93), (0.15, 0.82), (0.95, 0.9)])
def test_impact_times_and_speeds_agree_with_a_high_precision_reference(level: float, r: float) -> None:
    times, speeds = reference_impacts(FR1, level * FR1.alpha_rad, r, 20)
    motion = simulate_motion(FR1, Release(level * FR1.alpha_rad), Restitution(r), rest_amplitude_rad=1e-7)
    assert np.max(np.abs(motion.impact_time_s[:20] - times)) < 1e-6
    np.testing.assert_allclose(np.abs(motion.velocity_before_rad_s[:20]), speeds, rtol=1e-8)


def test_energy_is_conserved_between_impacts() -> None:
    motion = simulate_motion(FR1, Release(0.4 * FR1.alpha_rad), Restitution(0.93))
    edges = np.concatenate([[0.0], motion.impact_time_s])
    for start, end in pairwise(edges):
        inside = energy(FR1, motion, np.linspace(start, end, 40)[:-1])
        np.testing.assert_allclose(inside, inside[0], rtol=1e-9)


def test_acceleration_is_that_of_the_equation_of_motion() -> None:
    motion = simulate_motion(FR1, Release(0.35 * FR1.alpha_rad), Restitution(0.9))
    times = np.linspace(0.0, motion.impact_time_s[12], 3001)[1:-1]
    theta, _, acceleration = motion.evaluate(times)
    expected = -(FR1.p_rad_s**2) * np.sin(FR1.alpha_rad * np.sign(theta) - theta)
    np.testing.assert_allclose(acceleration, expected, atol=1e-8)


def test_rotation_between_impacts_agrees_with_a_reference() -> None:
    motion = simulate_motion(FR1, Release(0.3 * FR1.alpha_rad), Restitution(0.9))
    run = solve_ivp(
        lambda _, y: [y[1], -(FR1.p_rad_s**2) * math.sin(FR1.alpha_rad - y[0])],
        (0.0, motion.impact_time_s[0]),
        [0.3 * FR1.alpha_rad, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-15,
        dense_output=True,
    )
    times = np.linspace(0.0, motion.impact_time_s[0], 200)
    np.testing.assert_allclose(motion.rotation(times), run.sol(times)[0], atol=1e-10)
    np.testing.assert_allclose(motion.velocity(times)[:-1], run.sol(times)[1][:-1], atol=1e-10)


def test_the_conserved_block_has_the_elliptic_half_period() -> None:
    """r = 1: the half-cycle is a part of a pendulum's, known by elliptic integrals."""
    alpha, p, theta0 = 0.215, 2.2, 0.1
    # ψ = α − θ obeys ψ̈ = p² sin ψ: the inverted pendulum from rest at ψ₀ to ψ = α
    lowest = math.pi - (alpha - theta0)
    k = math.sin(lowest / 2)
    quarter = ellipk(k**2)
    phase = math.asin(math.sin((math.pi - alpha) / 2) / k)

    fall = (quarter - ellipkinc(phase, k**2)) / p
    motion = simulate_motion(FR1, Release(theta0), Restitution(1.0), duration_s=20.0)
    assert motion.impact_time_s[0] == pytest.approx(fall, rel=1e-9)
    np.testing.assert_allclose(np.diff(motion.impact_time_s), 2 * fall, rtol=1e-9)
    assert motion.ending == "duration over"


@pytest.mark.parametrize(("phi", "period"), [(0.15, 1.065), (0.25, 1.446), (0.35, 1.811), (0.40, 1.997)])
def test_small_angles_give_the_classic_periods(phi: float, period: float) -> None:
    """(4.1) is the linearisation: a slender block with the same p reaches it (Table 3.1's p = 2.20)."""
    slender = Body(alpha_rad=1e-3, p_rad_s=2.20, r0_m=1.5, mass_kg=1.0)
    motion = simulate_motion(
        slender, Release(phi * 1e-3), Restitution(1.0), duration_s=5.0, rest_amplitude_rad=1e-9
    )
    assert 4 * motion.impact_time_s[0] == pytest.approx(period, abs=6e-4)
    assert 4 * motion.impact_time_s[0] == pytest.approx(4 / 2.20 * math.acosh(1 / (1 - phi)), rel=1e-6)


@pytest.mark.parametrize(("r", "impacts", "lasts"), [(0.819, 11, 3.43), (0.895, 19, 6.05), (0.931, 29, 9.31)])
def test_small_angles_give_the_counted_impacts(r: float, impacts: int, lasts: float) -> None:
    slender = Body(alpha_rad=1e-3, p_rad_s=2.20, r0_m=1.5, mass_kg=1.0)
    motion = simulate_motion(slender, Release(0.35e-3), Restitution(r), rest_amplitude_rad=1e-9)
    peaks = np.abs(motion.peak_rotation_rad) / 1e-3
    n = int(np.argmax(peaks < 0.005))  # peak n follows impact n
    assert n == impacts
    assert motion.impact_time_s[n] == pytest.approx(lasts, abs=0.006)  # the end of that half-cycle


def test_impact_rule_and_peaks() -> None:
    motion = simulate_motion(FR1, Release(0.08), Restitution(0.87))
    np.testing.assert_allclose(motion.velocity_after_rad_s, 0.87 * motion.velocity_before_rad_s, rtol=1e-12)
    assert motion.peak_rotation_rad[0] == 0.08
    assert np.all(np.sign(motion.peak_rotation_rad[1:]) == np.sign(motion.velocity_after_rad_s[:-1]))
    speeds = motion.velocity(motion.peak_time_s[1:])
    np.testing.assert_allclose(speeds, 0.0, atol=1e-10)


def test_no_restitution_ends_at_the_first_impact_and_full_restitution_never() -> None:
    dead = simulate_motion(FR1, Release(0.08), Restitution(0.0))
    assert len(dead.impact_time_s) == 1
    assert dead.rest_s == dead.impact_time_s[0]
    assert np.all(dead.rotation(np.array([dead.rest_s, dead.rest_s + 5])) == 0.0)
    live = simulate_motion(FR1, Release(1e-4), Restitution(1.0), duration_s=30.0)
    assert math.isnan(live.rest_s)
    assert len(live.impact_time_s) > 1000
    assert np.abs(live.peak_rotation_rad[-2]) == pytest.approx(1e-4, rel=1e-6)


def test_rest_criterion_is_the_coming_peak() -> None:
    floor = 1e-4
    motion = simulate_motion(FR1, Release(0.07), Restitution(0.9), rest_amplitude_rad=floor)
    assert np.abs(motion.peak_rotation_rad[-1]) > floor
    last = motion.velocity_after_rad_s[-1]
    assert last**2 / (2 * FR1.p_rad_s**2 * math.sin(FR1.alpha_rad)) < floor * 1.001


def test_before_release_the_wall_is_held() -> None:
    motion = simulate_motion(FR1, Release(-0.05), Restitution(0.9))
    theta, omega, acceleration = motion.evaluate(np.array([-3.0, -1e-9]))
    assert np.all(theta == -0.05)
    assert not omega.any()
    assert not acceleration.any()


def test_times_need_not_ascend() -> None:
    motion = simulate_motion(FR1, Release(0.05), Restitution(0.9))
    times = np.linspace(-0.5, motion.end_s + 1.0, 997)
    shuffled = np.random.default_rng(3).permutation(times)
    order = np.argsort(shuffled)
    assert np.array_equal(motion.rotation(shuffled)[order], motion.rotation(times))


@settings(max_examples=60)
@given(
    level=st.floats(0.02, 0.97),
    r=st.floats(0.0, 1.0),
    alpha=st.floats(0.05, 0.6),
    p=st.floats(1.0, 2.3),
    scatter=st.floats(0.0, 0.02),
)
def test_energy_never_grows_and_the_mirror_image_moves_alike(
    level: float, r: float, alpha: float, p: float, scatter: float
) -> None:
    body = Body(alpha, p, 1.5, 5000.0)
    rule = Restitution(r, scatter, seed=5)
    right = simulate_motion(body, Release(level * alpha), rule, duration_s=6.0)
    left = simulate_motion(body, Release(-level * alpha), rule, duration_s=6.0)
    assert np.array_equal(right.impact_time_s, left.impact_time_s)
    times = np.linspace(0.0, 6.0, 500)
    assert np.array_equal(right.rotation(times), -left.rotation(times))
    levels = energy(body, right, times)
    assert np.all(np.diff(levels) <= 1e-9 * levels[0])


def test_values_without_meaning_are_refused_in_words() -> None:
    with pytest.raises(ValueError, match="falls over"):
        simulate_motion(FR1, Release(0.3), Restitution(0.9))
    with pytest.raises(ValueError, match="within 0 and 1"):
        simulate_motion(FR1, Release(0.1), Restitution(1.2))
    with pytest.raises(ValueError, match="alpha_rad"):
        Body(2.0, 2.2, 1.5, 5000.0)
    with pytest.raises(ValueError, match="too large"):
        Body(0.2, 9.0, 1.5, 5000.0)


def test_the_integrator_has_the_coefficients_that_scipy_has() -> None:
    table = np.zeros((24, 16))
    table[:12, :12], table[13:16] = DOP853.A, DOP853.A_EXTRA
    table[16, :12] = DOP853.B
    table[17] = [*DOP853.C, 1.0, *DOP853.C_EXTRA]
    table[18, :13], table[19, :13] = DOP853.E3, DOP853.E5
    table[20:] = DOP853.D
    np.testing.assert_array_equal(TABLE, table)
