"""A bad answer is worse than none: what cannot be diagnosed is refused in words."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import load_rig
from daq_app.gap.apply import apply_result, read_result
from daq_app.gap.core import CannotDiagnose
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.simulated_wall import RIG, simulate


@pytest.fixture(scope="module")
def wall() -> GapRun:
    return simulate({}, levels=(0.25,))[0]


def test_a_wall_that_never_moves_is_refused(wall: GapRun) -> None:
    noise = 1e-4 * np.random.default_rng(0).standard_normal((41, 20000))
    with pytest.raises(CannotDiagnose, match="held at a rotation"):
        prepare([replace(wall, channels=noise)])


def test_a_wall_that_is_held_and_never_released_is_refused(wall: GapRun) -> None:
    held = np.repeat(wall.channels[:, 9000:9001], 16000, axis=1)
    held[:, -4000:] = wall.channels[:, -4000:]
    with pytest.raises(CannotDiagnose):
        prepare([replace(wall, channels=held)])


def test_two_specimens_are_not_mixed(wall: GapRun) -> None:
    other = replace(wall, survey=replace(wall.survey, name="FR2"))
    with pytest.raises(CannotDiagnose, match="different specimens"):
        prepare([wall, other])


def test_a_gap_is_refused_alone_and_left_out_among_others(wall: GapRun) -> None:
    broken = wall.channels.copy()
    broken[:, 15000:15400] = np.nan
    with pytest.raises(CannotDiagnose, match="gap of 400 samples"):
        prepare([replace(wall, channels=broken)])
    used, limits = prepare([wall, replace(wall, name="broken", channels=broken)])
    assert [run.name for run in used] == [wall.name]
    assert any("gap of 400 samples" in limit for limit in limits)


def test_a_sensor_that_disagrees_is_left_out_and_named(wall: GapRun) -> None:
    wrong = wall.channels.copy()
    place = wall.indices("lvdt")[3]
    wrong[place] *= 0.5
    used, limits = prepare([replace(wall, channels=wrong)])
    assert any(wall.sensors[place].id in limit for limit in limits)
    assert used[0].swings.peak_rad[1] == pytest.approx(prepare([wall])[0][0].swings.peak_rad[1], rel=2e-3)


def test_runs_without_any_lvdt_are_refused_in_words(wall: GapRun) -> None:
    with pytest.raises(CannotDiagnose, match="only 0 LVDTs are usable"):
        prepare([wall.excluding([wall.sensors[i].id for i in wall.indices("lvdt")])])


def test_no_run_is_refused() -> None:
    with pytest.raises(CannotDiagnose, match="no run"):
        prepare([])


def test_the_rig_file_of_another_wall_is_doubted_and_no_effect_blamed() -> None:
    """A survey that is off by 20 % is no gap of the physics: the answer names the numbers to check."""
    runs = [
        replace(run, survey=replace(run.survey, alpha_rad=1.2 * run.survey.alpha_rad))
        for run in simulate({}, levels=(0.15, -0.25))
    ]
    result = diagnose_runs(runs, only=("viscous",))
    assert result.decision.verdict == "cannot_tell"
    assert "do not fit the specimen of the rig file" in result.decision.sentence
    assert "alpha" in result.decision.sentence
    assert "rig file" in result.next_measurement
    assert result.rest.unknown >= 0.5
    assert sum(hypothesis.probability for hypothesis in result.which) <= 1.0 - result.rest.unknown + 1e-9


def test_one_run_says_what_one_run_cannot(wall: GapRun) -> None:
    result = diagnose_runs([wall], only=("viscous", "lag@wire"))
    assert result.gap is None
    for words in ("One run only", "One level only", "to one side"):
        assert any(words in limit for limit in result.limits), words
    assert result.decision.verdict not in ("effect", "pair")


def _result(effects: dict[str, float], decision: str = "effect") -> dict[str, object]:
    nuisance = {"alpha": 0.21, "p": 2.19, "r": 0.9, "half_base": 0.3255}
    return {
        "format": 2,
        "decision": decision,
        "effect_parameters": [{"name": k, "value": v} for k, v in effects.items()],
        "parameters": [{"name": k, "value": v} for k, v in nuisance.items()],
        "scatter": [{"name": "scatter of r", "value": 0.004}],
    }


def test_apply_writes_a_rig_file_that_has_the_effect_and_the_parameters(tmp_path: Path) -> None:
    found = {"viscous.zeta": 0.006, "lag@wire.tau": 0.004}
    out = tmp_path / "rig.toml"
    apply_result(_result(found), RIG, out)
    rig = load_rig(out)
    assert rig.simulation.effects == {"viscous": {"zeta": 0.006}, "lag@wire": {"tau": 0.004}}
    assert rig.simulation.restitution == 0.9
    assert rig.specimen.alpha0_rad == 0.21
    assert rig.specimen.base_width_m / 2 == pytest.approx(0.3255)
    assert rig.channel_ids == load_rig(RIG).channel_ids


def test_apply_takes_only_what_the_simulator_has(tmp_path: Path) -> None:
    found = {"compliance.phi": 1e-3, "compliance.fall": 0.2, "polarity@LV-A06.on": 0.97}
    out = tmp_path / "rig.toml"
    apply_result(_result(found), RIG, out)
    assert load_rig(out).simulation.effects == {"compliance": {"phi": 1e-3}, "polarity@LV-A06": {"on": 1.0}}
    with pytest.raises(CannotDiagnose, match="does not say which channels"):
        apply_result(_result({"swap@wire.places": 1.0}), RIG, out)
    with pytest.raises(CannotDiagnose, match="cannot switch on"):
        apply_result(_result({"unheard_of.k": 1.0}), RIG, out)


def test_apply_refuses_where_nothing_was_named(tmp_path: Path) -> None:
    with pytest.raises(CannotDiagnose, match="no effect to switch on"):
        apply_result(_result({}, "none_of_these"), RIG, tmp_path / "rig.toml")
    (tmp_path / "x.json").write_text("{}")
    with pytest.raises(CannotDiagnose, match="no result"):
        read_result(tmp_path / "x.json")


def test_commands_say_what_is_wrong_and_exit_with_two(tmp_path: Path) -> None:
    app = build_app()
    runner = CliRunner()
    assert runner.invoke(app, ["gap", "diagnose", str(tmp_path / "none.h5")]).exit_code == 2
    assert runner.invoke(app, ["gap", "effects", "--family", "magic"]).exit_code == 2
    listed = runner.invoke(app, ["gap", "effects", "--json"])
    names = {entry["name"] for entry in json.loads(listed.output)}
    assert {"viscous", "winkler", "lag@lvdt", "clock", "free_restitution"} <= names
    (tmp_path / "r.json").write_text(json.dumps(_result({"viscous.zeta": 0.01})))
    arguments = [
        "gap",
        "apply",
        str(tmp_path / "r.json"),
        "--rig",
        str(RIG),
        "--out",
        str(tmp_path / "o.toml"),
    ]
    assert runner.invoke(app, arguments).exit_code == 0
    assert load_rig(tmp_path / "o.toml").simulation.effects == {"viscous": {"zeta": 0.01}}


def test_lvdts_that_all_read_nothing_are_refused_in_words() -> None:
    run = simulate({}, (0.25,))[0]
    channels = run.channels.copy()
    channels[run.indices("lvdt")] = 0.0
    with pytest.raises(CannotDiagnose, match="LVDT"):
        prepare([replace(run, channels=channels)])
