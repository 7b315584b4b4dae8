"""The virtual rig: scripts, commands, scatter, and the promise that what was sampled never changes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import load_rig
from daq_app.config.rig import Rig, Simulation
from daq_app.config.scaling import Scaling
from sim_hardware.virtual_rig import VirtualRig

RATE = 4000.0


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


@pytest.fixture(scope="module")
def terminals(rig: Rig) -> tuple[str, ...]:
    return tuple(channel.physical_channel for channel in rig.channels)


def with_simulation(rig: Rig, **changes: object) -> Rig:
    values = rig.simulation.model_dump() | changes
    return rig.model_copy(update={"simulation": Simulation.model_validate(values)})


def rotation(wall: VirtualRig, times: np.ndarray) -> np.ndarray:
    return np.array([wall.scene.rotation_at(t)[0] for t in times])


def test_the_script_follows_the_rig_files_times(rig: Rig) -> None:
    wall = VirtualRig.from_rig(rig)
    plan = rig.simulation
    pulled = plan.upright_s + plan.pull_s
    truth = wall.truth()
    assert truth["release_s"] == pytest.approx(pulled + plan.hold_s)
    assert not rotation(wall, np.linspace(0.0, plan.upright_s - 1e-3, 50)).any()
    held = rotation(wall, np.linspace(pulled + 4.0, truth["release_s"], 50))
    assert np.ptp(held) < 5e-5
    assert held[-1] == pytest.approx(truth["theta0_rad"], abs=1e-12)
    assert truth["theta0_over_alpha"] == pytest.approx(0.35, rel=0.05)
    rest = truth["rest_s"]
    assert not rotation(wall, np.array([rest, rest + 100.0])).any()
    for at, state in (
        (1.0, "upright"),
        (4.0, "pulling"),
        (8.0, "held"),
        (15.0, "rocking"),
        (60.0, "at rest"),
    ):
        wall.advance(at)
        assert wall.status()["state"] == state
    json.dumps(truth)
    json.dumps(wall.status())


def test_handling_noise_is_there_but_small(rig: Rig) -> None:
    wall = VirtualRig.from_rig(rig, seed=2)
    plan = rig.simulation
    pull = rotation(wall, np.arange(plan.upright_s, plan.upright_s + plan.pull_s, 0.01))
    backwards = np.diff(pull).min()
    assert -2e-3 < backwards < -1e-5
    accelerometer = next(c for c in rig.channels if c.family == "accelerometer" and c.axis == "x")
    volts = wall.volts((accelerometer.physical_channel,), np.arange(0.0, 14.0, 1 / RATE))
    si = Scaling.of([accelerometer]).to_si(volts)[0]
    knocks = np.abs(si - np.median(si)).max()
    assert 3 * accelerometer.noise_si < knocks < 12.0


def test_scatter_comes_from_the_seed(rig: Rig) -> None:
    levels = [VirtualRig.from_rig(rig, seed=s, theta0_over_alpha=0.25).truth() for s in range(30)]
    ratios = np.array([t["theta0_over_alpha"] for t in levels]) / 0.25
    assert ratios.std() == pytest.approx(rig.simulation.theta0_scatter, rel=0.35)
    assert VirtualRig.from_rig(rig, seed=3, theta0_over_alpha=0.25).truth() == levels[3]
    scattered = with_simulation(rig, restitution_scatter=0.01)
    truth = VirtualRig.from_rig(scattered, seed=3).truth()
    r = np.divide(truth["velocity_after_rad_s"], truth["velocity_before_rad_s"])
    assert r.mean() == pytest.approx(rig.simulation.restitution, rel=0.01)
    assert r.std() / r.mean() == pytest.approx(0.01, rel=0.4)
    steady = VirtualRig.from_rig(rig, seed=3, restitution=0.82).truth()
    np.testing.assert_allclose(
        np.divide(steady["velocity_after_rad_s"], steady["velocity_before_rad_s"]), 0.82, rtol=1e-12
    )


def test_a_test_by_commands_and_another_in_the_same_power_on(rig: Rig) -> None:
    wall = VirtualRig.from_rig(rig, seed=5, scripted=False)
    assert wall.status()["state"] == "upright"
    assert wall.status()["truth"] is None
    with pytest.raises(LookupError, match="not been released"):
        wall.truth()
    now, theta0 = 2.0, []
    for level, side in ((0.25, 1), (0.25, 1), (-0.15, -1)):
        wall.advance(now)
        assert wall.command("pull", {"theta0_over_alpha": level})["state"] == "pulling"
        wall.advance(now + 9.0)
        assert wall.command("status", {})["state"] == "held"
        assert wall.command("release", {})["state"] == "rocking"
        truth = wall.truth()
        assert now + 9.0 <= truth["release_s"] < now + 9.0101  # on the grid of commands
        assert np.sign(truth["theta0_rad"]) == side
        theta0.append(truth["theta0_over_alpha"])
        now = truth["rest_s"] + 3.0
    assert len(wall.tests) == 3
    assert theta0[0] != theta0[1]
    wall.advance(now)
    assert wall.status()["state"] == "at rest"
    assert wall.tests[1].motion.vector is not None


def test_what_was_sampled_before_a_command_never_changes(rig: Rig, terminals: tuple[str, ...]) -> None:
    wall = VirtualRig.from_rig(rig, seed=6, scripted=False)
    times = np.arange(0.0, 30.0, 1 / 400.0)
    seen: list[np.ndarray] = []
    done = 0
    script = [("pull", 1.003), ("hammer", 3.1), ("release", 9.207), ("upright", 10.5), ("pull", 14.0)]
    for name, at in script:
        stop = int(np.searchsorted(times, at))
        seen.append(wall.volts(terminals, times[done:stop]))
        wall.volts(terminals, times[stop : stop + 500])  # the server reads ahead
        wall.advance(at)
        wall.command(name, {})
        done = stop
    seen.append(wall.volts(terminals, times[done:]))
    whole = wall.volts(terminals, times)
    assert np.array_equal(np.concatenate(seen, axis=1), whole)


def test_catching_a_rocking_wall_is_smooth_and_ends_its_test(rig: Rig) -> None:
    wall = VirtualRig.from_rig(rig, seed=6)
    wall.advance(15.0)
    impacts = len(wall.truth()["impact_time_s"])
    wall.command("upright", {"duration_s": 1.0})
    after = wall.truth()
    assert len(after["impact_time_s"]) < impacts
    assert after["rest_s"] is None
    times = np.arange(14.99, 16.2, 1e-4)
    theta = rotation(wall, times)
    assert np.abs(np.diff(theta)).max() < 1e-4
    assert theta[-1] == 0.0


def test_commands_that_make_no_sense_are_refused_in_words(rig: Rig) -> None:
    wall = VirtualRig.from_rig(rig, seed=1, scripted=False)
    for name, arguments, words in (
        ("explode", {}, "knows no command 'explode'; it knows pull"),
        ("release", {}, "the wall is upright; send 'pull' first"),
        ("pull", {"theta0": 0.2}, "no argument theta0; it has theta0_over_alpha"),
        ("pull", {"theta0_over_alpha": 1.4}, "between 0.01 and 0.95"),
        ("pull", {"theta0_over_alpha": "high"}, "must be a number"),
        ("pull", {"duration_s": 0.0}, "between 0.2 and 600 s"),
        ("upright", {"duration_s": -1.0}, "between 0.1 and 600 s"),
    ):
        with pytest.raises(ValueError, match=words):
            wall.command(name, arguments)
    assert wall.status()["state"] == "upright"
    rocking = VirtualRig.from_rig(rig, seed=1)
    rocking.advance(14.5)
    with pytest.raises(ValueError, match="rocking"):
        rocking.command("pull", {})
    with pytest.raises(ValueError, match="nothing to release: the wall is rocking"):
        rocking.command("release", {})


def test_effects_of_the_rig_file_act_and_wrong_ones_are_named(rig: Rig, terminals: tuple[str, ...]) -> None:
    from_file = with_simulation(rig, effects={"viscous": {"zeta": 0.02}, "gain@wire": {"error": 0.05}})
    plain, changed = VirtualRig.from_rig(rig, seed=1), VirtualRig.from_rig(from_file, seed=1)
    asked = VirtualRig.from_rig(
        rig, seed=1, effects={"viscous": {"zeta": 0.02}, "gain@wire": {"error": 0.05}}
    )
    assert changed.truth() == asked.truth()
    assert changed.truth()["rest_s"] < plain.truth()["rest_s"] - 0.2
    times = np.array([13.0])
    wires = [c.physical_channel for c in rig.of_family("wire")]
    difference = changed.volts(tuple(wires), times) - plain.volts(tuple(wires), times)
    assert np.all(np.abs(difference) > 0.01)
    others = tuple(t for t in terminals if t not in wires)
    assert np.array_equal(changed.volts(others, times), plain.volts(others, times))
    for effects, words in (
        ({"viscus": {"zeta": 0.1}}, "did you mean viscous"),
        ({"viscous": {"zet": 0.1}}, "no parameter 'zet'; it has zeta"),
        ({"gain@wires": {"error": 0.1}}, "called 'wires'"),
        ({"viscous@wire": {"zeta": 0.1}}, "acts on the wall"),
        ({"winkler": {}}, "needs theta_c"),
        ({"dropout": {"share": 3.0}}, "outside 0"),
        ({"filter_delay@tiltmeter": {"tau": 0.01}}, "already has a dynamic response"),
    ):
        with pytest.raises(ValueError, match=words):
            VirtualRig.from_rig(rig, seed=1, effects=effects)


def test_semi_rigid_moves_the_pivot_by_the_crushed_width(rig: Rig) -> None:
    wall = VirtualRig.from_rig(with_simulation(rig, semi_rigid=True), seed=1)
    assert wall.truth()["effects"]["pivot_shift"]["a"] == pytest.approx(0.033, abs=5e-4)


def test_the_floor_vibrates_through_releases_without_a_jump(rig: Rig) -> None:
    effects = {"ambient": {"amplitude": 0.2, "frequency": 1.7}}
    wall = VirtualRig.from_rig(rig, seed=1, effects=effects)
    accelerometer = next(c for c in rig.channels if c.family == "accelerometer" and c.axis == "x")
    i = rig.channel_ids.index(accelerometer.id)
    release = wall.truth()["release_s"]
    times = np.linspace(release - 0.2, release - 0.02, 300)
    quiet = VirtualRig.from_rig(rig, seed=1)
    floor = wall.chain.quantities(wall.scene, times)[i] - quiet.chain.quantities(quiet.scene, times)[i]
    expected = 0.2 * np.sin(2 * np.pi * 1.7 * times) * np.cos(wall.truth()["theta0_rad"])
    np.testing.assert_allclose(floor, expected, atol=1e-3)
    late = np.linspace(60.0, 61.0, 300)
    floor = wall.chain.quantities(wall.scene, late)[i]
    np.testing.assert_allclose(floor, 0.2 * np.sin(2 * np.pi * 1.7 * late), atol=1e-9)
