"""Waiting for samples and handing them out: what every read call shares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from nidaqmx.constants import AcquisitionType, ReadRelativeTo
from numpy.typing import NDArray

from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.tasks.samplers import on_demand_sampler
from sim_hardware.daqmx_server.tasks.task import State, Task
from sim_hardware.daqmx_server.timing.acquisition import Run, overwritten

ALL_AVAILABLE = -1
_CURRENT = ReadRelativeTo.CURRENT_READ_POSITION.value


@dataclass(frozen=True, slots=True)
class Reading:
    """Outcome of a read: `status` is 0, or −200284 together with the samples that had come."""

    codes: NDArray[Any]
    """(channels to read, samples)"""
    rows: list[int] | None
    status: int
    first_time_s: float
    """Bench time of the first sample."""
    position: int = 0
    """Number of the first sample in the run."""

    @property
    def count(self) -> int:
        return int(self.codes.shape[1])


def default_count(task: Task) -> int:
    """Samples per channel that "read all available" means at this moment."""
    if not task.is_buffered:
        return 1
    if task.timing.mode == AcquisitionType.FINITE.value and not task.reading.get(
        "READ_ALL_AVAIL_SAMP", False
    ):
        taken = 0 if task.run is None or task.timing.retriggers else task.run.read_position
        return max(task.timing.samples_per_channel - taken, 0)
    if task.run is None:
        return 0
    task.run.check(task.bench.clock.glance())
    return task.run.available(task.bench.clock.now())


def _within_run(task: Task, asked: int) -> int:
    """What is left of a finite acquisition, where more is asked for; all that is asked where none is left."""
    endless = task.timing.mode != AcquisitionType.FINITE.value or task.timing.retriggers
    if not task.is_buffered or endless:
        return asked
    taken = 0 if task.run is None else task.run.read_position
    following = task.reading.get("RELATIVE_TO", _CURRENT) == _CURRENT and not task.reading.get("OFFSET", 0)
    left = task.timing.samples_per_channel - taken
    return min(asked, left) if following and left > 0 else asked


def read(task: Task, asked: int, timeout_s: float, room: int | None = None) -> Reading:
    """Take `asked` samples per channel, waiting for them; the bench's lock is held (and let go in waiting).

    `room` is the client's array in samples of all channels together.
    """
    if task.log.takes_samples:
        raise DaqmxError(Code.READ_WHILE_LOGGING, samples_read=0)
    _ready(task)
    rows = task.read_rows()
    count = default_count(task) if asked == ALL_AVAILABLE else _within_run(task, asked)
    n_rows = len(task.channels) if rows is None else len(rows)
    if room is not None and room < count * n_rows:
        raise DaqmxError(Code.READ_BUFFER_TOO_SMALL)
    if not task.is_buffered:
        return _on_demand(task, count, rows)
    run = task.run
    assert run is not None
    _spoil_buffer(task, run)
    run.check(task.bench.clock.now())
    exchange = _Exchange.of(task, run, count)
    start = _start(task, run) if exchange is None else exchange.start
    spoiled = task.bench.faults.take("read_timeout", task.name)
    wanted = count if spoiled is None else min(count, int(spoiled.number("samples")))
    in_time = _wait(task, run, start + wanted, timeout_s)
    if spoiled is not None:
        _let_time_out(task, run, timeout_s)
    taken = min(max(run.readable(task.bench.clock.now()) - start, 0), wanted)
    codes = run.block(start, taken, rows) if taken else np.empty((n_rows, 0), dtype=np.int32)
    run.read_position = start + taken
    if exchange is not None:
        exchange.done(task)
    first = task.bench.clock.now() if run.times is None else run.times.time_of(run.base + start)
    if task.io == "AI":
        task.overloads.update(task.scan.overloaded(codes, rows))
        task.log_read(codes, rows, start)
    _end_automatic(task, run)
    task.bench.changed.notify_all()
    late = not in_time or taken < count
    return Reading(codes, rows, int(Code.SAMPLES_NOT_YET_AVAILABLE) if late else 0, first, start)


def _wait(task: Task, run: Run, end: int, timeout_s: float) -> bool:
    """Wait until the samples before `end` can be read; False when the time is over."""
    clock = task.bench.clock
    deadline = clock.deadline(timeout_s)
    while run.readable(clock.now()) < end:
        if run.plan.total is not None and end > run.plan.total:
            raise DaqmxError(Code.SAMPLES_NEVER_AVAILABLE, samples_read=0)
        last = run.last_sample()
        needed = run.base + end if run.plan.pretrigger is None or last is None else last
        if not clock.wait(task.bench.changed, run.time_of_count(needed), deadline):
            return run.readable(clock.now()) >= end
        if run.aborted:
            run.check(clock.now())
        task.check_devices()
    return True


def _let_time_out(task: Task, run: Run, timeout_s: float) -> None:
    """A spoiled read lasts until its time-out, whatever there is to read."""
    clock = task.bench.clock
    deadline = clock.deadline(timeout_s)
    while clock.wait(task.bench.changed, None, deadline) and not run.aborted:
        pass


def _spoil_buffer(task: Task, run: Run) -> None:
    """The fault "buffer overwritten": time passes unheard until the buffer has run over."""
    fault = task.bench.faults.take("buffer_overwritten", task.name)
    if fault is not None and run.times is not None and run.plan.total is None:
        now = task.bench.clock.now()
        excess = run.read_position + run.plan.buffer + int(fault.number("lost_samples")) - run.acquired(now)
        task.bench.clock.skip(max(excess, 0) / run.plan.rate_hz)


@dataclass(slots=True)
class _Exchange:
    """The fault "reply out of order": the block after the next one comes first, then the next one.

    The device's read position goes back and forth with it, so that a careful client can notice.
    """

    start: int
    resume: int | None

    @classmethod
    def of(cls, task: Task, run: Run, count: int) -> _Exchange | None:
        following = task.reading.get("RELATIVE_TO", _CURRENT) == _CURRENT
        held, task.exchange = task.exchange, None
        if held is not None and following:
            return cls(held, held + 2 * count)
        if following and task.resume is not None:
            run.read_position, task.resume = task.resume, None
        if following and task.bench.faults.take("reply_out_of_order", task.name):
            task.exchange = run.read_position
            return cls(run.read_position + count, None)
        task.resume = None
        return None

    def done(self, task: Task) -> None:
        task.resume = self.resume


def _ready(task: Task) -> None:
    if not task.channels:
        raise DaqmxError(Code.NO_INPUT_CHANNELS)
    task.check_devices()
    if task.state is not State.RUNNING:
        if not task.reading.get("AUTO_START", True):
            raise DaqmxError(Code.READ_NOT_STARTED)
        task.start()
        task.auto_started = True


def _end_automatic(task: Task, run: Run) -> None:
    """A finite task that a read has started ends when the last sample has been read."""
    if task.auto_started and run.plan.total is not None and run.read_position >= run.plan.total:
        task.stop()


def _start(task: Task, run: Run) -> int:
    """Position of the first sample to read, by the read attributes."""
    settings = task.reading
    has_ref = run.plan.pretrigger is not None
    default = ReadRelativeTo.FIRST_PRETRIGGER_SAMPLE if has_ref else ReadRelativeTo.CURRENT_READ_POSITION
    relative = ReadRelativeTo(settings.get("RELATIVE_TO", default.value))
    offset = int(settings.get("OFFSET", 0))
    now = task.bench.clock.now()
    if relative is ReadRelativeTo.CURRENT_READ_POSITION:
        start = run.read_position + offset
    elif relative is ReadRelativeTo.FIRST_SAMPLE:
        start = offset
    elif relative is ReadRelativeTo.MOST_RECENT_SAMPLE:
        start = run.readable(now) + offset
    elif not has_ref:
        raise DaqmxError(Code.NO_REF_TRIGGER)
    elif relative is ReadRelativeTo.FIRST_PRETRIGGER_SAMPLE:
        start = run.read_position + offset if "RELATIVE_TO" not in settings else offset
    else:
        start = int(run.plan.pretrigger or 0) + offset
    if start < 0:
        raise DaqmxError(Code.NEGATIVE_SAMPLE)
    if run.plan.total is None and start < run.acquired(now) - run.plan.buffer:
        raise overwritten(f"DAQmx_Val_{_NI_NAMES[relative]}", offset)
    return start


_NI_NAMES = {
    ReadRelativeTo.CURRENT_READ_POSITION: "CurrReadPos",
    ReadRelativeTo.FIRST_SAMPLE: "FirstSample",
    ReadRelativeTo.MOST_RECENT_SAMPLE: "MostRecentSamp",
    ReadRelativeTo.FIRST_PRETRIGGER_SAMPLE: "FirstPretrigSamp",
    ReadRelativeTo.REFERENCE_TRIGGER: "RefTrig",
}


def _on_demand(task: Task, count: int, rows: list[int] | None) -> Reading:
    """Software-timed samples: taken now, one after the other at the module's own pace."""
    task.bench.clock.power_on()
    now = task.bench.clock.glance()
    codes = on_demand_sampler(task, now).codes(0, count)
    task.taken_on_demand += count
    codes = codes if rows is None else codes[rows]
    if task.io == "AI":
        task.overloads.update(task.scan.overloaded(codes, rows))
    if task.auto_started:
        task.stop()
    return Reading(codes, rows, 0, now)
