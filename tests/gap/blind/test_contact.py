"""The contact engine as a second world: it finds rocking by itself, and the diagnosis holds on its walls."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import Rig, load_rig
from daq_app.gap.blind.making.case_files import write_case
from daq_app.gap.blind.making.mix import case_generator, category_of, draw_effects
from daq_app.gap.blind.running.diagnosers import product
from daq_app.gap.blind.world.campaign import World, draw_world
from daq_app.gap.blind.world.contact.feet import needed_friction, plastic_restitution
from daq_app.gap.blind.world.contact.motion import ContactMotion, contact_stage, rock
from daq_app.gap.blind.world.effects.catalogue import (
    CONTACT_ENTRIES,
    CONTACT_LIBRARY,
    CONTACT_OUTSIDE,
    Drawn,
)
from daq_app.gap.blind.world.events.mechanics import Effects, Release, build
from daq_app.gap.blind.world.events.motion import Motion, integrate
from daq_app.gap.blind.world.events.scene import stage
from daq_app.gap.blind.world.laboratories.numerics import Numerics
from daq_app.gap.blind.world.sensors.chain import quiet_signals
from daq_app.gap.blind.world.sensors.faults import Place
from daq_app.gap.blind.world.wall import Wall
from sim_hardware.dynamics import Body, Restitution, simulate_motion
from sim_hardware.dynamics import Release as SimulatedRelease

THETA0 = -0.05


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


@pytest.fixture(scope="module")
def wall(rig: Rig) -> Wall:
    """FR1 as surveyed, which loses at an impact what a plastic one takes."""
    surveyed = Wall.nominal(rig.specimen, 1.0)
    return dataclasses.replace(surveyed, restitution=plastic_restitution(surveyed))


def both(wall: Wall, effects: Effects) -> tuple[ContactMotion, Motion]:
    """One run by the contact engine and by event integration."""
    release = Release(THETA0, 0.0, 2.0, 5)
    return rock(wall, effects, release), integrate(build(wall, effects, release), release)


def test_a_block_on_its_edges_rocks_and_loses_what_housner_says(wall: Wall) -> None:
    """r = 1 - 2 m (b/2)^2 / I_O, which nobody told the engine."""
    contact, events = both(wall, {})
    for mine, theirs in zip(contact.impacts[:12], events.impacts, strict=False):
        assert mine.time == pytest.approx(theirs.time, abs=3e-3)
        assert mine.restitution == pytest.approx(plastic_restitution(wall), rel=6e-3)
    assert [theta for _, theta in contact.peaks[:12]] == pytest.approx(
        [theta for _, theta in events.peaks[:12]], rel=4e-3
    )
    assert contact.rest_s == pytest.approx(events.rest_s, rel=0.02)


def test_a_wall_takes_its_own_restitution_and_scatters(wall: Wall) -> None:
    own = dataclasses.replace(wall, restitution=0.9, restitution_scatter=0.005)
    contact, events = both(own, {})
    taken = np.array([impact.restitution for impact in contact.impacts[:10]])
    meant = np.array([impact.restitution for impact in events.impacts[:10]])
    assert taken == pytest.approx(meant, rel=6e-3)  # one seed, one scatter
    assert np.std(taken) > 2e-3


@pytest.mark.parametrize(
    "effects",
    [
        {"base_tilt": {"beta_rad": 0.005}},
        {"eccentric_mass": {"e_m": -0.006}},
        {"alpha_asymmetry": {"delta_rad": 0.004}},
    ],
)
def test_what_leans_is_the_same_by_forces_and_by_lever_arms(wall: Wall, effects: Effects) -> None:
    contact, events = both(wall, effects)
    plain, _ = both(wall, {})
    assert abs(plain.impacts[1].time - contact.impacts[1].time) > 0.01
    for mine, theirs in zip(contact.impacts[:6], events.impacts, strict=False):
        assert mine.time == pytest.approx(theirs.time, abs=2e-3)


@pytest.mark.parametrize(
    ("world", "name", "parameter", "size"),
    [
        ({"e_m": -0.006}, "eccentric_mass", "e", -0.006),
        ({"delta_rad": 0.004}, "alpha_asymmetry", "delta", 0.004),
    ],
)
def test_forces_make_r_differ_by_side_as_the_simulator_says_of_plastic_impacts(
    wall: Wall, world: dict[str, float], name: str, parameter: str, size: float
) -> None:
    contact, _ = both(wall, {name: world})
    by_side = {s: np.mean([i.restitution for i in contact.impacts[:12] if i.side == s]) for s in (1, -1)}
    body = Body(wall.alpha, wall.p, math.hypot(wall.half_width, wall.centroid_height), 5000.0, 1.2)
    r = Restitution(plastic_restitution(wall))
    told = simulate_motion(body, SimulatedRelease(THETA0), r, {name: {parameter: size, "plastic": 1.0}})
    from_minus, from_plus = (told.velocity_after_rad_s / told.velocity_before_rad_s)[:2]
    # r is read from the engine to half a per cent, and to a twentieth of that from one impact to the next.
    assert by_side[1] - by_side[-1] == pytest.approx(from_plus - from_minus, abs=7e-4)
    assert abs(from_plus - from_minus) > 2e-3


@pytest.mark.parametrize(
    "effects",
    [
        {"pivot_shift": {"a_m": 0.03}},
        {"rounded_edge": {"rho_m": 0.04}},
        {"crushing": {"loss_per_100": 0.03}},
    ],
)
def test_the_first_fall_on_another_edge_is_that_of_its_lever_arm(wall: Wall, effects: Effects) -> None:
    release = Release(THETA0, 0.0, 2.0, 5, 3, 90)
    contact, events = rock(wall, effects, release), integrate(build(wall, effects, release), release)
    assert abs(both(wall, {})[0].impacts[0].time - contact.impacts[0].time) > 5e-3
    assert contact.impacts[0].time == pytest.approx(events.impacts[0].time, abs=5e-4)
    assert -contact.impacts[0].before == pytest.approx(-events.impacts[0].before, rel=2e-3)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_a_bed_sinks_under_the_weight_and_stands_again(
    wall: Wall, cone: Literal["elliptic", "pyramidal"]
) -> None:
    softness = 5e-4
    bed = {"damped_bed": {"theta_c_rad": softness}}
    contact = rock(wall, bed, Release(THETA0, 0.0, 2.0, 5), Numerics(cone=cone))
    assert contact.upright[1] == pytest.approx(-softness * wall.half_width, rel=1e-3)  # m g / k
    assert contact.states[:3, -1] == pytest.approx(contact.upright, abs=1e-4)


def test_a_base_slips_only_where_friction_is_overcome(wall: Wall) -> None:
    assert needed_friction(wall) == pytest.approx(0.163, abs=1e-3)
    release = Release(THETA0, 0.0, 2.0, 5)
    sticks = rock(wall, {}, release)
    slips = rock(wall, {"slippery_base": {"friction_share": 0.92}}, release)
    one = rock(wall, {"slippery_edge": {"friction_share": 0.92}}, release)
    assert abs(sticks.states[0, -1] - sticks.upright[0]) < 1e-5
    assert len(slips.impacts) < len(sticks.impacts) / 2  # what slips takes energy
    assert abs(one.states[0, -1]) > 5 * abs(slips.states[0, -1] - slips.states[0, 0])  # it walks one way


def test_sensors_see_the_same_rocking_from_either_world(rig: Rig, wall: Wall) -> None:
    """Between impacts; a resolved impact has pulses of its own."""
    release = Release(THETA0, 0.0, 0.5, 5)
    mechanics = build(wall, {}, release)
    contact, events = rock(wall, {}, release), integrate(mechanics, release)
    time = np.arange(-0.5, contact.impacts[0].time - 0.02, 1.0 / 4000.0)
    scenes = contact_stage(contact, wall, {}, time), stage(mechanics, events, {}, time)
    place, rng = Place(0.0, 0.05), np.random.default_rng(1)
    mine, theirs = (quiet_signals(rig, scene, (), rng, place) for scene in scenes)
    for row, channel in enumerate(rig.channels):
        moving = abs(theirs[row]).max()
        limit = 0.05 * channel.noise_si + 1e-3 * moving
        quiet = (time < -0.01) | (time > 0.05)  # the hold lets go
        assert np.abs(mine[row] - theirs[row])[quiet].max() < limit, channel.id


def test_the_engine_has_a_mix_of_its_own(rig: Rig) -> None:
    hidden = [draw_effects(4, k, rig, case_generator(4, k), "contact") for k in range(40)]
    for k, effects in enumerate(hidden):
        names = [effect.name for effect in effects]
        match category_of(4, k):
            case "single":
                assert names[0] in CONTACT_LIBRARY
            case "outside":
                assert names[0] in CONTACT_OUTSIDE
            case "pair":
                assert names[0] in CONTACT_LIBRARY and CONTACT_ENTRIES[names[1]].on_sensors
            case "null":
                assert not names
    assert {effects[0].name for effects in hidden if effects} >= {*CONTACT_LIBRARY, *CONTACT_OUTSIDE}


def test_an_order_for_the_engine_says_so_in_its_label(tmp_path: Path, configs: Path) -> None:
    rig_file = str(configs / "fr1.toml")
    where = ["--out", str(tmp_path / "cases"), "--labels", str(tmp_path / "kept"), "--rig", rig_file]
    asked = ["gap", "blind", "make", "--cases", "1", "--seed", "3", "--runs", "1", "--workers", "1"]
    answer = CliRunner().invoke(build_app(), [*asked, "--engine", "contact", *where])
    assert answer.exit_code == 0, answer.output
    label = json.loads(json.loads((tmp_path / "kept/case_0001.json").read_text())["label"])
    assert label["engine"] == "contact"
    assert label["runs"][0]["impacts"] > 10


def test_without_the_engine_the_order_is_refused_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    out = tmp_path / "cases"
    answer = CliRunner().invoke(
        build_app(), ["gap", "blind", "make", "--engine", "contact", "--out", str(out)]
    )
    assert answer.exit_code == 2
    assert "extra `contact`" in " ".join(answer.output.split())
    assert not out.exists()


def _case(rig: Rig, rig_text: str, folder: Path, effects: tuple[Drawn, ...]) -> Path:
    world: World = draw_world(rig, effects, 4, np.random.default_rng(6), "contact")
    write_case(folder, "case", world, rig_text, 0)
    return folder


@pytest.mark.heavy
def test_one_round_edge_is_no_pair_of_unequal_edges(rig: Rig, configs: Path, tmp_path: Path) -> None:
    rig_text = (configs / "fr1.toml").read_text(encoding="utf-8")
    worn = Drawn("one_round_edge", "interface", "near", {"rho_m": 0.03}, (), 0.5)
    result = product(_case(rig, rig_text, tmp_path, (worn,)))
    assert result["which"][0]["effects"] != ["alpha_asymmetry"]
    assert result["decision"] == "none_of_these"
    assert result["decision_detail"]["family"] == "geometry"


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["", "rounded_edge"])
def test_the_diagnosis_holds_on_walls_that_another_engine_moved(
    rig: Rig, configs: Path, tmp_path: Path, name: str
) -> None:
    rig_text = (configs / "fr1.toml").read_text(encoding="utf-8")
    effects = (Drawn(name, "interface", "library", {"rho_m": 0.04}, (), 0.5),) if name else ()
    result = product(_case(rig, rig_text, tmp_path, effects))
    if name:
        assert (result["decision"], result["which"][0]["effects"]) == ("effect", [name])
        low, high = (result["effect_parameters"][0][key] for key in ("low", "high"))
        assert low - 2e-3 < 0.04 < high + 2e-3
    else:
        assert result["decision"] in ("nothing_missing", "parameters")
