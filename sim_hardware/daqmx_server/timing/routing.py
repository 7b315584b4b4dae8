"""Which terminals a task drives: its sample clock and triggers, by NI's names and where it exports them."""

from __future__ import annotations

from typing import Any, Final, Protocol

from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.inventory.devices import channel_list
from sim_hardware.daqmx_server.inventory.terminals import plain
from sim_hardware.daqmx_server.timing.acquisition import Run
from sim_hardware.daqmx_server.timing.found_times import FoundTimes

_TIMING_ENGINES: Final = ("te0", "te1", "te2")
_EXPORTS: Final = {
    "StartTrigger": "START_TRIG_OUTPUT_TERM",
    "ReferenceTrigger": "REF_TRIG_OUTPUT_TERM",
    "SampleClock": "SAMP_CLK_OUTPUT_TERM",
}


class SignalTask(Protocol):
    """A task as far as its terminals are concerned."""

    exported: dict[str, Any]
    run: Run | None
    channels: list[VirtualChannel]

    @property
    def io(self) -> str: ...

    @property
    def hosts(self) -> list[str]: ...

    @property
    def devices(self) -> list[str]: ...

    @property
    def detects_changes(self) -> bool:
        """Whether changes of lines are its sample clock."""
        ...


def terminals_of(task: SignalTask, signal: str) -> set[str]:
    """Plain names of the terminals at which a signal of the task appears."""
    kind = task.io.lower() or "ai"
    if kind == "co":
        return _pulse_terminals(task) if signal == "SampleClock" else set()
    engines = (kind, *_TIMING_ENGINES)
    owners = [(host, engine) for host in task.hosts for engine in engines]
    owners += [(device, kind) for device in task.devices]
    out = {plain(f"{owner}/{engine}/{signal}") for owner, engine in owners}
    if signal == "SampleClock" and task.detects_changes:
        out |= {plain(f"{host}/ChangeDetectionEvent") for host in task.hosts}
        out |= {plain(t) for t in channel_list(str(task.exported.get("CHANGE_DETECT_EVENT_OUTPUT_TERM", "")))}
    return out | {plain(term) for term in channel_list(str(task.exported.get(_EXPORTS[signal], "")))}


def _pulse_terminals(task: SignalTask) -> set[str]:
    """Where the pulses of a counter output appear: inside the device, and at its output terminal."""
    out: set[str] = set()
    for channel in task.channels:
        host = task.hosts[0]
        out.add(plain(f"{host}/Ctr{channel.number}InternalOutput"))
        out.add(plain(str(channel.attributes.get("CO_PULSE_TERM") or f"{host}/{counter_output(channel)}")))
    return out


def counter_output(channel: VirtualChannel) -> str:
    """Default output terminal of a counter: PFI12 … PFI15 on cards with four counters (GK)."""
    return f"PFI{12 + channel.number}"


def drives(task: SignalTask, terminal: str) -> bool:
    """Whether the task is set to give edges at a (plain) terminal, now or once it runs."""
    return bool(task.channels) and any(terminal in terminals_of(task, signal) for signal in _EXPORTS)


def edges_of(task: SignalTask, terminal: str) -> list[float]:
    """Instants of the task's edges at a (plain) terminal, as far as they have happened.

    Only the first edge of a regular sample clock counts: it is what starts whoever listens.
    """
    run = task.run
    if run is None or run.times is None:
        return []
    out = [run.times.first_s for s in ("StartTrigger", "SampleClock") if terminal in terminals_of(task, s)]
    if isinstance(run.times, FoundTimes) and terminal in terminals_of(task, "SampleClock"):
        out += run.times.finder.known()
    if run.ref_sample is not None and terminal in terminals_of(task, "ReferenceTrigger"):
        out.append(run.times.time_of(run.ref_sample))
    return out
