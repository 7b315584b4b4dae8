"""Instants of the bench as protobuf time stamps, and those of a task's events."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from typing import Any, Final, Literal

import hightime
from google.protobuf.timestamp_pb2 import Timestamp

from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.tasks.task import Task

Event = Literal["FIRST_SAMP", "START_TRIG", "REF_TRIG", "ARM_START_TRIG"]
_EPOCH = hightime.datetime(1970, 1, 1, tzinfo=dt.UTC)
_PROPERTIES: Final[dict[Event, str]] = {
    "FIRST_SAMP": "FirstSampTimestamp",
    "START_TRIG": "StartTrig_Timestamp",
    "REF_TRIG": "RefTrig_Timestamp",
    "ARM_START_TRIG": "ArmStartTrig_Timestamp",
}


def timestamp(instant: hightime.datetime) -> Timestamp:
    """To the nanosecond."""
    stamp = Timestamp()
    stamp.FromNanoseconds(int((instant - _EPOCH).precision_total_seconds() * 10**9))
    return stamp


def is_stamped(task: Task, event: Event) -> bool:
    """Whether the instant of an event is kept; of the first sample also on chassis that share their time."""
    if event == "FIRST_SAMP":
        default = task.host is not None and task.host.networked
        return bool(task.timing.settings.get("FIRST_SAMP_TIMESTAMP_ENABLE", default))
    return bool(task.trigger.get(f"{event}_TIMESTAMP_ENABLE"))


def event_instant(task: Task, event: Event) -> float | None:
    """Instant of an event on the bench's clock, s; None while it has not happened.

    As on NI's simulated devices, a trigger that the task does not have happens with its first sample.
    """
    run = task.run
    if run is None or run.times is None:
        return None
    if event == "ARM_START_TRIG":
        return float(task.armed_s)
    if event == "REF_TRIG" and run.plan.pretrigger is not None:
        return None if run.ref_sample is None else run.times.time_of(run.ref_sample)
    if event == "START_TRIG":
        return run.times.first_s - task.timing.start_delay_s
    return run.times.first_s


def event_stamp(event: Event) -> Callable[[Task], Any]:
    """UTC of an event as an attribute; −200983 before it, −209842 where its time stamp is not enabled."""

    def get(task: Task) -> Any:
        instant = event_instant(task, event)
        if instant is None:
            raise DaqmxError(Code.GET_BEFORE_RESERVED, f"Property: DAQmx_{_PROPERTIES[event]}_Val")
        if not is_stamped(task, event):
            raise DaqmxError(Code.TIMESTAMP_NOT_ENABLED, f"Property: DAQmx_{_PROPERTIES[event]}_Val")
        return timestamp(task.bench.utc(instant))

    return get
