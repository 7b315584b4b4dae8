"""Every effect on the motion against its equation, integrated by SciPy in unfolded coordinates."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from daq_app.config.rig import G_M_S2 as G
from sim_hardware.dynamics import (
    Body,
    Motion,
    Release,
    Restitution,
    motion_vector,
    simulate_batch,
    simulate_motion,
)
from sim_hardware.dynamics import parameters as par
from sim_hardware.dynamics.effects import MOTION_EFFECTS
from sim_hardware.dynamics.spec import parse_effect

FR1 = Body(alpha_rad=0.215, p_rad_s=2.20, r0_m=1.525, mass_kg=5229.0, length_m=1.2)
R = 0.9
THETA0 = 0.07
P2, ALPHA = FR1.p_rad_s**2, FR1.alpha_rad
HALF, HEIGHT, GYRATION2 = FR1.half_base_m, FR1.centroid_height_m, FR1.gyration_squared_m2

Acceleration = Callable[[float, float, float], float]
"""(t, θ, θ̇) → θ̈, signed."""


def gravity(theta: float, alpha: float = ALPHA) -> float:
    side = math.copysign(1.0, theta)
    return -P2 * math.sin(alpha * side - theta)


def reference(
    acceleration: Acceleration,
    n: int = 6,
    theta0: float = THETA0,
    omega0: float = 0.0,
    r: Callable[[float, int, int], float] = lambda speed, side, n: R,
    dwell: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Impact times and θ̇⁻. The side is held while a half-cycle is integrated, by a sliver of rotation."""
    t, theta, omega = 0.0, theta0, omega0
    times, speeds = [], []
    for k in range(n):
        side = 1 if (theta > 0 or (theta == 0 and omega > 0)) else -1

        def slope(t: float, y: np.ndarray, side: int = side) -> list[float]:
            return [y[1], acceleration(t, side * max(side * y[0], 1e-300), y[1])]

        def upright(_: float, y: np.ndarray, side: int = side) -> float:
            return float(side * y[0])

        upright.terminal = True  # type: ignore[attr-defined]
        upright.direction = -1  # type: ignore[attr-defined]
        run = solve_ivp(
            slope,
            (t, t + 9),
            [theta, omega],
            method="DOP853",
            rtol=1e-11,
            atol=1e-14,
            max_step=0.02,
            events=upright,
        )
        t, omega = float(run.t_events[0][0]), float(run.y_events[0][0][1])
        times.append(t)
        speeds.append(omega)
        theta, omega = 0.0, r(abs(omega), side, k) * omega
        t += dwell
    return np.array(times), np.array(speeds)


def simulated(effects: dict[str, dict[str, float]], theta0: float = THETA0) -> Motion:
    return simulate_motion(FR1, Release(theta0), Restitution(R), effects)


def agrees(motion: Motion, expected: tuple[np.ndarray, np.ndarray], tolerance: float = 1e-8) -> None:
    times, speeds = expected
    first = motion.impact_kind[: 2 * len(times)] == 0
    np.testing.assert_allclose(
        motion.impact_time_s[: 2 * len(times)][first][: len(times)], times, atol=tolerance
    )
    np.testing.assert_allclose(
        motion.velocity_before_rad_s[: 2 * len(times)][first][: len(times)], speeds, atol=tolerance
    )


def lopsided(right: float, left: float) -> Acceleration:
    """Gravity on a block whose edges lie `right` and `left` of the centre of mass."""

    def acceleration(_: float, theta: float, __: float) -> float:
        side, half = (1.0, right) if theta > 0 else (-1.0, left)
        inertia = GYRATION2 + half**2 + HEIGHT**2
        return -side * G * (half * math.cos(theta) - HEIGHT * math.sin(abs(theta))) / inertia

    return acceleration


@pytest.mark.parametrize("theta0", [THETA0, -THETA0])
def test_viscous_coulomb_quadratic_and_cubic(theta0: float) -> None:
    zeta, mu, c, kappa = 0.02, 0.03, 0.1, 0.3
    p = math.sqrt(P2)
    for effects, term in (
        ({"viscous": {"zeta": zeta}}, lambda q, w: -2 * zeta * p * w),
        ({"coulomb": {"mu": mu}}, lambda q, w: -mu * P2 * ALPHA * np.sign(w)),
        ({"quadratic_drag": {"c": c}}, lambda q, w: -c * w * abs(w)),
        ({"cubic": {"kappa": kappa}}, lambda q, w: -kappa * P2 * ALPHA * (q / ALPHA) ** 3),
    ):
        expected = reference(lambda t, q, w, term=term: gravity(q) + term(q, w), theta0=theta0)
        agrees(simulated(effects, theta0), expected, 5e-7 if "coulomb" in effects else 1e-8)


