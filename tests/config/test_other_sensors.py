"""Sensors beside the rocking motion, as their page says: planned, recorded by the real client, kept off r."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import ConfigError, parse_rig, plan_tasks
from daq_app.config.families import AUXILIARY, is_auxiliary
from daq_app.gap.rocking_model.records import load_run
from daq_app.runfile import open_run
from daq_app.runfile.exporters import export_run
from daq_app.runfile.importers import ImportMap, import_file

BESIDE = ("ROPE", "JACK", "TOP", "AIR", "SYNC")


@pytest.fixture(scope="module")
def tables(repository: Path, configs: Path) -> dict[str, Any]:
    """The shipped rig with the channels of the page."""
    page = (repository / "docs" / "how-to" / "other-sensors.md").read_text(encoding="utf-8")
    more = tomllib.loads(page.split("```toml\n")[1].split("```")[0])
    rig = tomllib.loads((configs / "fr1.toml").read_text(encoding="utf-8"))
    rig["hardware"]["chassis"][0]["modules"] += more["hardware"]["chassis"][0]["modules"]
    rig["expected_channels"] |= more["expected_channels"]
    rig["channels"] += more["channels"]
    rig["simulation"] |= {"upright_s": 2.0, "pull_s": 1.0, "hold_s": 4.0, "restitution": 0.7}
    return rig


def with_channel(tables: dict[str, Any], channel_id: str, **keys: Any) -> str:
    channels = [c | keys if c["id"] == channel_id else c for c in tables["channels"]]
    return tomli_w.dumps(tables | {"channels": channels})


def test_a_slow_module_is_allowed_for_them_and_said(tables: dict[str, Any]) -> None:
    plan = plan_tasks(parse_rig(tomli_w.dumps(tables)))
    assert plan.rate_hz == pytest.approx(4166.67, abs=0.01)
    (slow,) = [note for note in plan.notes if "repeated" in note.text]
    assert (slow.severity, slow.where) == ("warning", "AIR")


@pytest.mark.parametrize(
    ("channel_id", "keys", "words"),
    [
        ("ROPE", {"sensitivity_unit": "V/kg"}, "V/kN"),
        ("JACK", {"excitation": {"kind": "none"}}, "a bridge needs its excitation"),
        ("JACK", {"input_range_v": [-10.0, 10.0]}, "-10 to 10 V/V is beyond NI 9237"),
        ("JACK", {"physical_channel": "cDAQ1Mod8/ai5"}, "cannot measure a bridge"),
        ("TOP", {"family": "temperature"}, "`mA/mm` is no sensitivity unit"),
        ("ROPE", {"family": "other"}, 'unit = "N m"'),
        ("ROPE", {"unit": "N"}, "has a unit already"),
        ("LV-A01", {"physical_channel": "cDAQ1Mod7/ai1"}, "repeat old points"),
        ("LV-A01", {"measurement": "thermocouple"}, 'is for family "temperature"'),
    ],
)
def test_what_cannot_be_is_refused_with_its_remedy(
    tables: dict[str, Any], channel_id: str, keys: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_tasks(parse_rig(with_channel(tables, channel_id, **keys)))
    assert words in str(refused.value)


def test_an_lvdt_that_says_it_lies_across_a_joint_is_no_lvdt_of_the_base(tables: dict[str, Any]) -> None:
    rig = parse_rig(with_channel(tables, "LV-A01", axis="x"))
    assert rig.channel("LV-A01").family == "displacement"
    assert "LV-A01" not in [channel.id for channel in rig.of_family("lvdt")]


def test_a_unit_of_its_own_scales_and_is_kept(tables: dict[str, Any]) -> None:
    text = with_channel(
        tables | {"expected_channels": tables["expected_channels"] | {"voltage": 0, "other": 1}},
        "SYNC",
        family="other",
        unit="N m",
        sensitivity=2.0,
        sensitivity_unit="mV/(N m)",
        range_si=[-4e3, 4e3],
    )
    channel = parse_rig(text).channel("SYNC")
    assert channel.si_unit == "N m"
    assert channel.sensitivity_reading_per_si == pytest.approx(2e-3)


@pytest.mark.heavy
def test_they_are_recorded_beside_a_test_and_leave_r_alone(tables: dict[str, Any], tmp_path: Path) -> None:
    rig_file = tmp_path / "more.toml"
    rig_file.write_text(tomli_w.dumps(tables), encoding="utf-8")
    arguments = ["run", str(rig_file), "--test", "FR1-L3-2", "--headless", "--json", "--speed", "4"]
    answer = CliRunner().invoke(build_app(), [*arguments, "--out", str(tmp_path)])
    assert answer.exit_code == 0, answer.output
    document = json.loads(answer.stdout)
    (path,) = tmp_path.glob("*.h5")
    with open_run(path) as run:
        rig = run.rig
        assert rig is not None and document["lost_samples"] == 0
        si = dict(zip(BESIDE, run.si(BESIDE), strict=True))
        wire = run.si(["WP-5"])[0]  # at the height of the laser
        tare = run.header.tare
    assert document["results"]["r"]["eav"]["r"] == pytest.approx(0.7, abs=2e-3)
    assert np.max(np.abs(si["TOP"] - wire)) < 3e-3
    assert abs(si["AIR"].mean() - 20.0) < 0.1 and si["JACK"].std() == pytest.approx(20.0, rel=0.2)
    # Absolute values keep theirs; forces and displacements are zeroed, where a zero was taken.
    assert not {"AIR", "SYNC"} & set(tare)
    assert not {sensor.id for sensor in load_run(path).sensors} & set(BESIDE)

    exported = export_run(path, tmp_path, "csv", units="si")
    report = import_file(
        exported, rig, rig_file.read_text(encoding="utf-8"), tmp_path / "back", ImportMap.model_validate({})
    )
    with open_run(report.run) as back:
        np.testing.assert_allclose(back.si(["JACK"])[0], si["JACK"], rtol=1e-5, atol=1e-3)


def test_a_family_that_the_diagnosis_has_is_auxiliary_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    assert is_auxiliary("temperature")
    monkeypatch.setitem(AUXILIARY, "temperature", replace(AUXILIARY["temperature"], diagnosed=True))
    assert not is_auxiliary("temperature")
