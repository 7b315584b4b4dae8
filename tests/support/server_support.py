"""Signals, inventory and client of the server tests."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import grpc
import nidaqmx
import nidaqmx.system
import numpy as np
from nidaqmx.constants import AcquisitionType
from nidaqmx.grpc_session_options import GrpcSessionOptions
from numpy.typing import NDArray

from sim_hardware.control import SimControl
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.bench.clock import PacedClock, SteppedClock
from sim_hardware.daqmx_server.inventory.devices import Inventory, cdaq_chassis, module_device
from sim_hardware.daqmx_server.services.server import DaqmxServer

MODULES = {1: "NI 9205", 2: "NI 9205", 3: "NI 9234", 4: "NI 9239", 5: "NI 9205"}


class TestSignals:
    """A sine per terminal: 1 V + 0.1 V per channel, 5 Hz, phase by channel; a command shifts them."""

    __test__ = False

    def __init__(self) -> None:
        self.shifts: list[tuple[float, float]] = []
        self.now_s = 0.0

    @staticmethod
    def number(terminal: str) -> int:
        return int(terminal.rsplit("/ai", 1)[1])

    def volts(self, terminals: tuple[str, ...], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty((len(terminals), len(times_s)))
        for row, terminal in enumerate(terminals):
            n = self.number(terminal)
            out[row] = (1.0 + 0.1 * n) * np.sin(2 * np.pi * 5.0 * times_s + n)
            for at_s, volts in self.shifts:
                out[row] += volts * (times_s >= at_s)
        return out

    def advance(self, time_s: float) -> None:
        self.now_s = time_s

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        if name != "shift":
            raise ValueError(f"no command {name!r}; there is: shift")
        self.shifts.append((self.now_s, float(arguments["volts"])))
        return {"time_s": self.now_s}


@dataclass
class Rig:
    bench: Bench
    server: DaqmxServer
    channel: grpc.Channel
    control: SimControl
    killed: threading.Event
    """Set in place of the death that the fault ``server_killed`` brings."""

    def options(self, name: str = "") -> GrpcSessionOptions:
        return GrpcSessionOptions(self.channel, name)

    def task(self, name: str = "") -> nidaqmx.Task:
        return nidaqmx.Task(name, grpc_options=self.options(name))

    def system(self) -> nidaqmx.system.System:
        return nidaqmx.system.System.remote(self.options())

    def skip(self, seconds: float) -> None:
        """Let bench time pass while nobody reads."""
        with self.bench.changed:
            self.bench.clock.skip(seconds)

    def is_waiting(self, task: str) -> bool:
        """Whether the task runs and more samples have come than were ready at its first read."""
        with self.bench.changed:
            run = self.bench.tasks[task].run
            return run is not None and run.acquired(self.bench.clock.now()) > 20

    def close(self) -> None:
        self.control.close()
        self.channel.close()
        self.server.stop()


def inventory() -> Inventory:
    out = Inventory()
    out.add(cdaq_chassis("cDAQ1", "cDAQ-9178"))
    for slot, product in MODULES.items():
        out.add(module_device(f"cDAQ1Mod{slot}", product, "cDAQ1", slot, serial=0x01AB0000 + slot))
    out.add(module_device("PXI1Slot2", "PXIe-4340", "", 2))
    out.add(module_device("PXI1Slot3", "PXIe-6363", "", 3))
    return out


def make_rig(speed: float = float("inf"), finite: str = "real", source: object = None) -> Rig:
    clock = SteppedClock() if speed == float("inf") else PacedClock(speed)
    bench = Bench(inventory(), source or TestSignals(), clock, finite)  # type: ignore[arg-type]
    killed = threading.Event()
    server = DaqmxServer(bench, kill=killed.set)
    server.start()
    channel = grpc.insecure_channel(server.address, options=[("grpc.max_receive_message_length", -1)])
    return Rig(bench, server, channel, SimControl(server.address), killed)


def continuous(task: nidaqmx.Task, rate_hz: float = 4000.0) -> None:
    task.timing.cfg_samp_clk_timing(rate_hz, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=200_000)
