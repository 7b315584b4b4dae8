"""Products under the names that programs and people use, with the channels that they have."""

from __future__ import annotations

import grpc
import nidaqmx
import numpy as np
import pytest
from nidaqmx.system import System

from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.program import build_bench
from sim_hardware.daqmx_server.services.server import DaqmxServer

C_SERIES = [
    "9201",
    "9202",
    "9203",
    "9205",
    "9206",
    "9207",
    "9208",
    "9209",
    "9210",
    "9211",
    "9212",
    "9213",
    "9214",
    "9215",
    "9216",
    "9217",
    "9218",
    "9219",
    "9220",
    "9221",
    "9222",
    "9223",
    "9224",
    "9225",
    "9226",
    "9227",
    "9228",
    "9229",
    "9230",
    "9231",
    "9232",
    "9233",
    "9234",
    "9235",
    "9236",
    "9237",
    "9238",
    "9239",
    "9242",
    "9246",
    "9250",
    "9251",
    "9252",
    "9253",
]
SC_EXPRESS = [
    "4300",
    "4302",
    "4303",
    "4309",
    "4330",
    "4331",
    "4339",
    "4340",
    "4353",
    "4357",
    "4461",
    "4464",
    "4466",
    "4480",
    "4481",
    "4492",
    "4496",
    "4497",
    "4498",
    "4499",
]
MULTIPLEXED = "6320 6321 6323 6341 6343 6351 6353 6361 6363"
SIMULTANEOUS = {
    "6346": 8,
    "6349": 32,
    "6356": 8,
    "6366": 8,
    "6374": 4,
    "6376": 8,
    "6378": 16,
    "6386": 8,
    "6396": 8,
}
"""Inputs by product, X Series user manual, table 4-8: total rate over single rate."""
BUS = {"6349": "PXIe", "6356": "PXIe", "6366": "PXIe", "6378": "PXIe", "6386": "PXIe", "6396": "PXIe"}
M_SERIES = (
    "6220 6221 6224 6225 6229 6230 6232 6233 6236 6238 6239 6250 6251 6254 6255 6259 6280 6281 6284 6289"
)


def served(devices: dict[str, str]) -> DaqmxServer:
    options = [part for name, product in devices.items() for part in ("--device", f"{name}={product}")]
    return DaqmxServer(build_bench(parser().parse_args([*options, "--speed", "max"])))


@pytest.mark.parametrize("spelling", ["NI {}", "NI-{}", "ni_{}"])
def test_every_c_series_module_has_inputs_however_it_is_spelt(spelling: str) -> None:
    devices = {"cDAQ1": "cDAQ-9178"} | {f"M{number}": spelling.format(number) for number in C_SERIES}
    inventory = served(devices).bench.inventory
    assert [
        name for name in devices if name[0] == "M" and not inventory.devices[name].physical_channels
    ] == []
    assert inventory.devices["M9205"].product_name == "NI 9205"


def test_cards_of_every_series_have_inputs() -> None:
    cards = [f"PXIe-{number}" for number in SC_EXPRESS]
    cards += [f"PCIe-{number}" for number in MULTIPLEXED.split()]
    cards += [f"{BUS.get(number, 'PCIe')}-{number}" for number in SIMULTANEOUS]
    cards += [f"{bus}-{number}" for number in M_SERIES.split() for bus in ("PCI", "PXI")]
    inventory = served({card.replace("-", ""): card for card in cards}).bench.inventory
    assert [name for name, device in inventory.devices.items() if not device.physical_channels] == []


def test_simultaneous_x_series_cards_have_their_manual_s_inputs_and_ranges() -> None:
    names = {number: f"{BUS.get(number, 'PCIe')}-{number}" for number in SIMULTANEOUS}
    server = served({f"X{number}": name for number, name in names.items()})
    server.start()
    with grpc.insecure_channel(server.address) as channel:
        system = System.remote(nidaqmx.GrpcSessionOptions(channel, ""))
        for number, inputs in SIMULTANEOUS.items():
            device = system.devices[f"X{number}"]
            assert len(device.ai_physical_chans) == inputs
            assert device.ai_simultaneous_sampling_supported
            assert device.ai_voltage_rngs == [-1.0, 1.0, -2.0, 2.0, -5.0, 5.0, -10.0, 10.0]
    server.stop()


@pytest.mark.parametrize(("level_db", "highest_pa"), [(94.0, 1.0024), (114.0, 10.024)])
def test_a_microphone_s_sound_pressure_level_sets_what_it_shows(level_db: float, highest_pa: float) -> None:
    """Its call has no minimum and maximum: NI's argument is in decibels above 20 µPa."""
    server = served({"Mic": "PXIe-4497"})
    server.start()
    with (
        grpc.insecure_channel(server.address) as channel,
        nidaqmx.Task(grpc_options=nidaqmx.GrpcSessionOptions(channel, "")) as task,
    ):
        made = task.ai_channels.add_ai_microphone_chan(
            "Mic/ai0", mic_sensitivity=50.0, max_snd_press_level=level_db, current_excit_val=0.004
        )
        task.timing.cfg_samp_clk_timing(10_000.0, samps_per_chan=200)
        shown = np.array(task.read(200))
        assert made.ai_max >= highest_pa
    assert shown.max() == pytest.approx(highest_pa, rel=0.01)
    assert shown.min() == pytest.approx(-highest_pa, rel=0.01)
    server.stop()