def test_pivot_shift_is_the_semi_rigid_block() -> None:
    a = 0.033
    moved = FR1.with_pivot_moved(a)
    assert moved.alpha_rad == pytest.approx(math.atan((HALF - a) / HEIGHT))
    assert moved.p_rad_s**2 == pytest.approx(
        G * math.hypot(HALF - a, HEIGHT) / (GYRATION2 + (HALF - a) ** 2 + HEIGHT**2)
    )
    other = simulate_motion(moved, Release(THETA0), Restitution(R))
    shifted = simulated({"pivot_shift": {"a": a}})
    np.testing.assert_allclose(shifted.impact_time_s, other.impact_time_s, rtol=1e-12)


def test_semi_rigid_numbers_of_the_paper() -> None:
    """FR1, l = 1.2 m: α' = 0.194 (−10 %), p' = 2.206 (Table 3.1's W, I_O, R0)."""
    body = Body(0.215, math.sqrt(51300 * 1.525 / 16107), 1.525, 51300 / 9.81)
    moved = body.with_pivot_moved(51300 / (1.28e6 * 1.2))
    assert moved.alpha_rad == pytest.approx(0.194, abs=1e-3)
    assert moved.p_rad_s == pytest.approx(2.206, abs=3e-3)


@pytest.mark.parametrize("theta_c", [1e-5, 9e-4, 5e-3])
def test_compliant_joint(theta_c: float) -> None:
    def acceleration(_: float, theta: float, __: float) -> float:
        q = abs(theta)
        factor = 1 - 2 / 3 * math.sqrt(theta_c / q) if q > theta_c else q / (3 * theta_c)
        inertia = GYRATION2 + HALF**2 + HEIGHT**2
        return -math.copysign(G, theta) * (HALF * factor * math.cos(q) - HEIGHT * math.sin(q)) / inertia

    agrees(simulated({"winkler": {"theta_c": theta_c}}), reference(acceleration), 2e-6)


def test_rolling_edge_conserves_the_energy_of_a_rolling_block() -> None:
    """Lagrangian check that shares nothing with the coded equation: T + V of rolling on a circle."""
    rho = 0.08
    motion = simulate_motion(FR1, Release(THETA0), Restitution(1.0), {"rounded_edge": {"rho": rho}})
    times = np.linspace(0.0, motion.impact_time_s[0], 200)
    theta, omega, _ = motion.evaluate(times)
    u, h = HALF - rho, HEIGHT - rho
    # centre of mass from the centre of the circle at (ρθ, ρ)
    x_rate = rho * omega + omega * (u * np.sin(theta) + h * np.cos(theta))
    z = rho + u * np.sin(theta) + h * np.cos(theta)
    z_rate = omega * (u * np.cos(theta) - h * np.sin(theta))
    energy = 0.5 * (x_rate**2 + z_rate**2 + GYRATION2 * omega**2) + G * z
    start = energy[0] - G * HEIGHT
    np.testing.assert_allclose(energy - energy[0], 0.0, atol=1e-9 * start)


def test_unequal_edges_tilted_base_and_eccentric_mass() -> None:
    delta, beta, e = 5e-3, -4e-3, 6e-3
    angle = math.atan(HALF / HEIGHT)
    agrees(
        simulated({"alpha_asymmetry": {"delta": delta}}),
        reference(lopsided(HEIGHT * math.tan(angle + delta), HEIGHT * math.tan(angle - delta))),
    )
    agrees(simulated({"eccentric_mass": {"e": e}}), reference(lopsided(HALF - e, HALF + e)))
    agrees(
        simulated({"base_tilt": {"beta": beta}}),
        reference(lambda t, q, w: -P2 * math.sin(math.copysign(ALPHA, q) - q - beta)),
    )


def test_unequal_levers_take_at_a_plastic_impact_what_the_edge_that_comes_down_asks_for() -> None:
    delta, e = 2e-3, 3e-3
    edges = HEIGHT * math.tan(ALPHA + delta) - HALF
    for effects, off in (
        ({"eccentric_mass": {"e": e, "plastic": 1.0}}, e),
        ({"alpha_asymmetry": {"delta": delta, "plastic": 1.0}}, -edges),
    ):
        ratio = simulated(effects)
        taken = (ratio.velocity_after_rad_s / ratio.velocity_before_rad_s)[:6]
        # The first swing ends on the edge of the − side, whose lever is longer by e.
        inertia = [GYRATION2 + HEIGHT**2 + (HALF + side * off) ** 2 for side in (1, -1, 1, -1, 1, -1)]
        plastic = 1.0 / np.array(inertia)
        np.testing.assert_allclose(taken / R, plastic / plastic[:2].mean(), rtol=2e-5)


