"""What the driver reads of sensors and converters before it starts: data sheets (TEDS), timing modes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import grpc
from nidaqmx.grpc_session_options import GrpcSessionOptions
from nidaqmx.system.physical_channel import PhysicalChannel

from daq_app.config import Rig
from daq_app.config.authoring import Block, read_sensor_table, write_rig_text
from drivers import open_driver
from drivers.protocol import DataSheet, Opened
from sim_hardware.daqmx_server.channels.teds import read_data_sheet
from tests.support.teds_file import data_sheet_file

Laboratories = Callable[..., Any]
MAKER_17 = DataSheet(manufacturer=17, model=1, version="A1", serial=12345)


def opened(lab: Any) -> Opened:
    driver = open_driver(lab.connection)
    try:
        return driver.open(lab.plan)
    finally:
        driver.close()


def iepe_terminal(rig: Rig, number: int = 0) -> tuple[str, str]:
    """(id, terminal) of an accelerometer on a module that asks its sensors."""
    channel = [channel for channel in rig.channels if channel.measurement == "iepe"][number]
    return channel.id, channel.physical_channel


def test_the_data_sheet_of_a_sensor_is_read_where_the_module_asks_for_it(
    laboratory: Laboratories, tmp_path: Path
) -> None:
    lab = laboratory("fr1-iepe")
    name, terminal = iepe_terminal(lab.rig)
    sheet = read_data_sheet(str(data_sheet_file(tmp_path, 25, (0, 1), (0, 1), (40000, 16))))
    lab.bench.sensors[terminal] = sheet
    wired = lab.rig.channels[0].physical_channel
    assert not wired.startswith(terminal.split("/")[0])
    lab.bench.sensors[wired] = sheet  # on a module that cannot ask

    assert opened(lab).data_sheets == {name: MAKER_17}


def test_a_data_sheet_that_somebody_gave_to_the_terminal_is_kept(
    laboratory: Laboratories, tmp_path: Path
) -> None:
    lab = laboratory("fr1-iepe")
    name, terminal = iepe_terminal(lab.rig)
    with grpc.insecure_channel(lab.server.address) as channel:
        place = PhysicalChannel(terminal, grpc_options=GrpcSessionOptions(channel, ""))
        place.configure_teds(str(data_sheet_file(tmp_path, 25, (0, 1), (0, 1), (40000, 16))))

    assert opened(lab).data_sheets == {name: MAKER_17}


def test_sensors_without_data_sheets_and_modules_without_modes_tell_nothing(
    laboratory: Laboratories,
) -> None:
    read = opened(laboratory("fr1-iepe"))
    assert (read.data_sheets, read.adc_timing) == ({}, {})


def test_a_slow_converter_s_timing_mode_is_read(laboratory: Laboratories, tmp_path: Path) -> None:
    sensors = tmp_path / "sensors.csv"
    sensors.write_text(
        "id,family,x [mm],y [mm],z [mm],sensitivity,sensitivity unit,measurement,thermocouple\n"
        "J1,lvdt,-250,0,0,0.2,V/mm,,\nW1,wire,-250,0,2200,10,mV/mm,,\nAIR,temperature,0,0,1000,,,,T\n",
        encoding="utf-8",
    )
    text = write_rig_text(
        Block("W1", 2.4, 0.5, 1.6), read_sensor_table(sensors), modules=["NI 9205", "NI 9213"], rate_hz=100.0
    )
    (tmp_path / "w1.toml").write_text(text, encoding="utf-8")

    assert opened(laboratory(tmp_path / "w1")).adc_timing == {"AIR": "AUTOMATIC"}
