"""`gap apply` writes a whole, checked rig file or nothing, and replaces nothing that it was not told to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import load_rig
from daq_app.gap.apply import effects_found
from daq_app.gap.core.result import FORMAT_VERSION
from daq_app.gap.rocking_model.library import rocking_library
from tests.support.simulated_wall import RIG


def _result(**changes: Any) -> dict[str, Any]:
    wall = {"alpha": 0.21, "p": 2.19, "r": 0.9, "half_base": 0.3255}
    return {
        "format": FORMAT_VERSION,
        "decision": "effect",
        "effect_parameters": [{"name": "viscous.zeta", "value": 0.006}],
        "parameters": [{"name": name, "value": value} for name, value in wall.items()],
        "scatter": [],
        "notes": {},
    } | changes


def _apply(folder: Path, content: str, *more: str, rig: Path = RIG) -> tuple[int, str]:
    (folder / "result.json").write_text(content, encoding="utf-8")
    arguments = ["gap", "apply", str(folder / "result.json"), "--rig", str(rig), *more]
    if "--out" not in more:
        arguments += ["--out", str(folder / "out.toml")]
    answer = CliRunner().invoke(build_app(), arguments)
    assert answer.exception is None or isinstance(answer.exception, SystemExit), answer.exception
    return answer.exit_code, answer.output


def _parameters(**values: Any) -> list[dict[str, Any]]:
    wall = {"alpha": 0.21, "p": 2.19, "r": 0.9, "half_base": 0.3255} | values
    return [{"name": name, "value": value} for name, value in wall.items() if value is not None]


def test_whatever_the_library_names_can_be_switched_on() -> None:
    """Parameters of the form of an effect that the simulator has not are left out, and stop nothing."""
    library = rocking_library({})
    for name in library:
        if library[name].kind != "effect":
            continue
        entries = [{"name": f"{name}.{p.name}", "value": p.value(0.0)} for p in library[name].parameters]
        assert name in effects_found(_result(effect_parameters=entries))


@pytest.mark.parametrize("measured", ["ambient@floor.amplitude", "acceleration@TL-1X.share"])
def test_what_is_only_measured_is_left_out_of_what_is_switched_on(measured: str) -> None:
    entries = [{"name": "viscous.zeta", "value": 0.006}, {"name": measured, "value": 0.2}]
    assert effects_found(_result(effect_parameters=entries)) == {"viscous": {"zeta": 0.006}}


@pytest.mark.parametrize(
    "content",
    [
        json.dumps(_result(parameters=_parameters(alpha=0.0))),
        json.dumps(_result(parameters=_parameters(p=None))),
        json.dumps(_result(parameters=_parameters(half_base=-1.0))),
        json.dumps(_result(parameters=_parameters(r="much"))),
        json.dumps(_result(parameters={"alpha": 0.2})),
        json.dumps(_result(effect_parameters=[{"name": "viscous.zeta"}])),
        json.dumps(_result(effect_parameters=[7])),
        json.dumps(_result(effect_parameters=[{"name": "viscous.zeta\x1b[31m", "value": 0.1}])),
        json.dumps(_result(notes=[])),
        json.dumps(_result(decision=None)),
        "[" * 100_000,
        '{"format": ' * 5_000,
        "\xff",
    ],
)
def test_a_result_that_cannot_be_true_is_refused_in_words(tmp_path: Path, content: str) -> None:
    kept = tmp_path / "out.toml"
    kept.write_text("precious", encoding="utf-8")
    code, _ = _apply(tmp_path, content, "--overwrite")
    assert code == 2 and kept.read_text(encoding="utf-8") == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.toml", "result.json"]


@pytest.mark.parametrize("channel", ["../../x", "WP-1\x1b[31m", "WP-99"])
def test_a_channel_that_the_rig_has_not_is_refused(tmp_path: Path, channel: str) -> None:
    wiring = {"reversed": [channel], "exchanged": {}}
    found = [{"name": "polarity.on", "value": 1.0}]
    code, told = _apply(tmp_path, json.dumps(_result(effect_parameters=found, notes={"wiring": wiring})))
    assert code == 2 and "no channel" in told and "\x1b" not in told
    assert not (tmp_path / "out.toml").exists()


def test_exchanged_plugs_that_are_no_exchange_are_refused(tmp_path: Path) -> None:
    wiring = {"exchanged": {"WP-1": "WP-2", "WP-2": "WP-2"}}
    found = [{"name": "swap@wire.places", "value": 1.0}]
    code, _ = _apply(tmp_path, json.dumps(_result(effect_parameters=found, notes={"wiring": wiring})))
    assert code == 2


def test_a_file_that_is_there_is_replaced_only_where_that_was_asked_for(tmp_path: Path) -> None:
    kept = tmp_path / "out.toml"
    kept.write_text("precious", encoding="utf-8")
    code, told = _apply(tmp_path, json.dumps(_result()))
    assert code == 2 and "--overwrite" in told and kept.read_text(encoding="utf-8") == "precious"
    assert _apply(tmp_path, json.dumps(_result()), "--overwrite")[0] == 0
    assert load_rig(kept).simulation.effects == {"viscous": {"zeta": 0.006}}


def test_the_rig_that_is_read_is_never_written(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_bytes(RIG.read_bytes())
    out = ("--out", str(rig), "--overwrite")
    code, told = _apply(tmp_path, json.dumps(_result()), *out, rig=rig)
    assert code == 2 and "read by this command" in told and rig.read_bytes() == RIG.read_bytes()


def test_a_diagnosis_never_replaces_a_recording(tmp_path: Path) -> None:
    run = tmp_path / "FR1-L1-1.h5"
    run.write_bytes(b"a recording")
    arguments = ["gap", "diagnose", str(run), "--json", str(run), "--overwrite"]
    assert CliRunner().invoke(build_app(), arguments).exit_code == 2
    assert run.read_bytes() == b"a recording"
