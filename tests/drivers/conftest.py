"""A simulated device server in this process, with known volts behind its terminals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import Rig, TaskPlan, load_rig, plan_tasks
from sim_hardware.control import SimControl
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.bench.clock import SteppedClock
from sim_hardware.daqmx_server.inventory.devices import Inventory
from sim_hardware.daqmx_server.services.server import DaqmxServer


class KnownVolts:
    """Terminal n of the rig carries (n + 1) · 10 mV, plus a ramp that tells the time of a sample."""

    RAMP_V_S = 0.01
    STEP_V = 0.01

    def __init__(self, rig: Rig) -> None:
        self._rows = {channel.physical_channel: row for row, channel in enumerate(rig.channels)}

    def volts(self, terminals: tuple[str, ...], times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        steps = np.array([self.STEP_V * (self._rows[name] + 1) for name in terminals])
        return steps[:, None] + self.RAMP_V_S * times_s[None, :]

    def advance(self, time_s: float) -> None:
        pass

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        raise ValueError("no commands here")


class Laboratory:
    """One rig, its plan, and a server whose clock moves only when somebody waits."""

    def __init__(self, rig_file: Path) -> None:
        self.rig = load_rig(rig_file)
        self.plan: TaskPlan = plan_tasks(self.rig, str(rig_file))
        self.bench = Bench(Inventory.from_rig(self.rig), KnownVolts(self.rig), SteppedClock())
        self.server = DaqmxServer(self.bench, 0)
        self.server.start()

    @property
    def connection(self) -> str:
        return f"grpc://127.0.0.1:{self.server.port}"

    def break_something(self, kind: str, target: str = "", **arguments: float | str) -> None:
        """A fault of the simulated hardware, from now on."""
        with SimControl(self.connection) as control:
            control.command("fault", kind=kind, target=target, **arguments)

    def mend(self) -> None:
        with SimControl(self.connection) as control:
            control.command("clear_faults")

    def let_time_pass(self, seconds: float) -> None:
        """As if the computer had been deaf for so long."""
        with self.bench.changed:
            self.bench.clock.skip(seconds)

    @property
    def open_tasks(self) -> int:
        with self.bench.changed:
            return len(self.bench.tasks)

    def stop(self) -> None:
        self.server.stop(0.0)


@pytest.fixture
def laboratory(configs: Path) -> Iterator[Callable[[str], Laboratory]]:
    """Make a laboratory for a shipped rig."""
    made: list[Laboratory] = []

    def make(name: str = "fr1") -> Laboratory:
        made.append(Laboratory(configs / f"{name}.toml"))
        return made[-1]

    yield make
    for one in made:
        one.stop()
