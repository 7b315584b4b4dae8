"""Each sensor of a new rig gets a module that can read it, or the reason why there is none."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import ConfigError, load_rig, parse_rig
from daq_app.config.authoring import Block, read_sensor_table, spread_sensors, write_rig_text
from daq_app.config.rig import Rig

BLOCK = Block("W1", 2.4, 0.5, 1.6)
HEADER = "id,family,x [mm],y [mm],z [mm],sensitivity,sensitivity unit,measurement,thermocouple,channel\n"
LISTED = (
    "J1,lvdt,-250,0,0,0.2,V/mm,,,\n"
    "W1,wire,-250,0,2200,10,mV/mm,,,\n"
    "A1,accelerometer,250,0,2200,100,mV/g,,,\n"
    "A2,accelerometer,250,0,1200,900,mV/g,voltage,,\n"
    "ROPE,load_cell,2000,0,2200,0.04,mV/V/kN,,,\n"
    "AIR,temperature,0,0,1000,,,,T,\n"
    "LAS,laser,250,0,2300,0.01,mA/mm,,,\n"
)


def test_each_kind_of_sensor_goes_to_a_module_of_its_kind_whatever_the_slots(tmp_path: Path) -> None:
    modules = ["NI 9213", "NI 9234", "NI 9237", "NI 9203", "NI 9215"]
    rig = _written(tmp_path, LISTED, modules)
    assert _products(rig, modules) == {
        "J1": "NI 9215",
        "W1": "NI 9215",
        "A1": "NI 9234",
        "A2": "NI 9215",
        "ROPE": "NI 9237",
        "AIR": "NI 9213",
        "LAS": "NI 9203",
    }
    assert rig.channel("A1").measurement == "iepe"
    assert rig.channel("A1").excitation.value == 0.002
    assert rig.channel("A1").terminal_config == "PSEUDO_DIFF"
    assert "measurement" in rig.channel("A1").assumed
    assert rig.channel("ROPE").measurement == "bridge"
    assert rig.channel("ROPE").input_range_v == (-0.025, 0.025)
    assert rig.channel("AIR").thermocouple == "T"
    assert rig.channel("LAS").terminal_config == "RSE"


def test_without_modules_the_sensors_get_the_usual_ones_for_them(tmp_path: Path) -> None:
    rig = _written(tmp_path, LISTED, [])
    products = [module.product for chassis in rig.hardware.chassis for module in chassis.modules]
    assert products == ["NI 9205", "NI 9237", "NI 9213", "NI 9203"]


def test_a_wall_without_a_list_uses_the_iepe_module_that_is_there() -> None:
    sensors = spread_sensors(BLOCK, {"lvdt": 18, "wire": 1, "accelerometer": 3, "tiltmeter": 1})
    modules = ["NI 9234", "NI 9205", "NI 9215"]
    rig = parse_rig(write_rig_text(BLOCK, sensors, modules=modules))
    products = _products(rig, modules)
    assert {products[c.id] for c in rig.of_family("accelerometer")} == {"NI 9234"}
    assert all(c.measurement == "iepe" and "measurement" in c.assumed for c in rig.of_family("accelerometer"))
    assert list(products.values()).count("NI 9205") == 16
    assert list(products.values()).count("NI 9215") == 4


def test_a_sensor_moves_for_one_that_has_no_other_module(tmp_path: Path) -> None:
    small = "".join(f"S{n},lvdt,-0.25,0,0,0.2,V/mm,voltage,-0.02,0.02\n" for n in range(4))
    large = "".join(f"L{n},lvdt,0.25,0,0,0.2,V/mm,voltage,-0.049,0.049\n" for n in range(4))
    path = tmp_path / "s.csv"
    header = "id,family,x,y,z,sensitivity,sensitivity unit,measurement,range from,range to\n"
    path.write_text(header + small + large, encoding="utf-8")
    modules = ["NI 9215", "NI 9234"]
    rig = parse_rig(write_rig_text(BLOCK, read_sensor_table(path), modules=modules))
    products = _products(rig, modules)
    assert {products[f"L{n}"] for n in range(4)} == {"NI 9215"}
    assert {products[f"S{n}"] for n in range(4)} == {"NI 9234"}
    assert rig.channel("S0").offset == 0.0


def test_a_small_output_gets_the_narrow_range_of_the_module(tmp_path: Path) -> None:
    path = tmp_path / "s.csv"
    header = "id,family,x,y,z,sensitivity,sensitivity unit,range from,range to\n"
    path.write_text(
        header + "F,load_cell,2,0,2,0.01,V/kN,0,50e3\nW,wire,-0.25,0,2.2,10,mV/mm,-0.4,0.4\n",
        encoding="utf-8",
    )
    rig = parse_rig(write_rig_text(BLOCK, read_sensor_table(path), modules=["NI 9205"]))
    assert rig.channel("F").input_range_v == (-1.0, 1.0)
    assert rig.channel("W").input_range_v == (-5.0, 5.0)


def test_who_finds_no_input_is_named_with_every_reason(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as refused:
        _written(tmp_path, LISTED + "B1,lvdt,0,0,0,0.2,V/mm,,,\n", ["NI 9213", "NI 9234", "NI 9229"])
    said = str(refused.value)
    assert "LAS: no module reads it: NI 9213 cannot measure a current" in said
    assert "--module 'NI 9203'" in said
    assert "ROPE: no module reads it" in said
    assert "--module 'NI 9237'" in said
    assert not list(tmp_path.glob("*.toml"))


def test_a_range_that_no_module_has_is_told_with_both_numbers(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"J1, W1: .*NI 9234 .*reads -5 to 5 V, not the sensor's -9\.99 to 9\.99 V"
    ):
        _written(tmp_path, LISTED[: LISTED.index("A1")], ["NI 9234"])


def test_slow_modules_get_no_sensor_of_the_motion() -> None:
    sensors = spread_sensors(BLOCK, {"wire": 1, "lvdt": 2})
    with pytest.raises(ConfigError, match="NI 9209 makes 500 samples a second at most"):
        write_rig_text(BLOCK, sensors, modules=["NI 9209"])


def test_a_channel_that_the_list_names_is_kept_and_taken_by_no_other(tmp_path: Path) -> None:
    named = LISTED.replace("0.2,V/mm,,,\n", "0.2,V/mm,,,cDAQ1Mod1/ai1\n")
    rig = _written(tmp_path, named, ["NI 9205", "NI 9234", "NI 9237", "NI 9213", "NI 9203"])
    assert rig.channel("J1").physical_channel == "cDAQ1Mod1/ai1"
    assert len({channel.physical_channel for channel in rig.channels}) == 7


def test_the_modules_come_from_an_export_of_ni_max(tmp_path: Path) -> None:
    lab, table, new = tmp_path / "lab.ini", tmp_path / "s.csv", tmp_path / "w.toml"
    lab.write_text(
        "[DAQmx]\nMajorVersion = 5\n"
        "[DAQmxCDAQChassis rig]\nProductType = cDAQ-9174\nDevSerialNum = 0x1\n"
        "[DAQmxCDAQModule rigMod2]\nProductType = NI 9234\nDevSerialNum = 0x2\n"
        "CompactDAQ.ChassisDevName = rig\nCompactDAQ.SlotNum = 2\n"
        "[DAQmxCDAQModule rigMod3]\nProductType = NI 9205\nDevSerialNum = 0x3\n"
        "CompactDAQ.ChassisDevName = rig\nCompactDAQ.SlotNum = 3\n",
        encoding="utf-8",
    )
    table.write_text(HEADER + LISTED[: LISTED.index("ROPE")], encoding="utf-8")
    sizes = ["--height", "2.4", "--thickness", "0.5", "--length", "1.6"]
    arguments = ["rig", "new", str(new), *sizes, "--sensors", str(table), "--hardware", str(lab)]
    said = CliRunner().invoke(build_app(), arguments)
    assert said.exit_code == 0, said.output
    assert "rigMod2 (NI 9234): A1 as iepe, assumed" in said.stdout
    rig = load_rig(new)
    assert rig.channel("A1").physical_channel == "rigMod2/ai0"
    assert rig.hardware.chassis[0].modules[0].serial == "00000002"


def test_a_workbook_of_excel_is_read_like_the_same_list_as_csv(tmp_path: Path) -> None:
    book, table = tmp_path / "s.xlsx", tmp_path / "s.csv"
    rows = [
        line.split(",") for line in ("id,family,x [mm],y [mm],z [mm],due\nJ1,lvdt,-250,,0,47164").splitlines()
    ]
    rows[1][3] = "100"
    _write_workbook(book, rows)
    table.write_text("id,family,x [mm],y [mm],z [mm],due\nJ1,lvdt,-250,100,0,2029-02-15\n", encoding="utf-8")
    assert read_sensor_table(book) == read_sensor_table(table)


@pytest.mark.parametrize("content", [b"", b"id,family\n", b"PK\x03\x04 nothing"])
def test_a_workbook_that_is_none_is_told_in_words(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "s.xlsx").write_bytes(content)
    with pytest.raises(ConfigError, match="is no Excel workbook"):
        read_sensor_table(tmp_path / "s.xlsx")


def _written(folder: Path, rows: str, modules: list[str]) -> Rig:
    path = folder / "sensors.csv"
    path.write_text(HEADER + rows, encoding="utf-8")
    return parse_rig(write_rig_text(BLOCK, read_sensor_table(path), modules=modules))


def _products(rig: Rig, modules: list[str]) -> dict[str, str]:
    """Channel → product of its module, where the modules fill the slots from the first."""
    slots = {channel.id: channel.physical_channel.partition("/")[0] for channel in rig.channels}
    return {name: modules[int(device.removeprefix("cDAQ1Mod")) - 1] for name, device in slots.items()}


def _write_workbook(path: Path, rows: list[list[str]]) -> None:
    """A workbook as Excel writes it: texts shared, numbers in their cells, empty cells left out."""
    main = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    texts: list[str] = []
    lines = []
    for number, row in enumerate(rows, start=1):
        cells = ""
        for letter, cell in zip("ABCDEFGH", row, strict=False):
            if not cell:
                continue
            if cell.lstrip("-").isdigit():
                cells += f'<c r="{letter}{number}"><v>{cell}</v></c>'
            else:
                texts.append(cell)
                cells += f'<c r="{letter}{number}" t="s"><v>{len(texts) - 1}</v></c>'
        lines.append(f'<row r="{number}">{cells}</row>')
    with zipfile.ZipFile(path, "w") as book:
        strings = "".join(f"<si><t>{text}</t></si>" for text in texts)
        book.writestr("xl/sharedStrings.xml", f"<sst {main}>{strings}</sst>")
        sheet = f"<worksheet {main}><sheetData>{''.join(lines)}</sheetData></worksheet>"
        book.writestr("xl/worksheets/sheet1.xml", sheet)
