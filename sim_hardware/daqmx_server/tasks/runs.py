"""The run that a started task begins: its plan, its clock, its reference trigger."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from nidaqmx.constants import AcquisitionType, OverwriteMode, SampleTimingType
from numpy.typing import NDArray

from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.tasks.checks import trigger_channel
from sim_hardware.daqmx_server.timing import triggers
from sim_hardware.daqmx_server.timing.acquisition import ReferenceSearch, Run, RunPlan
from sim_hardware.daqmx_server.timing.sampling import BlockSource
from sim_hardware.daqmx_server.timing.scan import Scan
from sim_hardware.daqmx_server.timing.start_rules import start_rule
from sim_hardware.daqmx_server.timing.task_timing import TaskTiming, TimedTask


class StartedTask(TimedTask, Protocol):
    """A task as far as its run is concerned."""

    reading: dict[str, Any]

    @property
    def buffer_size(self) -> int: ...

    @property
    def scan(self) -> Scan: ...

    def channel(self, name: str) -> VirtualChannel: ...


def make_run(task: StartedTask, now_s: float) -> Run:
    """The run of a task that is armed at an instant of the bench, s."""
    plan = _plan(task)
    hosts = task.hosts
    return Run(
        plan,
        start_rule(task, now_s),
        task.make_sampler,
        None if plan.pretrigger is None else _reference_search(task, plan.pretrigger),
        arrived=lambda now: task.bench.arrived_s(hosts, now),
    )


def _plan(task: StartedTask) -> RunPlan:
    finite = task.timing.mode == AcquisitionType.FINITE.value and not task.timing.retriggers
    ref = task.trigger["REF_TRIG_TYPE"] != triggers.NONE
    return RunPlan(
        rate_hz=task.timing.rate_hz,
        total=_total(task.timing) if finite else None,
        pretrigger=int(task.trigger["REF_TRIG_PRETRIG_SAMPLES"]) if ref else None,
        buffer=task.buffer_size,
        overwrite=task.io in ("AO", "DO", "CO")  # nothing is read from it
        or task.reading.get("OVERWRITE") == OverwriteMode.OVERWRITE_UNREAD_SAMPLES.value,
        instant=finite and task.bench.finite == "instant",
    )


def _total(timing: TaskTiming) -> int:
    """Samples per channel of a finite run; a counter output without timing makes one pulse."""
    return 1 if timing.timing_type == SampleTimingType.ON_DEMAND.value else timing.samples_per_channel


def trigger_readings(
    task: StartedTask, sampler: BlockSource, source: str, start: int, stop: int
) -> NDArray[np.float64]:
    """Readings start … stop−1 of the channel an analogue trigger listens to, in its unit."""
    row = task.channels.index(trigger_channel(task, source))
    return task.scan.readings(sampler.codes(start, stop)[[row]], [row]).ravel()


def _reference_search(task: StartedTask, pretrigger: int) -> ReferenceSearch:
    source = triggers.source_of(task.trigger, "REF")
    if triggers.waits_for_edge(task.trigger, "REF"):
        rising = triggers.is_rising(task.trigger, "REF")
        host = task.hosts[0]
        return ReferenceSearch(pretrigger, lambda after: task.bench.trigger_edge(host, source, after, rising))
    condition = triggers.Condition.of(task.trigger, "REF")

    def readings(run: Run, start: int, stop: int) -> NDArray[np.float64]:
        assert run.sampler is not None
        return trigger_readings(task, run.sampler, source, start, stop)

    return ReferenceSearch(
        pretrigger, crossing=triggers.CrossingSearch(condition, pretrigger), readings=readings
    )
