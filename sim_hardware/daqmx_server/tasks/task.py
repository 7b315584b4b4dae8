"""A task: NI's states, and the run while it goes on."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
from nidaqmx.constants import TaskMode
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.tasks.checks import check_configuration
from sim_hardware.daqmx_server.tasks.needs import resources_of
from sim_hardware.daqmx_server.tasks.runs import make_run, trigger_readings
from sim_hardware.daqmx_server.tasks.samplers import (
    on_demand_sampler,
    play,
    sampler_of,
    stop_playing,
)
from sim_hardware.daqmx_server.tasks.settings import TaskSettings
from sim_hardware.daqmx_server.timing.acquisition import Run
from sim_hardware.daqmx_server.timing.routing import drives, edges_of
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
from sim_hardware.daqmx_server.timing.sampling import BlockSource
from sim_hardware.daqmx_server.timing.scan import Scan
from sim_hardware.daqmx_server.timing.task_timing import TaskTiming


class State(IntEnum):
    """NI's task states, in order."""

    UNVERIFIED = 0
    VERIFIED = 1
    RESERVED = 2
    COMMITTED = 3
    RUNNING = 4


class Task(TaskSettings):
    """Everything a client can do with one task, but the reading itself (`tasks.reading`)."""

    def __init__(self, bench: Bench, name: str) -> None:
        super().__init__(bench, name)
        self.timing = TaskTiming(self)
        self.taken_on_demand = 0
        """Software-timed samples so far."""
        self.state = State.UNVERIFIED
        self.run: Run | None = None
        self.auto_started = False
        self.overloads: set[str] = set()
        self.overloads_reported: tuple[str, ...] = ()
        self.events: set[str] = set()
        self.cleared = False
        self._stale = True
        self.exchange: int | None = None
        self.resume: int | None = None
        self._explicit = State.UNVERIFIED
        self._scan: Scan | None = None
        self.armed_s = 0.0
        """Instant of the last start."""

    # --- configuration ------------------------------------------------------------------------

    def configure(self) -> None:
        """Before any change of settings: not while running, and what was verified is so no more."""
        if self.state is State.RUNNING:
            raise DaqmxError(Code.PROPERTY_WHILE_RUNNING)
        self._scan = None
        self._stale = True

    def add_channels(self, channels: list[VirtualChannel]) -> None:
        if self.state is State.RUNNING:
            raise DaqmxError(Code.TASK_RUNNING)
        self.unreserve()
        self._scan = None
        self._stale = True
        self.channels += channels

    # --- states -------------------------------------------------------------------------------

    @property
    def is_reserved(self) -> bool:
        """Whether the task holds its devices, and so may drive their lines."""
        return self.state >= State.RESERVED

    def control(self, action: int) -> None:
        """NI's TaskControl."""
        mode = TaskMode(action)
        if mode is TaskMode.TASK_START:
            self.start()
        elif mode is TaskMode.TASK_STOP:
            self.stop()
        elif mode is TaskMode.TASK_ABORT:
            self.abort()
        elif mode is TaskMode.TASK_UNRESERVE:
            self.unreserve()
        else:
            target = {
                TaskMode.TASK_VERIFY: State.VERIFIED,
                TaskMode.TASK_RESERVE: State.RESERVED,
                TaskMode.TASK_COMMIT: State.COMMITTED,
            }[mode]
            self.advance(target)
            self._explicit = max(self._explicit, target)

    def advance(self, target: State) -> None:
        """Go through the states up to the target, none left out."""
        if target >= State.VERIFIED and (self._stale or self.state < State.VERIFIED):
            check_configuration(self)
            self._stale = False
            self.state = max(self.state, State.VERIFIED)
        if target >= State.RESERVED and self.state < State.RESERVED:
            self.check_devices()
            self.bench.reserve(resources_of(self.channels), self.name, self.io == "AI" and self.is_buffered)
            self.state = State.RESERVED
        if target >= State.COMMITTED and self.state < State.COMMITTED:
            self.state = State.COMMITTED

    def check_devices(self) -> None:
        """Raise if a device of the task has gone; a run that loses one has failed for good."""
        try:
            for device in {channel.device.name: channel.device for channel in self.channels}.values():
                self.bench.check_access(device)
            if self.run is not None and self.bench.faults.active("onboard_overflow", *self.hosts):
                raise DaqmxError(Code.FIFO_OVERFLOW)
        except DaqmxError as error:
            if self.run is not None and self.run.failure is None:
                self.run.failure = error
            raise

    def start(self) -> None:
        if self.state is State.RUNNING:
            raise DaqmxError(Code.TASK_RUNNING)
        try:
            self.advance(State.COMMITTED)
            if self.is_buffered:
                self._set_running()
            elif self.is_output:
                self.bench.clock.power_on()
            else:
                self.armed_s = self.bench.clock.power_on()
        except DaqmxError:
            self._fall_back(self._explicit)
            raise
        self.state = State.RUNNING
        self.auto_started = False
        self.bench.changed.notify_all()

    def _set_running(self) -> None:
        # A task that waits for another one's clock or edge does not set the world going by itself.
        clock = self.bench.clock
        self.armed_s = clock.now() if self.timing.waits_for_others else clock.power_on()
        self.generation.written_before_start = self.generation.written
        self.run = make_run(self, self.armed_s)
        self.run.look(clock.now())
        if self.io in ("AO", "DO"):
            play(self, self.run)

    def stop(self) -> None:
        """Back to the state the client had put the task into before the start."""
        if self.state is not State.RUNNING:
            return
        if self.run is not None:
            self.look()
            now = self.bench.clock.now()
            last = self.run.last_sample()
            ended = now if last is None else self.run.time_of_count(last)
            for other in tasks_of(self.bench):
                if other is not self and other.run is not None and other.timing.source_task() is self:
                    other.run.look(now)  # what this clock has clocked so far counts, even if nobody looked
                    other.run.halt(now if ended is None else min(now, ended))
            self.run.aborted = True
            if self.io in ("AO", "DO"):
                stop_playing(self, now)
        self.log.close()
        self.run = None
        self._fall_back(self._explicit)
        self.bench.changed.notify_all()

    def abort(self) -> None:
        self.stop()
        self.unreserve()

    def unreserve(self) -> None:
        """Give the devices back; settings stay."""
        if self.state is State.RUNNING:
            raise DaqmxError(Code.TASK_RUNNING)
        self._explicit = State.UNVERIFIED
        self._fall_back(State.UNVERIFIED)

    def clear(self) -> None:
        self.abort()
        self.cleared = True
        self.bench.changed.notify_all()

    def _fall_back(self, state: State) -> None:
        if state < State.RESERVED:
            self.bench.release(self.name)
            state = State.UNVERIFIED
        self.state = state

    def is_done(self) -> bool:
        """Nothing (more) is being acquired; raises the failure that ended the run."""
        if self.state is not State.RUNNING or self.run is None:
            return True
        now = self.bench.clock.glance()
        self.look()
        self.run.check(now)
        return self.run.is_done(now)

    def wait_until_done(self, timeout_s: float) -> None:
        """−200560 where the time was too short."""
        clock = self.bench.clock
        deadline = clock.deadline(timeout_s)
        while not self.is_done():
            run = self.run
            last = run.last_sample() if run is not None else None
            target = run.time_of_count(last) if run is not None and last is not None else None
            if not clock.wait(self.bench.changed, target, deadline):
                if self.is_done():
                    return
                raise DaqmxError(Code.NOT_DONE)

    # --- the run ------------------------------------------------------------------------------

    def live_value(self, channel: VirtualChannel, name: str) -> Any:
        """Value of an attribute that the running hardware decides; None for the others."""
        if name == "CO_PULSE_DONE":
            return self.run is None or self.run.is_done(self.bench.clock.glance())
        if name == "CI_COUNT" and self.state is not State.RUNNING:
            return int(channel.attributes.get("CI_COUNT_EDGES_INITIAL_CNT", 0))
        if name == "CI_COUNT" and self.run is None:
            return int(on_demand_sampler(self, self.bench.clock.glance()).codes(0, 1)[0, 0])
        return None

    def edges_at(self, terminal: str) -> list[float]:
        """Instants of the task's edges at a (plain) terminal, as far as they have happened."""
        return edges_of(self, terminal)

    def drives(self, terminal: str) -> bool:
        """Whether the task is set to give edges at a (plain) terminal."""
        return drives(self, terminal)

    def disturbed(self) -> None:
        """The world or its faults have changed: samples ahead of now are made afresh."""
        if self.run is None:
            return
        self.run.start_rule.disturbed()
        if self.run.times is not None:
            self.run.retime(self.timing.retimed(self.run.times))

    @property
    def scan(self) -> Scan:
        """Converters, instants and scaling of the channels."""
        if self._scan is None:
            self._scan = Scan(self.timing.inputs, self.timing.time_offsets_s())
        return self._scan

    def make_sampler(self, times: SampleTimes) -> BlockSource:
        """Samples of the task's channels, whatever they measure, by that clock."""
        return sampler_of(self, times)

    def trigger_readings(
        self, sampler: BlockSource, source: str, start: int, stop: int
    ) -> NDArray[np.float64]:
        """Readings of the channel an analogue trigger listens to."""
        return trigger_readings(self, sampler, source, start, stop)

    def look(self) -> None:
        """Find out what has happened by now; a recorder in the mode Log takes what has come."""
        run = self.run
        if run is None:
            return
        now = self.bench.clock.now()
        run.look(now)
        if not self.log.takes_samples or run.aborted or run.failure is not None:
            return
        count = run.available(now)
        if count:
            self.log_read(run.block(run.read_position, count), None, run.read_position)
            run.read_position += count

    def log_read(self, codes: NDArray[Any], rows: list[int] | None, first: int) -> None:
        """Give a block that has been read to DAQmx's own recorder, if that is on."""
        if self.log.enabled and codes.shape[1]:
            assert self.run is not None and self.run.times is not None
            chosen = self.channels if rows is None else [self.channels[row] for row in rows]
            self.log.write(
                [channel.name for channel in chosen],
                [channel.unit_name for channel in chosen],
                self.scan.readings(codes, rows),
                first,
                self.timing.rate_hz,
                self.bench.utc(self.run.times.first_s),
            )


def tasks_of(bench: Bench) -> list[Task]:
    """All tasks of the bench."""
    return [task for task in bench.tasks.values() if isinstance(task, Task)]


def task_named(bench: Bench, name: str) -> Task:
    """−200088 for a name that no task has."""
    task = bench.tasks.get(name)
    if not isinstance(task, Task):
        raise DaqmxError(Code.INVALID_TASK, f"Task Name: {name}")
    return task