def test_wear_counts_the_impacts_of_the_whole_campaign() -> None:
    loss, before = 0.03, 250
    effects = {"crushing": {"loss": loss}}
    motion = simulate_motion(FR1, Release(THETA0), Restitution(R), effects, impacts_before=before)
    t, theta, omega = 0.0, THETA0, 0.0
    for k in range(4):
        half = HEIGHT * math.tan(math.atan(HALF / HEIGHT) * (1 - loss * (before + k) / 100))
        times, speeds = reference(lopsided(half, half), 1, theta or 1e-300 * np.sign(omega), omega)
        t += times[0]
        assert motion.impact_time_s[k] == pytest.approx(t, abs=1e-8)
        theta, omega = 0.0, R * speeds[0]
    worn = simulate_motion(
        FR1, Release(THETA0), Restitution(R), {"restitution_wear": {"loss": 0.02}}, impacts_before=100
    )
    ratio = worn.velocity_after_rad_s / worn.velocity_before_rad_s
    np.testing.assert_allclose(ratio[:5], R * (1 - 0.02 * (100 + np.arange(5)) / 100), rtol=1e-12)


def test_restitution_by_speed_by_side_and_with_scatter() -> None:
    sloped = simulated({"restitution_slope": {"k": 0.05, "v_mean": 0.2}})
    ratio = sloped.velocity_after_rad_s / sloped.velocity_before_rad_s
    np.testing.assert_allclose(ratio, R + 0.05 * (np.abs(sloped.velocity_before_rad_s) - 0.2), rtol=1e-12)
    sided = simulated({"restitution_asymmetry": {"d": 0.01}})
    ratio = sided.velocity_after_rad_s / sided.velocity_before_rad_s
    np.testing.assert_allclose(ratio[:6], R + 0.01 * np.array([1, -1, 1, -1, 1, -1]), rtol=1e-12)
    scattered = simulate_motion(
        FR1, Release(THETA0), Restitution(R, seed=4), {"restitution_scatter": {"sigma": 0.01}}
    )
    ratio = scattered.velocity_after_rad_s / scattered.velocity_before_rad_s
    assert ratio.std() == pytest.approx(0.01 * R, rel=0.4)
    again = simulate_motion(FR1, Release(THETA0), Restitution(R, 0.01, seed=4))
    assert np.array_equal(again.impact_time_s, scattered.impact_time_s)


def test_dwell_and_bounce() -> None:
    tau = 0.008
    dwelling = simulated({"dwell": {"tau": tau}})
    agrees(dwelling, reference(lambda t, q, w: gravity(q), dwell=tau))
    middle = dwelling.impact_time_s[0] + tau / 2
    assert dwelling.rotation(np.array([middle]))[0] == 0.0
    hop = simulated({"bounce": {"tau": tau, "share": 0.3}})
    assert list(hop.impact_kind[:4]) == [0, 1, 0, 1]
    speed = abs(hop.velocity_before_rad_s[0])
    assert hop.impact_time_s[1] - hop.impact_time_s[0] == pytest.approx(tau * speed / 0.2)
    assert hop.velocity_after_rad_s[0] / hop.velocity_before_rad_s[0] == pytest.approx(R**0.3)
    assert hop.velocity_after_rad_s[1] / hop.velocity_before_rad_s[0] == pytest.approx(R)
    flying = np.linspace(hop.impact_time_s[0], hop.impact_time_s[1], 9)[1:-1]
    np.testing.assert_allclose(hop.velocity(flying), hop.velocity_after_rad_s[0], rtol=1e-12)
    assert hop.rest_s < 30.0


def test_release_effects() -> None:
    k, slack, omega0 = 0.1, 0.02, 0.03
    agrees(
        simulated({"residual_cable": {"k": k, "slack": slack}}, -THETA0),
        reference(lambda t, q, w: gravity(q) + k * P2 * max(-q - slack, 0.0), theta0=-THETA0),
        2e-7,
    )
    agrees(
        simulated({"initial_velocity": {"omega": omega0}}, -THETA0),
        reference(lambda t, q, w: gravity(q), theta0=-THETA0, omega0=-omega0),
    )
    hold = P2 * math.sin(ALPHA - THETA0)
    for tau, even in ((0.1, 0.0), (0.1, 1.0), (0.35, 0.0), (0.4, 1.0)):

        def share(t: float, tau: float = tau, even: float = even) -> float:
            return max(1.0 - t / (2.0 * tau), 0.0) if even else math.exp(-t / tau)

        # A rope that is paid out pulls the wall back until it turns on the other side, and is slack then.
        held = reference(lambda t, q, w: gravity(q) + (hold * share(t) if q > 0 or w < 0 else 0.0), 2)
        agrees(simulated({"slow_release": {"tau": tau, "even": even}}), held, 2e-7 if even else 1e-8)


