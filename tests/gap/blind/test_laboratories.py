"""Laboratories: what each ordinary imperfection does to a recording, alone, and that all of it is data."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import Scaling
from daq_app.gap.blind.making.detectability import detectability, total_noise
from daq_app.gap.blind.making.make import Order, draw_case
from daq_app.gap.blind.world.campaign import Surroundings, World
from daq_app.gap.blind.world.laboratories.table import IMPERFECTIONS, LABORATORIES, draw_sizes
from daq_app.gap.blind.world.shock import Shock

RATE_HZ = 4000.0
HELD_S = 1.9
"""Shorter than any wall is held before the release."""
IN_THE_HELD_PART = {
    "mains_pick_up",
    "slow_noise",
    "pink_noise",
    "unequal_noise",
    "zero_walk",
    "crosstalk",
    "coarse_steps",
    "calibration",
    "mount_angle",
    "anchor_error",
    "lvdt_straightness",
    "zero_start",
    "sway",
}


def order(configs: Path, tmp_path: Path, laboratory: str, alone: str = "") -> Order:
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    return Order(3, tmp_path, tmp_path / "kept", (text,), 1, None, laboratory, alone, "nothing")


def one_run(world: World) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(time after release, SI channels without their zeros) of a run that loses much at impacts."""
    short = dataclasses.replace(world, wall=dataclasses.replace(world.wall, restitution=0.6))
    made = next(iter(short.make()))
    channels = world.rig.channels
    zero = np.array([world.calibration.tare_reading[c.id] for c in channels])[:, None]
    values = Scaling.of(channels).to_si(made.readings) - zero * Scaling.of(channels).gain
    time = np.arange(values.shape[1]) / world.rig.acquisition.rate_hz - made.plan.hold_s
    return time, values


def row(world: World, values: NDArray[np.float64], channel: str) -> NDArray[np.float64]:
    return values[world.rig.channel_ids.index(channel)]


def amplitude_at(signal: NDArray[np.float64], hz: float) -> float:
    t = np.arange(signal.size) / RATE_HZ
    window = np.hanning(signal.size)
    return float(2 * abs(np.sum(window * signal * np.exp(-2j * np.pi * hz * t))) / window.sum())


@pytest.fixture
def quiet(configs: Path, tmp_path: Path) -> World:
    """The same case with an imperfection that shows nowhere: what the others are compared with."""
    return draw_case(order(configs, tmp_path, "rough", "record_length"), 0)[0]


def test_each_imperfection_of_each_laboratory_is_known_and_drawn_within_its_range() -> None:
    for laboratory in LABORATORIES.values():
        assert set(laboratory.ranges) <= set(IMPERFECTIONS)
        for index in range(20):
            for name, size in draw_sizes(laboratory, 8, index).items():
                low, high = laboratory.ranges[name]
                assert low <= size <= high


def test_switching_one_imperfection_on_alone_keeps_its_size(configs: Path, tmp_path: Path) -> None:
    every = draw_case(order(configs, tmp_path, "rough"), 4)[0].surroundings.sizes
    alone = draw_case(order(configs, tmp_path, "rough", "mains_pick_up"), 4)[0].surroundings
    assert alone.sizes == {"mains_pick_up": every["mains_pick_up"]}
    assert alone.laboratory == "rough: mains_pick_up alone"


