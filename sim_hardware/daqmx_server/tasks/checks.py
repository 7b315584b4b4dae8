"""What is wrong with a task's configuration, in NI's order and with NI's codes."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final, Protocol

from nidaqmx.constants import AcquisitionType, OverwriteMode

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device, channel_list
from sim_hardware.daqmx_server.inventory.terminals import full_name
from sim_hardware.daqmx_server.tasks.tdms_log import TdmsLog
from sim_hardware.daqmx_server.timing import triggers
from sim_hardware.daqmx_server.timing.task_timing import TaskTiming

_TRIGGERS: Final[tuple[triggers.Which, ...]] = ("START", "REF")


class ConfiguredTask(Protocol):
    """A task as far as its configuration is concerned."""

    bench: Bench
    channels: list[VirtualChannel]
    timing: TaskTiming
    trigger: dict[str, Any]
    exported: dict[str, Any]
    reading: dict[str, Any]
    watchdog: dict[str, Any]
    log: TdmsLog

    @property
    def events(self) -> Collection[str]: ...

    @property
    def devices(self) -> list[str]: ...

    @property
    def hosts(self) -> list[str]: ...

    @property
    def host(self) -> Device | None: ...

    @property
    def io(self) -> str: ...

    @property
    def is_buffered(self) -> bool: ...

    def channel(self, name: str) -> VirtualChannel: ...

    def check_devices(self) -> None: ...


def check_configuration(task: ConfiguredTask) -> None:
    """Raise what is wrong with the settings."""
    if task.watchdog:
        return  # a timer of its device, without channels
    if not task.channels:
        raise DaqmxError(Code.NO_CHANNELS)
    task.check_devices()
    for channel in task.channels:
        channel.verify()
    if "every_n" in task.events and not task.is_buffered:
        raise DaqmxError(Code.EVERY_N_UNBUFFERED)
    _check_mix(task)
    _check_terminals(task)
    task.timing.verify()
    task.log.check(task.is_buffered)
    overwrites = task.reading.get("OVERWRITE") == OverwriteMode.OVERWRITE_UNREAD_SAMPLES.value
    if overwrites:
        refuse_while_logging(task, "OverWrite")
    _check_triggers(task)


class _LoggingTask(Protocol):
    bench: Bench
    log: TdmsLog

    @property
    def hosts(self) -> list[str]: ...


def refuse_while_logging(task: _LoggingTask, name: str) -> None:
    """−201300 where the driver is strict about attributes while it logs."""
    if task.log.enabled and task.bench.faults.active("strict_logging", *task.hosts):
        raise DaqmxError(Code.NOT_WHILE_LOGGING, f"Property: DAQmx_Read_{name}")


def _check_mix(task: ConfiguredTask) -> None:
    """Devices of several chassis need a common clock: a network, or the PXI backplane; −201426."""
    devices = {channel.device.name: channel.device for channel in task.channels}.values()
    hosts = {host: task.bench.inventory.devices.get(host) for host in task.hosts}
    on_network = all(host is not None and host.is_chassis and host.networked for host in hosts.values())
    on_backplane = len({d.category for d in devices}) == 1 and not any(d.chassis for d in devices)
    if len(hosts) > 1 and not (on_network or on_backplane):
        raise DaqmxError(Code.NO_SYNC, f"Device Names: {', '.join(task.devices)}")


def _check_terminals(task: ConfiguredTask) -> None:
    """−89120 or −89121 for clock sources, triggers and exports that no device has."""
    host = task.host
    if host is None:
        return
    inventory = task.bench.inventory
    if task.timing.source_is_foreign:
        full_name(inventory, host, task.timing.source, Code.SOURCE_TERMINAL_UNKNOWN)
    full_name(
        inventory,
        host,
        str(task.timing.settings.get("SAMP_CLK_TIMEBASE_SRC", "")),
        Code.SOURCE_TERMINAL_UNKNOWN,
    )
    for which in _TRIGGERS:
        if triggers.waits_for_edge(task.trigger, which):
            source = triggers.source_of(task.trigger, which)
            full_name(inventory, host, source, Code.SOURCE_TERMINAL_UNKNOWN)
    for name, terminals in task.exported.items():
        if name.endswith("_OUTPUT_TERM"):
            for terminal in channel_list(str(terminals)):
                full_name(inventory, host, terminal, Code.DESTINATION_TERMINAL_UNKNOWN)


def _check_triggers(task: ConfiguredTask) -> None:
    """A reference trigger ends a finite task; an analogue one listens to a channel of the task."""
    endless = task.timing.mode != AcquisitionType.FINITE.value
    if task.trigger["REF_TRIG_TYPE"] != triggers.NONE and endless:
        raise DaqmxError(Code.REF_TRIGGER_WHEN_CONTINUOUS)
    if task.trigger.get("START_TRIG_RETRIGGERABLE") and endless and task.io in ("AI", "DI"):
        raise DaqmxError(Code.RETRIGGER_INVALID)
    if triggers.holds_by_analog(task.trigger) and task.io == "AI":
        trigger_channel(task, triggers.source_of(task.trigger, "PAUSE"))
    for which in _TRIGGERS:
        by_level = task.trigger[f"{which}_TRIG_TYPE"] in (triggers.ANALOG, triggers.WINDOW)
        has_apfi = task.host is not None and not task.host.is_chassis
        if by_level and not (has_apfi and triggers.waits_for_edge(task.trigger, which)):
            trigger_channel(task, triggers.source_of(task.trigger, which))


class _NamedChannels(Protocol):
    def channel(self, name: str) -> VirtualChannel: ...


def trigger_channel(task: _NamedChannels, source: str) -> VirtualChannel:
    """The channel of the task that an analogue trigger listens to; −200265 for any other source."""
    try:
        return task.channel(source)
    except DaqmxError:
        raise DaqmxError(Code.TRIGGER_SOURCE_INVALID, f"Source: {source}") from None
