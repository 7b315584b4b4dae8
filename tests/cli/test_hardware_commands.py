"""The hardware of a rig file from NI MAX or NI-DAQmx, and the comparison of both with the file."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
import tomli_w
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config.authoring.hardware_text import hardware_text
from daq_app.config.errors import ConfigError
from daq_app.config.hardware import catalogue
from daq_app.config.hardware.comparison import differences
from daq_app.config.hardware.max_file import ListedDevice, listed_in_export
from daq_app.config.hardware.product_files import product_set
from daq_app.config.loader import load_rig
from daq_app.config.rig import Hardware
from drivers.ni.product_copy import describe_product
from sim_hardware.control import SimControl
from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.program import build_bench
from sim_hardware.daqmx_server.services.server import DaqmxServer
from tests.cli.test_config_commands import daq_app

EXPORT = """
[DAQmxCDAQChassis cDAQ1]
ProductType = cDAQ-9178
DevSerialNum = 0x1A2B3C
DevIsSimulated = 0
[DAQmxCDAQModule cDAQ1Mod1]
ProductType = NI 9205
DevSerialNum = 0x11
DevIsSimulated = 0
CompactDAQ.ChassisDevName = cDAQ1
CompactDAQ.SlotNum = 1
[DAQmxCDAQModule Bridges]
ProductType = NI 9237 (DSUB)
CompactDAQ.ChassisDevName = cDAQ1
CompactDAQ.SlotNum = 4
[DAQmxCDAQModule cDAQ1Mod5]
ProductType = NI 9999
CompactDAQ.ChassisDevName = cDAQ1
CompactDAQ.SlotNum = 5
[DAQmxDevice Dev1]
ProductType = PCIe-6363
"""


@pytest.fixture
def export(tmp_path: Path) -> Path:
    path = tmp_path / "lab.ini"
    path.write_text(EXPORT, encoding="utf-8-sig")
    return path


@pytest.fixture
def connection(configs: Path) -> Iterator[str]:
    """NI-DAQmx with the devices of FR1."""
    server = DaqmxServer(build_bench(parser().parse_args(["--config", str(configs / "fr1.toml")])))
    server.start()
    yield f"grpc://{server.address}"
    server.stop()


def test_an_export_of_ni_max_becomes_the_hardware_of_a_rig_file(export: Path) -> None:
    done = daq_app("rig", "from-max", export)

    assert done.returncode == 0, done.stderr
    hardware = Hardware.model_validate(tomllib.loads(done.stdout)["hardware"])
    assert hardware.connection == "local"
    (chassis,) = hardware.chassis
    assert (chassis.name, chassis.product) == ("cDAQ1", "cDAQ-9178")
    assert [(m.slot, m.product, m.name, m.serial) for m in chassis.modules] == [
        (1, "NI 9205", "", "00000011"),
        (4, "NI 9237", "Bridges", ""),
    ]
    assert "# cDAQ1Mod5 in slot 5 of cDAQ1 is a NI 9999, which the catalogue lacks" in done.stdout
    assert "# Dev1 (PCIe-6363) is left out: no chassis and slot are listed for it." in done.stdout


def test_what_ni_daqmx_finds_is_the_hardware_of_the_rig_that_it_serves(
    connection: str, configs: Path
) -> None:
    done = daq_app("rig", "from-device", connection)

    assert done.returncode == 0, done.stderr
    found = Hardware.model_validate(tomllib.loads(done.stdout)["hardware"])
    wanted = load_rig(configs / "fr1.toml").hardware
    assert found.connection == connection
    assert [[(m.slot, m.product) for m in c.modules] for c in found.chassis] == [
        [(m.slot, m.product) for m in c.modules] for c in wanted.chassis
    ]


COPIED = (
    "NI 9205", "NI 9213", "NI 9215", "NI 9229", "NI 9234", "NI 9237", "NI 9401",
    "NI 9263", "PXIe-4331", "PXIe-4499", "PCIe-6363",
)  # fmt: skip
NOT_TOLD = ("source", "external_clock", "delta_sigma", "measurements")


def test_a_product_file_is_copied_from_a_device_that_is_there(tmp_path: Path) -> None:
    """All that NI-DAQmx tells of a product makes the same product again."""
    devices = [f"--device=D{number}={product}" for number, product in enumerate(COPIED[8:])]
    devices += [
        f"--device=C{number // 8}Mod{number % 8 + 1}={name}" for number, name in enumerate(COPIED[:9])
    ]
    server = DaqmxServer(build_bench(parser().parse_args(["--device=C0=cDAQ-9188", *devices])))
    server.start()
    names = {device.product_name: device.name for device in server.bench.present()}
    try:
        texts = [
            tomli_w.dumps({"product": [describe_product(f"grpc://{server.address}", names[product])]})
            for product in COPIED
        ]
        printed = daq_app("rig", "product", names["NI 9234"], f"grpc://{server.address}")
        unknown = daq_app("rig", "product", "Dev9", f"grpc://{server.address}")
        of_chassis = daq_app("rig", "product", "C0", f"grpc://{server.address}")
    finally:
        server.stop()

    copies = product_set([tomllib.loads(text) for text in texts]).products
    for name in COPIED:
        original = catalogue.BUILT_IN.products[name]
        for key in (field.name for field in fields(original) if field.name not in NOT_TOLD):
            assert (name, key, getattr(copies[name], key)) == (name, key, getattr(original, key))
    iepe, known = copies["NI 9234"].delta_sigma, catalogue.BUILT_IN.products["NI 9234"].delta_sigma
    assert iepe is not None and known is not None
    assert (iepe.timebase_hz, iepe.divisor, iepe.n_range) == (known.timebase_hz, known.divisor, known.n_range)
    assert tomllib.loads(printed.stdout) == tomllib.loads(texts[COPIED.index("NI 9234")])
    assert unknown.returncode == 3 and "There is no device Dev9" in " ".join(unknown.stderr.split())
    assert of_chassis.returncode == 3 and "[[chassis]]" in of_chassis.stderr


def test_a_rig_file_is_checked_against_the_devices_that_are_there(connection: str, configs: Path) -> None:
    done = daq_app("config", "check", configs / "fr1.toml", "--against", connection)

    assert done.returncode == 0, done.stderr
    assert "its hardware is there" in done.stdout


def test_a_rig_file_is_checked_against_an_export(export: Path, configs: Path) -> None:
    done = daq_app("config", "check", configs / "fr1.toml", "--against", export)

    assert done.returncode == 2
    assert "cDAQ1Mod2 (NI 9205) is missing" in done.stderr
    assert "Bridges (NI 9237 (DSUB), slot 4 of cDAQ1) is not in the rig file" in " ".join(done.stderr.split())


@pytest.fixture
def network() -> Iterator[DaqmxServer]:
    """One chassis on the network, that another computer has reserved."""
    server = DaqmxServer(build_bench(parser().parse_args(["--device", "N1=cDAQ-9188"])))
    server.start()
    with SimControl(server.address) as control:
        control.command("fault", kind="network_reserved", target="N1")
    yield server
    server.stop()


def test_a_chassis_of_another_computer_is_taken_over_only_when_told_to(network: DaqmxServer) -> None:
    runner, app, way = CliRunner(), build_app(), f"grpc://{network.address}"

    declined = runner.invoke(app, ["rig", "reserve", "N1", way], input="n\n")
    held = network.bench.faults.active("network_reserved", "N1")
    taken = runner.invoke(app, ["rig", "reserve", "N1", way, "--override"])

    assert "Another computer has reserved N1" in declined.output
    assert declined.exit_code != 0
    assert held is not None
    assert (taken.exit_code, taken.output) == (0, "N1 is reserved\n")
    assert network.bench.faults.active("network_reserved", "N1") is None


def _hardware() -> Hardware:
    modules = [{"slot": 1, "product": "NI 9205", "serial": "00000011"}, {"slot": 2, "product": "NI 9234"}]
    return Hardware.model_validate({"chassis": [{"name": "c", "product": "cDAQ-9178", "modules": modules}]})


CHASSIS = ListedDevice("c", "cDAQ-9178", is_chassis=True)
FIRST = ListedDevice("cMod1", "NI-9205", "00000011", "c", 1)
SECOND = ListedDevice("cMod2", "NI 9234", "", "c", 2)


@pytest.mark.parametrize(
    ("devices", "sentence"),
    [
        ([FIRST, SECOND], "the chassis c (cDAQ-9178) is missing"),
        ([ListedDevice("c", "cDAQ-9185"), FIRST, SECOND], "the chassis c is a cDAQ-9185"),
        ([CHASSIS, SECOND], "cMod1 (NI 9205) is missing"),
        ([CHASSIS, ListedDevice("cMod1", "NI 9239", "", "c", 1), SECOND], "cMod1 is a NI 9239"),
        ([CHASSIS, ListedDevice("cMod1", "NI 9205", "00000012", "c", 1), SECOND], "serial number 00000012"),
        ([CHASSIS, ListedDevice("cMod1", "NI 9205", "", "c", 3), SECOND], "cMod1 sits in slot 3"),
    ],
)
def test_each_difference_is_one_sentence(devices: list[ListedDevice], sentence: str) -> None:
    (said,) = differences(_hardware(), devices)
    assert sentence in said


def test_the_same_hardware_under_other_spellings_is_no_difference() -> None:
    assert differences(_hardware(), [CHASSIS, FIRST, SECOND, ListedDevice("Dev1", "PCIe-6363")]) == []


def test_the_product_of_a_pxi_chassis_is_asked_for() -> None:
    text = hardware_text([ListedDevice("PXI1Slot2", "PXIe-4340", "", "PXI1", 2)], "lab.ini")
    assert "# PXI1: NI-DAQmx does not name the product of a PXI chassis; write it." in text
    assert tomllib.loads(text)["hardware"]["chassis"][0]["modules"] == [{"slot": 2, "product": "PXIe-4340"}]


def test_devices_without_a_chassis_make_no_rig() -> None:
    with pytest.raises(ConfigError, match="no module sits in a chassis"):
        hardware_text([ListedDevice("Dev1", "PCIe-6363")], "lab.ini")


def test_a_file_that_is_no_export_is_told_in_words(tmp_path: Path) -> None:
    (tmp_path / "a.ini").write_text("hello", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"a\.ini: the export cannot be read"):
        listed_in_export(tmp_path / "a.ini")


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "fr1.toml", "--connection=local"],
        ["config", "check", "fr1.toml", "--against", "local"],
        ["rig", "from-device"],
        ["rig", "product", "cDAQ1Mod1", "local"],
        ["rig", "reserve", "cDAQ1"],
    ],
    ids=" ".join,
)
def test_a_computer_without_ni_daqmx_says_so_before_anything_is_loaded(
    configs: Path, arguments: list[str]
) -> None:
    """Loading takes the seconds that nobody should wait for this answer."""
    command = [sys.executable, "-X", "importtime", "-m", "daq_app.cli", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=configs)

    assert done.returncode == 3
    assert "NI-DAQmx is not installed on this computer" in done.stderr
    assert not re.search(r"\| +(numpy|h5py|grpc|nidaqmx)$", done.stderr, re.MULTILINE)


def test_a_computer_without_ni_daqmx_says_so_before_anything_is_started(
    tmp_path: Path, configs: Path
) -> None:
    rig, out = configs / "fr1.toml", tmp_path / "runs"
    done = daq_app("run", rig, "--test", "FR1-L3-1", "--connection", "local", "--headless", "--out", out)

    assert done.returncode == 3
    assert "NI-DAQmx is not installed on this computer" in " ".join(done.stderr.split())
    assert not out.exists()
