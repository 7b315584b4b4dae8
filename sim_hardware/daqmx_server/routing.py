"""Which terminals a task drives: its sample clock and triggers, by NI's names and where it exports them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sim_hardware.daqmx_server.inventory import channel_list

if TYPE_CHECKING:
    from sim_hardware.daqmx_server.task import Task

_ENGINES: Final = ("ai", "te0", "te1", "te2")
_EXPORTS: Final = {
    "StartTrigger": "START_TRIG_OUTPUT_TERM",
    "ReferenceTrigger": "REF_TRIG_OUTPUT_TERM",
    "SampleClock": "SAMP_CLK_OUTPUT_TERM",
}


def plain(terminal: str) -> str:
    """Terminals compare without case and without the leading slash."""
    return terminal.lower().strip("/")


def terminals_of(task: Task, signal: str) -> set[str]:
    """Plain names of the terminals at which a signal of the task appears."""
    owners = [(host, engine) for host in task.hosts for engine in _ENGINES]
    owners += [(device, "ai") for device in task.devices]
    out = {plain(f"{owner}/{engine}/{signal}") for owner, engine in owners}
    return out | {plain(term) for term in channel_list(str(task.exported.get(_EXPORTS[signal], "")))}


def edges_of(task: Task, terminal: str) -> list[float]:
    """Instants of the task's edges at a (plain) terminal, as far as they have happened.

    Of a sample clock only the first edge counts: it is what starts whoever listens.
    """
    run = task.run
    if run is None or run.times is None:
        return []
    out = [run.times.first_s for s in ("StartTrigger", "SampleClock") if terminal in terminals_of(task, s)]
    if run.ref_sample is not None and terminal in terminals_of(task, "ReferenceTrigger"):
        out.append(run.times.time_of(run.ref_sample))
    return out
