"""The simulated bench: everything that all tasks share, under one lock."""

from __future__ import annotations

import time
from threading import Condition, RLock
from typing import TYPE_CHECKING, Literal

from sim_hardware.daqmx_server.clock import BenchClock, SteppedClock
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory import Inventory
from sim_hardware.faults.board import FaultBoard
from sim_hardware.signals import SignalSource

if TYPE_CHECKING:
    from sim_hardware.daqmx_server.task import Task

FiniteClock = Literal["real", "instant"]


class Bench:
    """Inventory, wiring, clock, faults, tasks and who has reserved what.

    Every method, and every method of a task, is called with `changed` held: one condition for the
    whole bench, notified whenever anything happened that somebody may be waiting for.
    """

    def __init__(
        self, inventory: Inventory, source: SignalSource, clock: BenchClock, finite: FiniteClock = "real"
    ) -> None:
        self.changed = Condition(RLock())
        self.inventory = inventory
        self.source = source
        self.clock = clock
        self.finite = finite
        self.faults = FaultBoard()
        self._epoch_s = time.time()
        self.tasks: dict[str, Task] = {}
        self.scales: dict[str, object] = {}
        self._owners: dict[str, str] = {}
        self._edges: dict[str, list[float]] = {}

    @property
    def readers_drive_time(self) -> bool:
        """Whether the clock stands still unless somebody waits."""
        return isinstance(self.clock, SteppedClock)

    def utc_s(self, time_s: float) -> float:
        """Wall-clock time (Unix seconds) of an instant of the bench."""
        return self._epoch_s + time_s

    def task(self, name: str) -> Task:
        try:
            return self.tasks[name]
        except KeyError:
            raise DaqmxError(Code.INVALID_TASK, f"Task Name: {name}") from None

    def reserve(self, resources: list[str], owner: str) -> None:
        """All or nothing; −50103 where somebody else has one of them."""
        for resource in resources:
            holder = self._owners.get(resource) or self.faults.reserved_by(resource)
            if holder not in (None, owner):
                raise DaqmxError(Code.RESOURCE_RESERVED, f"Device: {resource}")
        for resource in resources:
            self._owners[resource] = owner

    def release(self, owner: str) -> None:
        self._owners = {resource: name for resource, name in self._owners.items() if name != owner}
        self.changed.notify_all()

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        """Act on the world now; what had been sampled stays as it was."""
        self.clock.power_on()
        self.source.advance(self.clock.now())
        answer = self.source.command(name, arguments)
        self.world_changed()
        return answer

    def world_changed(self) -> None:
        """Samples ahead of now are to be made afresh, and whoever waits should look again."""
        for task in self.tasks.values():
            if task.run is not None:
                task.run.forget_ahead()
        self.changed.notify_all()

    def digital_edge(self, terminal: str, time_s: float) -> None:
        """A rising edge at a terminal such as ``/cDAQ1/PFI0``."""
        self._edges.setdefault(terminal.lower().strip("/"), []).append(time_s)
        self.changed.notify_all()

    def first_edge(self, terminal: str, after_s: float) -> float | None:
        """First edge at the terminal at or after the instant: commanded, or routed from another task."""
        wanted = terminal.lower().strip("/")
        seen = [t for t in self._edges.get(wanted, ()) if t >= after_s]
        for task in self.tasks.values():
            seen += [t for t in task.signal_times(wanted) if t >= after_s - 1e-12]
        return min(seen, default=None)

    def reset(self) -> None:
        """Abort and forget every task (ResetServer)."""
        for task in list(self.tasks.values()):
            task.clear()
        self.tasks.clear()
        self._owners.clear()
        self.changed.notify_all()