@pytest.mark.parametrize(
    ("loose", "release", "pull"),
    [
        (0.05, 0.0, lambda q: max(0.05 - q, 0.0)),
        (0.02, 0.0, lambda q: max(0.02 - q, 0.0)),
        (-0.015, 0.0, lambda q: -max(q + 0.015, 0.0)),
        # Released to −x, where the cable is attached as well: it pulls there.
        (0.0, 0.05, lambda q: -max(q + 0.05, 0.0)),
        (0.01, -0.02, lambda q: max(0.03 - q, 0.0)),
    ],
)
def test_a_taut_cable(loose: float, release: float, pull: Callable[[float], float]) -> None:
    k = 0.08
    held = simulated({"taut_cable": {"k": k, "loose": loose, "release": release}}, -THETA0)
    agrees(held, reference(lambda t, q, w: gravity(q) + k * P2 * pull(q), theta0=-THETA0), 2e-7)


def test_a_vibrating_floor() -> None:
    amplitude, f, phase = 0.3, 2.3, 0.7

    def acceleration(t: float, theta: float, _: float) -> float:
        floor = amplitude * math.sin(2 * math.pi * f * t + phase)
        return gravity(theta) - P2 * floor / G * math.cos(ALPHA - abs(theta))

    effects = {"ambient": {"amplitude": amplitude, "frequency": f, "phase": phase}}
    for theta0 in (THETA0, -THETA0):
        agrees(simulated(effects, theta0), reference(acceleration, 4, theta0))


@pytest.mark.parametrize("spec", MOTION_EFFECTS, ids=lambda spec: spec.name)
def test_each_effect_is_off_at_zero_and_acts_within_its_range(spec) -> None:  # type: ignore[no-untyped-def]
    plain = motion_vector(FR1, Release(THETA0), Restitution(R))
    with_zero = {p.name: 0.0 if p is spec.strength else p.default or p.high for p in spec.parameters}
    off = simulate_motion(FR1, Release(THETA0), Restitution(R), {spec.name: with_zero}, impacts_before=100)
    base = simulate_motion(FR1, Release(THETA0), Restitution(R), impacts_before=100)
    assert np.array_equal(off.impact_time_s, base.impact_time_s)
    assert spec.strength.low < spec.strength.high
    assert len({p.index for p in spec.parameters}) == len(spec.parameters)
    vector = motion_vector(
        FR1, Release(THETA0), Restitution(R), {spec.name: {spec.strength.name: spec.strength.high}}
    )
    assert np.any(vector != plain)
    if spec.strength.index < par.MODE_HZ:  # the others only show in the sensors
        strong = simulate_motion(
            FR1,
            Release(THETA0),
            Restitution(R, seed=1),
            {spec.name: {spec.strength.name: spec.strength.high}},
            impacts_before=100,
        )
        assert np.abs(strong.impact_time_s[:5] - base.impact_time_s[:5]).max() > 2e-4


def test_a_batch_is_its_single_runs() -> None:
    times = np.linspace(-0.1, 8.0, 700)
    vectors = np.array(
        [motion_vector(FR1, Release(s * THETA0), Restitution(r)) for s in (1, -1) for r in (0.8, 0.9)]
    )
    batch = simulate_batch(vectors, times)
    for row, (s, r) in zip(batch, ((1, 0.8), (1, 0.9), (-1, 0.8), (-1, 0.9)), strict=True):
        single = simulate_motion(FR1, Release(s * THETA0), Restitution(r))
        assert np.array_equal(row, single.rotation(times))
    with pytest.raises(ValueError, match="vectors must be"):
        simulate_batch(vectors[:, :5], times)


def test_overturning_is_said() -> None:
    effects = {"initial_velocity": {"omega": 0.6}}
    motion = simulate_motion(FR1, Release(0.2), Restitution(R), effects)
    assert motion.ending == "overturned"
    assert math.isnan(motion.rest_s)


def test_effects_are_parsed_from_words() -> None:
    assert parse_effect("viscous:zeta=0.006") == ("viscous", {"zeta": 0.006})
    assert parse_effect("residual_cable: k=0.1, slack = 0.02") == (
        "residual_cable",
        {"k": 0.1, "slack": 0.02},
    )
    assert parse_effect("polarity@WP-1") == ("polarity@WP-1", {})
    for text in ("viscous:zeta", "viscous:zeta=much"):
        with pytest.raises(ValueError, match="should read parameter=number"):
            parse_effect(text)
