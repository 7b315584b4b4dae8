"""The independent mechanics against closed forms and energy balances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from daq_app.gap.blind.making.detectability import block_swing
from daq_app.gap.blind.world.events.joint import cubic_joint, rigid, rounded_edge, winkler
from daq_app.gap.blind.world.events.mechanics import Release, build
from daq_app.gap.blind.world.events.motion import Motion, integrate
from daq_app.gap.blind.world.wall import Wall

THETA0 = 0.06


@pytest.fixture(scope="module")
def wall() -> Wall:
    """FR1 as in Table 3.1 with a lossy impact, so that tests are short."""
    return Wall(5229.36, 0.32535, 1.48989, 3945.0, 2.9, 1.2, 0.75, 0.0)


def go(wall: Wall, effects: dict[str, dict[str, float]] | None = None, theta0: float = THETA0) -> Motion:
    release = Release(theta0, 0.0, 2.0, 5)
    return integrate(build(wall, effects or {}, release), release)


def test_derived_parameters_are_those_of_the_paper(wall: Wall) -> None:
    assert wall.alpha == pytest.approx(0.215, rel=2e-3)
    assert wall.p == pytest.approx(2.204, rel=2e-3)


def test_first_quarter_takes_the_time_of_the_energy_integral(wall: Wall) -> None:
    alpha, p = wall.alpha, wall.p

    def pace(x: float) -> float:  # θ = θ0 (1 − x²)
        rate = math.sqrt(2.0 * (math.cos(alpha - THETA0) - math.cos(alpha - THETA0 * (1 - x * x)))) * p
        return 2.0 * THETA0 * x / rate

    exact = quad(pace, 0.0, 1.0)[0]
    first = go(wall).impacts[0]
    assert first.time == pytest.approx(exact, abs=2e-7)
    assert block_swing(THETA0, alpha, p)[0] == pytest.approx(exact, rel=1e-9)
    assert -first.before == pytest.approx(block_swing(THETA0, alpha, p)[1], rel=1e-7)


def test_classic_period_is_near(wall: Wall) -> None:
    # (4.1) is the linearised form: within a per cent at this rotation.
    classic = math.acosh(1.0 / (1.0 - THETA0 / wall.alpha)) / wall.p
    assert go(wall).impacts[0].time == pytest.approx(classic, rel=0.01)


def test_rigid_swings_keep_their_energy_and_impacts_take_r(wall: Wall) -> None:
    motion = go(wall)
    assert len(motion.impacts) > 6
    for this, after in zip(motion.impacts, motion.impacts[1:], strict=False):
        assert this.after / this.before == pytest.approx(wall.restitution, rel=1e-12)
        assert abs(after.before) == pytest.approx(abs(this.after), rel=1e-5)


def test_both_sides_mirror(wall: Wall) -> None:
    right, left = go(wall), go(wall, theta0=-THETA0)
    assert [i.time for i in right.impacts] == pytest.approx([i.time for i in left.impacts], abs=1e-9)


@pytest.mark.parametrize(
    ("side", "moved", "towards"), [(-0.4, 0.2, -1.0), (0.3, 0.9, 1.0), (-0.4, 0.9, -1.0)]
)
def test_a_taut_cable_works_until_it_hangs_loose(
    wall: Wall, side: float, moved: float, towards: float
) -> None:
    k, reach = 0.05, 0.04
    cable = {"k": k, "reach_rad": reach, "side": side, "moved": moved}
    for theta0 in (THETA0, -THETA0):
        plain, held = go(wall, theta0=theta0), go(wall, {"taut_cable": cable}, theta0)
        pull = towards * (math.copysign(1.0, theta0) if moved > 0.5 else 1.0)
        loose = max(reach - pull * theta0, 0.0)
        gained = (held.impacts[0].before ** 2 - plain.impacts[0].before ** 2) / 2.0
        assert gained == pytest.approx(k * wall.p**2 * (loose**2 - reach**2) / 2.0, rel=1e-5)


def test_coulomb_takes_level_times_path(wall: Wall) -> None:
    mu = 0.01
    plain, rubbed = go(wall), go(wall, {"coulomb": {"mu": mu}})
    lost = (plain.impacts[0].before ** 2 - rubbed.impacts[0].before ** 2) / 2.0
    assert lost == pytest.approx(mu * wall.p**2 * wall.alpha * THETA0, rel=1e-6)


def test_viscous_takes_what_its_damper_dissipates(wall: Wall) -> None:
    zeta = 0.01
    motion = go(wall, {"viscous": {"zeta": zeta}})
    time = np.linspace(0.0, motion.impacts[0].time - 1e-9, 20001)
    omega = motion.sample(time)[1]
    dissipated = 2.0 * zeta * wall.p * np.trapezoid(omega**2, time)
    lost = (go(wall).impacts[0].before ** 2 - motion.impacts[0].before ** 2) / 2.0
    assert lost == pytest.approx(dissipated, rel=1e-5)


def test_acceleration_of_the_samples_is_that_of_the_equation(wall: Wall) -> None:
    motion = go(wall)
    time = np.linspace(0.01, motion.impacts[0].time - 0.01, 50)
    theta, _, acceleration = motion.sample(time)
    expected = -(wall.p**2) * np.sin(wall.alpha - theta)
    assert acceleration == pytest.approx(expected, rel=1e-4)


def test_tilted_base_is_a_leaning_gravity(wall: Wall) -> None:
    # −p² sin(α − θ − β) on the right: the held wall starts with less acceleration.
    release = Release(THETA0, 0.0, 2.0, 5)
    tilted = build(wall, {"base_tilt": {"beta_rad": 3e-3}}, release)
    found = tilted.acceleration(0.0, THETA0, 0.0, 1)
    assert found == pytest.approx(-(wall.p**2) * math.sin(wall.alpha - THETA0 - 3e-3), rel=1e-9)


def test_left_and_right_alpha_give_alternating_durations(wall: Wall) -> None:
    motion = go(wall, {"alpha_asymmetry": {"delta_rad": 3e-3}})
    spans = np.diff([i.time for i in motion.impacts])
    even = go(wall)
    reference = np.diff([i.time for i in even.impacts])
    change = (spans / reference - 1.0)[:4]
    assert np.all(change[::2] > 0) and np.all(change[1::2] < 0)  # left: smaller α, longer; right: shorter


def test_dwell_delays_and_bounce_adds_an_impact(wall: Wall) -> None:
    plain = go(wall)
    rested = go(wall, {"dwell": {"tau_s": 4e-3}})
    delay = np.array([i.time for i in rested.impacts]) - [i.time for i in plain.impacts]
    assert delay == pytest.approx(4e-3 * np.arange(1, delay.size + 1), abs=1e-6)
    thrown = go(wall, {"bounce": {"tau_s": 4e-3}})
    assert len(thrown.impacts) == 2 * len(plain.impacts)


def test_winkler_joint(wall: Wall) -> None:
    limit = 1e-4
    joint = winkler(wall, {"theta_c_rad": limit})
    half = wall.half_width
    assert joint.arm(limit, 1) == pytest.approx(half / 3.0)  # W acts at the third point of the base
    assert joint.arm(limit * (1 + 1e-9), 1) == pytest.approx(joint.arm(limit, 1), rel=1e-6)
    assert joint.arm(1e4 * limit, 1) == pytest.approx(half * (1 - 2 / 300), rel=1e-9)
    # Opening at a fixed point is continuous where uplift starts.
    below, above = (joint.contact(np.array([q]), 1) for q in (limit, limit * (1 + 1e-9)))
    opening = [x * math.sin(limit) + lift for x, lift in (below, above)]
    assert opening[0] == pytest.approx(opening[1], abs=1e-12)


@pytest.mark.parametrize("make", [winkler, cubic_joint, rounded_edge])
def test_soft_joints_tend_to_the_rigid_one(wall: Wall, make: object) -> None:
    key = {winkler: "theta_c_rad", cubic_joint: "theta_j_rad", rounded_edge: "rho_m"}[make]  # type: ignore[index]
    joint = make(wall, {key: 1e-12})  # type: ignore[operator]
    assert joint.arm(0.03, 1) == pytest.approx(rigid(wall).arm(0.03, 1), rel=1e-4)


def test_a_solver_may_try_any_step_on_a_joint_with_a_loop(wall: Wall) -> None:
    """An implicit one tries steps beyond upright, by thousands of the rotation in which the loop fades."""
    loop = {"hysteretic_joint": {"theta_h_rad": 1e-4, "share": 0.05}}
    mechanics = build(wall, loop, Release(THETA0, 0.0, 2.0, 5))
    assert math.isfinite(mechanics.acceleration(0.1, -0.2, 0.0, 1))
    plain = build(wall, {}, Release(THETA0, 0.0, 2.0, 5))
    gained = [m.acceleration(0.1, 1e-4, 0.0, 1) for m in (mechanics, plain)]
    level = 0.05 * wall.p**2 * wall.alpha
    assert gained[0] - gained[1] == pytest.approx(-level * mechanics.heading * math.exp(-1.0))


def test_wear_adds_up_over_impacts_and_runs(wall: Wall) -> None:
    release = Release(THETA0, 0.0, 2.0, 5, 1, impacts_before=50)
    worn = build(wall, {"crushing": {"loss_per_100": 0.02}}, release)
    assert worn.arm(0.03, 1) == pytest.approx(wall.half_width * 0.99)
    worn.impacts_done = 50
    assert worn.arm(0.03, 1) == pytest.approx(wall.half_width * 0.98)


def test_impact_scatter_has_the_stated_size(wall: Wall) -> None:
    from dataclasses import replace

    shaky = replace(wall, restitution=0.93, restitution_scatter=0.006)
    found = [i.restitution / 0.93 - 1.0 for theta in (0.05, 0.07) for i in go(shaky, theta0=theta).impacts]
    assert np.std(found) == pytest.approx(0.006, rel=0.4)
    assert len(set(found)) > 20