def test_laboratories_and_imperfections_that_do_not_exist_are_refused(configs: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no laboratory attic.*ordinary"):
        draw_case(order(configs, tmp_path, "attic"), 0)
    with pytest.raises(ValueError, match=r"no imperfection wind.*mains_pick_up"):
        draw_case(order(configs, tmp_path, "rough", "wind"), 0)


def test_pick_up_has_its_amplitude_at_the_mains_and_a_phase_of_its_own_in_each_channel(
    configs: Path, tmp_path: Path
) -> None:
    world = draw_case(order(configs, tmp_path, "rough", "mains_pick_up"), 0)[0]
    around = world.surroundings
    assert around.installation is not None
    around = dataclasses.replace(
        around,
        installation=dataclasses.replace(
            around.installation, mains_amplitude=np.full(len(world.rig.channels), 1.0)
        ),
    )
    time, values = one_run(dataclasses.replace(world, surroundings=around))
    held = values[:, (time > -HELD_S) & (time < -0.1)]
    found = [amplitude_at(held[k] - held[k].mean(), 50.0) for k in range(24)]
    noise = world.rig.channels[0].noise_si
    assert np.median(found) == pytest.approx(noise, rel=0.15)
    assert np.std(around.installation.mains_phase) > 1.0  # type: ignore[union-attr]


@pytest.mark.parametrize("name", sorted(IN_THE_HELD_PART))
def test_an_imperfection_of_the_held_part_changes_it_and_is_no_cause(
    name: str, quiet: World, configs: Path, tmp_path: Path
) -> None:
    world = draw_case(order(configs, tmp_path, "rough", name), 0)[0]
    assert not world.effects
    time, values = one_run(world)
    plain_time, plain = one_run(quiet)
    held, plain_held = values[:, time < -0.1], plain[:, plain_time < -0.1]
    noise = np.array([c.noise_si for c in world.rig.channels])
    spread = held.std(axis=1) / noise, plain_held.std(axis=1) / noise
    level = np.abs(held.mean(axis=1) - plain_held[:, : held.shape[1]].mean(axis=1)) / noise
    assert np.max(np.abs(spread[0] - spread[1])) > 0.02 or np.max(level) > 0.05
    assert np.all(np.isfinite(values))


def test_a_turned_mount_shows_its_share_of_the_cross_axis(configs: Path, tmp_path: Path) -> None:
    world = draw_case(order(configs, tmp_path, "rough", "mount_angle"), 0)[0]
    assert world.surroundings.installation is not None
    turns = {f.targets[0]: f.parameters["angle_rad"] for f in world.surroundings.installation.faults}
    time, values = one_run(world)
    held = time < -0.2
    tilt = np.array([row(world, values, name)[held].mean() for name in ("TL-1X", "TL-1Y")])
    assert tilt[1] / tilt[0] == pytest.approx(np.sin(turns["TL-1Y"]), abs=0.01)


@pytest.mark.parametrize("form", ["half_sine", "two_lobed", "ringing", "gamma"])
def test_a_shock_of_any_form_takes_the_velocity_jump_and_is_over_in_its_window(form: str) -> None:
    for length_s in (0.002, 0.015):
        shock = Shock(form, length_s)  # type: ignore[arg-type]
        t = np.linspace(0.0, shock.window_s, 20_001)
        pulse = shock.pulse(t)
        assert np.trapezoid(pulse, t) == pytest.approx(1.0, abs=0.01)
        assert abs(pulse[-1]) < 0.01 * np.max(np.abs(pulse))


def test_a_swaying_wall_is_let_go_in_the_state_that_it_swayed_into(configs: Path, tmp_path: Path) -> None:
    world = draw_case(order(configs, tmp_path, "rough", "sway"), 0)[0]
    scene = world.course(0).scene(np.arange(-2.0, 0.2, 1e-4))
    around_release = np.searchsorted(scene.time_s, 0.0)
    before, after = scene.theta[around_release - 1], scene.theta[around_release + 1]
    assert np.ptp(scene.theta[:around_release]) > 3e-5
    assert after - before == pytest.approx(2e-4 * scene.omega[around_release], abs=2e-8)


def test_the_left_out_chain_makes_other_readings_of_the_same_signals(configs: Path, tmp_path: Path) -> None:
    world = draw_case(order(configs, tmp_path, "held_out_event"), 0)[0]
    same_but_for_the_chain = dataclasses.replace(
        world, surroundings=dataclasses.replace(world.surroundings, chain="bench")
    )
    (time, field), (_, bench) = one_run(world), one_run(same_but_for_the_chain)
    wire, other = row(world, field, "WP-4"), row(world, bench, "WP-4")
    assert np.abs(wire - other).max() > 0.0
    noise = world.rig.channel("WP-4").noise_si
    assert np.median(np.abs(wire - other)) < 5.0 * noise
    held = (time > -1.4) & (time < -0.1)
    assert 0.3 * noise < wire[held].std() < 6.0 * noise


def test_a_case_depends_on_its_place_only_in_a_laboratory_too(configs: Path, tmp_path: Path) -> None:
    first, again = (draw_case(order(configs, tmp_path, "rough"), 2)[0] for _ in range(2))
    assert first.surroundings.sizes == again.surroundings.sizes
    assert (first.wall, first.runs, first.surroundings.numerics) == (
        again.wall,
        again.runs,
        again.surroundings.numerics,
    )


@pytest.mark.parametrize("laboratory", ["ordinary", "contact"])
def test_three_effects_are_hidden_in_every_twentieth_case(
    laboratory: str, configs: Path, tmp_path: Path
) -> None:
    mixed = dataclasses.replace(order(configs, tmp_path, laboratory), hidden="")
    counts = [len(draw_case(mixed, index)[0].effects) for index in range(40)]
    assert counts.count(3) == 2 and counts.count(0) == 4 and counts.count(2) == 6


def test_a_slow_ring_and_a_twist_about_a_corner_are_among_what_wide_walls_hide(
    configs: Path, tmp_path: Path
) -> None:
    def world(name: str) -> World:
        return draw_case(dataclasses.replace(order(configs, tmp_path, "ordinary"), hidden=name), 0)[0]

    slow = world("slow_flexible_wall").effects[0]
    assert slow.name == "flexible_wall" and 2.0 <= slow.parameters["frequency_hz"] <= 7.0
    twisted = world("corner_twist")
    scene = twisted.course(0).scene(np.arange(-0.5, 6.0, 1e-3))
    assert abs(scene.yaw[-1]) > 0.0 and np.allclose(scene.yaw[scene.time_s < 0.0], 0.0)


def test_an_effect_is_less_visible_where_a_laboratory_is_noisier(configs: Path, tmp_path: Path) -> None:
    hidden = dataclasses.replace(order(configs, tmp_path, "rough"), hidden="wire_sag")
    rough = draw_case(hidden, 1)[0]
    own = dataclasses.replace(rough, surroundings=Surroundings())
    assert np.median(total_noise(rough) / total_noise(own)) > 1.0
    ratio = detectability(rough, rough.effects[0]) / detectability(own, own.effects[0])
    noise = total_noise(rough) / total_noise(own)
    assert (ratio < 1.0) == (noise[own.rig.channel_ids.index("WP-4")] > 1.0)


def _without(world: World, *imperfections: str) -> World:
    sizes = {name: size for name, size in world.surroundings.sizes.items() if name not in imperfections}
    return dataclasses.replace(world, surroundings=dataclasses.replace(world.surroundings, sizes=sizes))


def _seen(
    configs: Path,
    tmp_path: Path,
    name: str,
    laboratory: str = "rough",
    without: str = "",
    **parameters: float,
) -> float:
    """How visible an effect of that size is in a laboratory `without` one of its imperfections, sd."""
    hidden = dataclasses.replace(order(configs, tmp_path, laboratory), hidden=name)
    world = _without(draw_case(hidden, 1)[0], without)
    drawn = world.effects[0]
    return detectability(world, dataclasses.replace(drawn, parameters=drawn.parameters | parameters))


def test_an_effect_is_as_visible_as_what_it_looks_like_is_known(configs: Path, tmp_path: Path) -> None:
    """A pivot counts in half widths by tape, a gain in calibrations, that of all LVDTs in the distance of
    their faces by tape, a hum in what sound channels pick up, a tilt in what a level leaves."""
    for tilt_rad, seen in ((3e-4, 1.0), (3e-3, 10.0)):
        assert 0.8 * seen < _seen(configs, tmp_path, "base_tilt", beta_rad=tilt_rad) <= seen
    for parameters, least, most in (({"a_m": 9e-3}, 2.9, 4.0), ({"a_m": 18e-3}, 5.9, 8.0)):
        assert least < _seen(configs, tmp_path, "pivot_shift", **parameters) < most
    hidden = dataclasses.replace(order(configs, tmp_path, "rough"), hidden="gain")
    world = draw_case(hidden, 1)[0]
    one = dataclasses.replace(world.effects[0], targets=("LV-A03",), parameters={"error": 0.012})
    # One of 24 LVDTs, that tell the two numbers by tape as well.
    straight = detectability(_without(world, "lvdt_straightness", "pink_noise"), one)
    assert straight == pytest.approx(0.012 / 0.003 * np.sqrt(22 / 24), rel=0.05)
    assert 0.8 * straight < detectability(world, one) < 0.95 * straight
    lvdts = tuple(channel.id for channel in world.rig.channels if channel.family == "lvdt")
    all_of_them = dataclasses.replace(one, targets=lvdts, parameters={"error": 0.03})
    assert detectability(world, all_of_them) == pytest.approx(0.03 / (3e-3 / world.wall.half_width), rel=0.1)
    weak, strong = (_seen(configs, tmp_path, "hum", times_noise=size) for size in (0.1, 1.0))
    assert strong == pytest.approx(10.0 * weak)
    sizes = dict(world.surroundings.sizes)
    loud = dataclasses.replace(
        world.surroundings, sizes=sizes | {"mains_pick_up": 2 * sizes["mains_pick_up"]}
    )
    hum = draw_case(dataclasses.replace(hidden, hidden="hum"), 1)[0]
    assert detectability(dataclasses.replace(hum, surroundings=loud), hum.effects[0]) == pytest.approx(
        detectability(hum, hum.effects[0]) / 2
    )


def test_what_contacts_that_give_way_do_is_no_part_of_an_effect(configs: Path, tmp_path: Path) -> None:
    assert _seen(configs, tmp_path, "corner_twist", "contact", turn_s=1e-9) < 1.5
    assert _seen(configs, tmp_path, "corner_twist", "contact", turn_s=2e-3) > 4.0


def test_a_twist_is_less_visible_beside_zeros_that_walk(configs: Path, tmp_path: Path) -> None:
    walk, none = (
        _seen(configs, tmp_path, "corner_twist", without=name, turn_s=4e-4) for name in ("", "zero_walk")
    )
    assert walk < 0.8 * none


def test_a_push_is_as_visible_as_it_bends_the_start_of_the_fall(configs: Path, tmp_path: Path) -> None:
    """Whichever way a wall is pushed: a fall that begins a little earlier or later is no push."""
    for speed_rad_s, least, most in ((4e-3, 0.0, 2.0), (15e-3, 4.0, 8.0)):
        inwards, outwards = (
            _seen(configs, tmp_path, "initial_velocity", omega_rad_s=sign * speed_rad_s) for sign in (-1, 1)
        )
        assert least < inwards < most
        assert outwards == pytest.approx(inwards, rel=0.4)
    assert _seen(configs, tmp_path, "slow_release", tau_s=0.02) < 2.0
    assert _seen(configs, tmp_path, "slow_release", tau_s=0.1) > 10.0


def test_walls_and_amplifiers_have_a_little_of_some_effects_that_no_label_names(
    configs: Path, tmp_path: Path
) -> None:
    plain, tilted = (
        draw_case(dataclasses.replace(order(configs, tmp_path, "ordinary"), hidden=name), 1)[0]
        for name in ("nothing", "base_tilt")
    )
    sizes = plain.surroundings.sizes
    assert not plain.effects
    assert 0.0 < abs(plain.mechanical["base_tilt"]["beta_rad"]) < 4.0 * sizes["lean"]
    assert plain.mechanical["winkler"]["theta_c_rad"] == pytest.approx(sizes["bed"] ** 2)
    assert plain.mechanical["restitution_slope"]["k_s_rad"] != 0.0
    (late,) = plain.faults
    assert late.name == "filter_delay" and late.parameters["tau_s"] < sizes["late"]
    assert tilted.mechanical["base_tilt"] == tilted.effects[0].parameters, "what is hidden takes its place"
    assert tilted.mechanical["alpha_asymmetry"] == plain.mechanical["alpha_asymmetry"]
    own = draw_case(order(configs, tmp_path, "own"), 1)[0]
    assert not own.usual
