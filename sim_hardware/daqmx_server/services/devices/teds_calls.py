"""Calls that give terminals a sensor's data sheet (TEDS), and take it away."""

from __future__ import annotations

from typing import Any

from nidaqmx._stubs import nidaqmx_pb2 as pb

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.teds import DataSheet, read_data_sheet
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.services.attributes.groups import Handler


def configure_teds(bench: Bench, request: Any) -> Any:
    """A virtual data sheet from a file, or that of the sensor; −200709 where neither gives one."""
    device, channel = bench.inventory.named_channel(request.physical_channel, "AI")
    if request.file_path:
        bench.data_sheets[channel] = read_data_sheet(request.file_path)
        return pb.ConfigureTEDSResponse()
    asks_sensors = device.product is not None and device.product.teds
    if not asks_sensors or channel not in bench.sensors:
        raise DaqmxError(Code.TEDS_NOT_DETECTED, f"Physical Channel Name: {channel}")
    bench.data_sheets[channel] = bench.sensors[channel]
    return pb.ConfigureTEDSResponse()


def clear_teds(bench: Bench, request: Any) -> Any:
    _, channel = bench.inventory.named_channel(request.physical_channel, "AI")
    bench.data_sheets.pop(channel, None)
    return pb.ClearTEDSResponse()


def write_from_array(bench: Bench, request: Any) -> Any:
    """No simulated sensor has a memory: a good data sheet finds nobody to take it."""
    DataSheet.from_stream(request.bit_stream)
    raise DaqmxError(Code.TEDS_NOT_DETECTED, f"Physical Channel Name: {request.physical_channel}")


def write_from_file(bench: Bench, request: Any) -> Any:
    read_data_sheet(request.file_path)
    raise DaqmxError(Code.TEDS_NOT_DETECTED, f"Physical Channel Name: {request.physical_channel}")


def teds_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    return {
        "ConfigureTEDS": configure_teds,
        "ClearTEDS": clear_teds,
        "WriteToTEDSFromArray": write_from_array,
        "WriteToTEDSFromFile": write_from_file,
    }
