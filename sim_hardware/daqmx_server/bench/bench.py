"""The simulated bench: everything that all tasks share, under one lock."""

from __future__ import annotations

import datetime as dt
import itertools
from concurrent.futures import ThreadPoolExecutor
from threading import Condition, RLock
from typing import Any, Final, Literal, Protocol

import hightime
import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp

from sim_hardware.daqmx_server.bench.clock import BenchClock, SteppedClock
from sim_hardware.daqmx_server.bench.loopback import Loopback, WiredBench
from sim_hardware.daqmx_server.channels.scale import CustomScale
from sim_hardware.daqmx_server.channels.teds import DataSheet
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device, Inventory, module_device
from sim_hardware.daqmx_server.inventory.terminals import full_name, plain
from sim_hardware.faults.board import FaultBoard
from sim_hardware.faults.model import Fault
from sim_hardware.signals import NothingWired, SignalSource

_SKEW_MARGIN_S = 1e-3
"""Multiplexers look at their last channel this long after the sample clock at most."""
_RESERVATIONS: Final = {
    "network_unreserved": Code.NETWORK_NOT_RESERVED,
    "network_reserved": Code.NETWORK_RESERVED_BY_OTHER,
}
"""Fault → what the driver says of a chassis that has it."""
FiniteClock = Literal["real", "instant"]


