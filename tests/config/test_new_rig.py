"""A rig file for a wall of one's own: from sizes alone, or from a list that a spreadsheet saved."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import ConfigError, load_rig, parse_rig, plan_tasks
from daq_app.config.authoring import Block, read_sensor_table, spread_sensors, write_rig_text

SIZES = ["--height", "2.4", "--thickness", "0.5", "--length", "1.6"]
EXCEL = (
    "id;family;x [mm];y [mm];z [mm];anchor x [mm];anchor y [mm];anchor z [mm];"
    "sensitivity;sensitivity unit;due\n"
    "J1;lvdt;-250;100;0;;;;0,5;V/mm;16.02.2028\n"
    "J2;LVDT;250;100;0;;;;0,5;V/mm;\n"
    "W1;wire;-250;0;2200;-2250,5;0;2200;;;\n"
)


@settings(deadline=None, max_examples=5)
@given(
    height=st.floats(0.3, 6.0),
    slenderness=st.floats(0.05, 0.5),
    length=st.floats(0.2, 5.0),
    lvdts=st.integers(1, 64),
    others=st.tuples(st.integers(0, 6), st.integers(0, 10), st.integers(0, 4)),
)
def test_every_wall_from_one_sensor_to_84_gets_a_file_that_checks_good(
    height: float, slenderness: float, length: float, lvdts: int, others: tuple[int, int, int]
) -> None:
    block = Block("W1", round(height, 3), round(slenderness * height, 3), round(length, 3))
    counts = dict(zip(("lvdt", "wire", "accelerometer", "tiltmeter"), (lvdts, *others), strict=True))
    rig = parse_rig(write_rig_text(block, spread_sensors(block, counts)))
    plan = plan_tasks(rig, "rig")
    assert len(rig.channels) == lvdts + sum(others)
    assert not [n for n in plan.notes if n.severity == "warning" and "m beyond the" in n.text]
    assert rig.specimen.base_width_m == pytest.approx(block.thickness_m, rel=1e-3)


def test_a_list_from_a_spreadsheet_with_decimal_commas_and_millimetres_is_read(tmp_path: Path) -> None:
    rig_file, table = tmp_path / "w1.toml", tmp_path / "sensors.csv"
    table.write_bytes(EXCEL.encode("utf-8-sig"))
    said = CliRunner().invoke(build_app(), ["rig", "new", str(rig_file), *SIZES, "--sensors", str(table)])
    assert said.exit_code == 0, said.stderr
    rig = load_rig(tmp_path / "w1.toml")
    assert rig.channel("W1").anchor_m == (-2.2505, 0.0, 2.2)
    assert rig.channel("J1").sensitivity == 0.5
    assert rig.channel("J1").range_si == pytest.approx((-0.02, 0.02), rel=2e-3)
    assert str(rig.channel("J1").certificate.due) == "2028-02-16"
    checked = CliRunner().invoke(build_app(), ["config", "check", str(tmp_path / "w1.toml")])
    assert checked.exit_code == 0, checked.stderr


def test_what_is_not_given_is_asked(tmp_path: Path) -> None:
    said = CliRunner().invoke(build_app(), ["rig", "new", str(tmp_path / "w.toml")], input="2.4\n0.5\n1.6\n")
    assert said.exit_code == 0, said.stderr
    assert "Thickness of the wall" in said.stdout
    assert load_rig(tmp_path / "w.toml").specimen.height_m == 2.4


def test_an_edited_file_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "w.toml").write_text("mine", encoding="utf-8")
    said = CliRunner().invoke(build_app(), ["rig", "new", str(tmp_path / "w.toml"), *SIZES])
    assert said.exit_code == 2
    assert (tmp_path / "w.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("J2;LVDT", "J2;lidar"), "lidar"),
        (("-250;100", "left;100"), "line 2 (J1), column x"),
        (("id;family", "name;family"), "no column `id`"),
        (("16.02.2028", "next year"), "is not a day"),
        (("0,5;V/mm;16", "0,5;V/inch;16"), "V/inch"),
    ],
)
def test_what_is_wrong_in_a_list_is_said_with_its_place(
    change: tuple[str, str], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "sensors.csv"
    path.write_text(EXCEL.replace(*change), encoding="utf-8")
    with pytest.raises(ConfigError) as refused:
        write_rig_text(Block("W1", 2.4, 0.5, 1.6), read_sensor_table(path))
    assert words in str(refused.value)


def test_modules_that_do_not_exist_or_do_not_suffice_are_told() -> None:
    block = Block("W1", 2.4, 0.5, 1.6)
    with pytest.raises(ConfigError, match="Did you mean NI 92"):
        write_rig_text(block, spread_sensors(block, {"lvdt": 3}), modules=["NI 92O5"])
    with pytest.raises(ConfigError, match="need more than the 16 inputs"):
        write_rig_text(block, spread_sensors(block, {"lvdt": 17}), modules=["NI 9205"])
