"""Half-cycles from given peaks must be those of the whole simulated motion, losses and forcing included."""

from __future__ import annotations

import numpy as np
import pytest

from sim_hardware.dynamics import Body, Release, Restitution
from sim_hardware.dynamics.motion import motion_vector, simulate_vector
from sim_hardware.dynamics.shooting import FALL_S, FIRST_CROSSING, RISE_S, SPEED_IN, SPEED_OUT, half_cycles

BODY = Body(0.215, 2.204, 1.525, 5229.0)
FRACTIONS = np.array([0.85, 0.5, 0.15])


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"viscous": {"zeta": 0.01}, "coulomb": {"mu": 0.005}},
        {"alpha_asymmetry": {"delta": 0.002}, "quadratic_drag": {"c": 0.05}},
        {"ambient": {"amplitude": 0.05, "frequency": 1.3, "phase": 0.4}},
        {"winkler": {"theta_c": 2e-4}},
        {"initial_velocity": {"omega": 0.02}},
        {"residual_cable": {"k": 0.05}},
        {"slow_release": {"tau": 0.3}},
        {"slow_release": {"tau": 0.5, "even": 1.0}},
    ],
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_times_and_speeds_are_those_of_the_whole_motion(
    effects: dict[str, dict[str, float]], side: float
) -> None:
    vector = motion_vector(BODY, Release(side * 0.075), Restitution(0.93), effects)
    motion = simulate_vector(vector)
    n = 12
    times, rotations = motion.peak_time_s[:n].copy(), motion.peak_rotation_rad[:n].copy()
    if "initial_velocity" in effects:
        times[0], rotations[0] = 0.0, side * 0.075
    levels = np.abs(rotations)[:, None] * FRACTIONS
    out = np.empty((n, FIRST_CROSSING + 6))
    half_cycles(vector, times, rotations, levels, side, True, out)
    impacts = motion.impact_time_s
    np.testing.assert_allclose(times + out[:, FALL_S], impacts[:n], atol=2e-8)
    np.testing.assert_allclose(times[1:] - out[1:, RISE_S], impacts[: n - 1], atol=2e-8)
    np.testing.assert_allclose(out[:, SPEED_OUT], np.abs(motion.velocity_before_rad_s[:n]), rtol=1e-7)
    np.testing.assert_allclose(out[1:, SPEED_IN], np.abs(motion.velocity_after_rad_s[: n - 1]), rtol=1e-7)
    for j in range(3):
        falling = motion.rotation(times + out[:, FIRST_CROSSING + j])
        rising = motion.rotation(times[1:] - out[1:, FIRST_CROSSING + 3 + j])
        np.testing.assert_allclose(np.abs(falling), levels[:, j], atol=1e-8)
        np.testing.assert_allclose(np.abs(rising), levels[1:, j], atol=1e-8)


@pytest.mark.parametrize("unseen_s", [0.0, 0.06])
def test_a_slow_release_may_begin_before_anybody_sees_it(unseen_s: float) -> None:
    effects = {"slow_release": {"tau": 0.35, "even": 1.0}}
    vector = motion_vector(BODY, Release(0.033), Restitution(0.93), effects)
    motion = simulate_vector(vector)
    rotations = motion.peak_rotation_rad[:4].copy()
    times = np.append(0.0, motion.peak_time_s[1:4] - unseen_s)
    out = np.empty((4, FIRST_CROSSING + 6))
    half_cycles(vector, times, rotations, np.abs(rotations)[:, None] * FRACTIONS, 1.0, True, out)
    # The rope holds on for a third of a second after the first impact.
    assert motion.impact_time_s[0] < 0.55
    np.testing.assert_allclose(out[:, SPEED_OUT], np.abs(motion.velocity_before_rad_s[:4]), rtol=1e-6)
    np.testing.assert_allclose(out[1:, SPEED_IN], np.abs(motion.velocity_after_rad_s[:3]), rtol=1e-4)
    np.testing.assert_allclose(out[1:, RISE_S], motion.peak_time_s[1:4] - motion.impact_time_s[:3], rtol=1e-4)