class BenchTask(Protocol):
    """A task as the bench sees it."""

    @property
    def is_buffered(self) -> bool: ...

    def edges_at(self, terminal: str) -> list[float]:
        """Instants of the task's edges at a (plain) terminal, as far as they have happened."""
        ...

    def drives(self, terminal: str) -> bool:
        """Whether the task is set to give edges at a (plain) terminal."""
        ...

    def disturbed(self) -> None: ...

    def clear(self) -> None: ...


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
        self.loopback = Loopback()
        self.wiring = WiredBench(source.volts, self.loopback, self._is_real)
        self.clock = clock
        self.finite = finite
        self.faults = FaultBoard(clock.now, self._volts_at)
        self.helper = ThreadPoolExecutor(1, thread_name_prefix="samples ahead")
        self.tasks: dict[str, BenchTask] = {}
        self.scales: dict[str, CustomScale] = {}
        self.routes: dict[str, str] = {}
        """Destination terminal → source, as the client has connected them."""
        self.power_up: dict[str, int] = {}
        """What lines, pulls and logic families are set to at power-up."""
        self.analog_power_up: dict[str, tuple[float, int]] = {}
        """Value and kind (NI's number) of analogue outputs at power-up, by physical channel."""
        self.data_sheets: dict[str, DataSheet] = {}
        """Data sheets (TEDS) that the driver has for a physical channel."""
        self.sensors: dict[str, DataSheet] = {}
        """Data sheets in the memories of the sensors themselves, by physical channel."""
        self.calibration: dict[tuple[str, str], Any] = {}
        """(device, attribute) → value that a client has set."""
        self.self_calibrated: dict[str, hightime.datetime] = {}
        """Device → when a client has it calibrated by itself, UTC."""
        self.saved_scales: dict[str, dict[str, str]] = {}
        self.saved_channels: dict[str, dict[str, str]] = {}
        self.saved_tasks: dict[str, dict[str, str]] = {}
        """What NI MAX has saved: name → keys and values of its section."""
        self._owners: dict[str, str] = {}
        self._edges: dict[str, list[tuple[float, bool]]] = {}
        self._swapped: dict[str, Device] = {}
        self._epoch: hightime.datetime | None = None

    @property
    def readers_drive_time(self) -> bool:
        """Whether the clock stands still unless somebody waits."""
        return isinstance(self.clock, SteppedClock)

    def utc(self, time_s: float) -> hightime.datetime:
        """Wall-clock time of an instant of the bench, finer than a float's seconds since 1970 could be."""
        if self._epoch is None:
            self._epoch = hightime.datetime.now(dt.UTC) - hightime.timedelta(seconds=self.clock.now())
        return self._epoch + hightime.timedelta(seconds=time_s)

    def instant_of(self, when: Timestamp) -> float:
        """Instant of the bench at which the wall clock shows a time, s."""
        since_1970 = hightime.timedelta(seconds=when.seconds) + hightime.timedelta(
            microseconds=when.nanos / 1e3
        )
        wall = hightime.datetime(1970, 1, 1, tzinfo=dt.UTC) + since_1970
        return float((wall - self.utc(0.0)).total_seconds())

    # --- devices --------------------------------------------------------------------------------

    def present(self) -> list[Device]:
        """Devices that the driver sees at the moment."""
        self.exchange_modules()
        return [
            device
            for device in self.inventory.devices.values()
            if not self.faults.active("module_removed", device.name) and not self._offline(device)
        ]

    def check_access(self, device: Device) -> None:
        """Raise what the driver says of a device that it cannot use.

        −201003 for one that has gone, −201390 over a dead network, −201388 for a network chassis that nobody
        has reserved, −201420 for one that another computer has.
        """
        if self.faults.active("module_removed", device.name):
            raise DaqmxError(Code.DEVICE_LOST, f"Device Specified: {device.name}")
        if self._offline(device):
            raise DaqmxError(Code.NETWORK_LOST, f"Device Specified: {device.name}")
        host = self.inventory.host_of(device)
        for kind, code in _RESERVATIONS.items():
            if self.faults.active(kind, host):
                raise DaqmxError(code, f"Device Specified: {host}")

    def take_over(self, chassis: str) -> None:
        """This computer has reserved a network chassis; who had it before has it no more."""
        for entry in self.faults.listing():
            if entry["kind"] in _RESERVATIONS and entry["target"] == chassis:
                self.clear_faults(int(str(entry["number"])))

    def _offline(self, device: Device) -> bool:
        outage = self.faults.outage([device.name, self.inventory.host_of(device)])
        return outage is not None and outage[1]

    def _is_real(self, name: str) -> bool:
        device = self.inventory.devices.get(name)
        return device is not None and not device.simulated

    def arrived_s(self, hosts: list[str], now_s: float) -> float:
        """Instant up to which samples have come through: those taken during an outage come after it."""
        outage = self.faults.outage(hosts)
        return now_s if outage is None or outage[0].start_s is None else min(now_s, outage[0].start_s)

    def exchange_modules(self) -> None:
        """Put other products into slots, or the right ones back, as the faults say now."""
        for name, device in list(self.inventory.devices.items()):
            entry = self.faults.active("wrong_device", name)
            if entry is not None and name not in self._swapped:
                self._swapped[name] = device
                product = entry.fault.text("product")
                self.inventory.devices[name] = module_device(name, product, device.chassis, device.slot)
            elif entry is None and name in self._swapped:
                self.inventory.devices[name] = self._swapped.pop(name)

    def reserve(self, resources: list[str], owner: str, timed_inputs: bool) -> None:
        """All or nothing; −50103 where somebody else has a part of a device, or no timing engine is left.

        A resource is a device's inputs (``Dev1/ai``), an output, a line, or a counter.
        """
        for resource in resources:
            device = resource.partition("/")[0]
            other = self._owners.get(resource, owner) != owner
            if other or self.faults.active("reserved", device):
                raise DaqmxError(Code.RESOURCE_RESERVED, f"Device: {device}")
        devices = list(dict.fromkeys(resource.partition("/")[0] for resource in resources))
        if timed_inputs:
            self._check_engines(devices, owner)
        for resource in resources:
            self._owners[resource] = owner

    def _check_engines(self, devices: list[str], owner: str) -> None:
        inventory = self.inventory
        for host in {inventory.host_of(inventory.device(device)) for device in devices}:
            engines = inventory.device(host).timing_engines
            modules = [device.name for device in inventory.devices.values() if device.chassis == host]
            inputs = [f"{name}/ai" for name in modules]
            others = {self._owners[name] for name in inputs if name in self._owners} - {owner}
            used = sum(self.tasks[name].is_buffered for name in others if name in self.tasks)
            if engines is not None and used >= engines:
                raise DaqmxError(Code.RESOURCE_RESERVED, f"Device: {host}\nResource: AI timing engine")

    def release(self, owner: str) -> None:
        self._owners = {resource: name for resource, name in self._owners.items() if name != owner}
        self.changed.notify_all()

    # --- the world ------------------------------------------------------------------------------

    def command(self, name: str, arguments: dict[str, float | str]) -> dict[str, object]:
        """Act on the world now; what had been sampled stays as it was."""
        self.clock.power_on()
        self.source.advance(self.clock.now() + _SKEW_MARGIN_S)
        answer = self.source.command(name, arguments)
        self.world_changed()
        return answer

    def add_fault(self, fault: Fault) -> int:
        """Break something, now or when the fault says."""
        number = self.faults.add(fault)
        self.world_changed()
        return number

    def clear_faults(self, number: int | None = None) -> None:
        """Mend one fault or all."""
        self.faults.clear(number)
        self.world_changed()

    def world_changed(self) -> None:
        """Samples ahead of now are to be made afresh, and whoever waits should look again."""
        for task in self.tasks.values():
            task.disturbed()
        self.changed.notify_all()

    def _volts_at(self, terminal: str, time_s: float) -> float:
        return float(self.source.volts((terminal,), np.array([time_s]))[0, 0])

    def digital_edge(self, terminal: str, time_s: float, rising: bool = True) -> None:
        """An edge at a terminal such as ``/cDAQ1/PFI0``, or of a line such as ``Dev1/port0/line3``."""
        self._edges.setdefault(plain(terminal), []).append((time_s, rising))
        for line in self.inventory.lines_at(terminal):
            self.loopback.hold(line, time_s, float(rising))
        self.world_changed()

    def level_spans(self, terminal: str, high: bool) -> list[tuple[float, float]]:
        """When a terminal has a level, as far as it is known: low before its first edge, s."""
        edges = sorted(self._edges.get(plain(terminal), ()))
        bounds = [(-np.inf, False), *edges, (np.inf, not high)]
        return [
            (start_s, end_s)
            for (start_s, level), (end_s, _) in itertools.pairwise(bounds)
            if level is high and end_s > start_s
        ]

    def first_edge(self, terminal: str, after_s: float, rising: bool = True) -> float | None:
        """First edge at the terminal at or after the instant: commanded, or a pulse of another task."""
        seen: list[float] = []
        for end in self.inventory.joined(plain(terminal)):
            seen += [t for t, up in self._edges.get(end, ()) if t >= after_s and up is rising]
            for task in self.tasks.values():
                seen += [t for t in task.edges_at(end) if t >= after_s - 1e-12]
        return min(seen, default=None)

    def trigger_edge(self, host: str, terminal: str, after_s: float, rising: bool) -> float | None:
        """The edge that a trigger at a terminal of a host waits for: at once where nothing ever gives one."""
        edge_s = self.first_edge(self._full_name(host, terminal), after_s, rising)
        return after_s if edge_s is None and self.fires_at_once(host, terminal) else edge_s

    def _full_name(self, host: str, terminal: str) -> str:
        device = self.inventory.device(host)
        return full_name(self.inventory, device, terminal, Code.SOURCE_TERMINAL_UNKNOWN)

    def fires_at_once(self, host: str, terminal: str) -> bool:
        """Whether a trigger here is simulated, as on NI's own simulated devices.

        So it is at an outer terminal of a simulated device on a bench where nothing is wired, until an
        edge is commanded or another task is set to drive the terminal.
        """
        name = plain(self._full_name(host, terminal))
        outer = name.rpartition("/")[2].startswith(("pfi", "apfi", "pxi_trig", "rtsi"))
        if not outer or not isinstance(self.source, NothingWired) or self._is_real_terminal(name):
            return False
        ends = self.inventory.joined(name)
        driven = any(task.drives(end) for task in self.tasks.values() for end in ends)
        return not driven and not any(self._edges.get(end) for end in ends)

    def _is_real_terminal(self, name: str) -> bool:
        owner = name.rpartition("/")[0]
        return any(plain(d.name) == owner and not d.simulated for d in self.inventory.devices.values())

    def reset(self) -> None:
        """Abort and forget every task (ResetServer)."""
        for task in list(self.tasks.values()):
            task.clear()
        self.tasks.clear()
        self._owners.clear()
        self.changed.notify_all()
