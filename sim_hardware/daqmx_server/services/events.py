"""Streams of events: every N samples, task done, hardware signal.

Each open stream holds one thread of the server. The initial metadata tells the client that the
registration has been made; until then it does not go on to start the task.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeGuard

from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx.constants import EveryNSamplesEventType, Signal

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.tasks.task import State, Task, task_named
from sim_hardware.daqmx_server.timing.acquisition import Run

_LISTEN_S = 0.25


class EventStream:
    """One registration: lives until the client cancels, unregisters or clears the task."""

    def __init__(self, bench: Bench, request: Any, context: Any, kind: str, already: Code) -> None:
        self.bench = bench
        self.task = task_named(bench, request.task.name)
        if self.task.state is State.RUNNING:
            raise DaqmxError(Code.EVENT_WHILE_RUNNING)
        if kind in self.task.events:
            raise DaqmxError(already)
        self.kind = kind
        self.task.events.add(kind)
        self._context = context
        context.add_callback(self._wake)

    def _wake(self) -> None:
        with self.bench.changed:
            self.bench.changed.notify_all()

    @property
    def open(self) -> bool:
        return self._context.is_active() and not self.task.cleared and self.kind in self.task.events

    def close(self) -> None:
        self.task.events.discard(self.kind)

    def wait_for_run(self) -> bool:
        """Wait until the task runs; False when the stream has ended instead."""
        while self.open and self.task.run is None:
            self.bench.changed.wait(_LISTEN_S)
        return self.open

    def _follows(self, run: Run | None) -> TypeGuard[Run]:
        """Whether the stream is open and that run still goes on."""
        return self.open and run is not None and self.task.run is run and run.failure is None

    def wait_for_count(self, count: int, interval: int) -> bool:
        """Wait until `count` samples have been acquired; False if the run ended before.

        Where time moves with the readers, the samples of the event before must have been read, and a
        sample whose instant a line or another task decides is waited for, not searched for.
        """
        run = self.task.run
        clock = self.bench.clock
        forever = clock.deadline(-1)
        while self._follows(run):
            if run.acquired(clock.now()) >= count:
                return True
            last = run.last_sample()
            unread = self.bench.readers_drive_time and run.read_position < count - interval
            when = run.time_of_count(count)
            others_decide = when is None and run.times is not None and self.bench.readers_drive_time
            if unread or others_decide or (last is not None and last < count):
                self.bench.changed.wait(_LISTEN_S)
            else:
                clock.wait(self.bench.changed, when, forever)
        return False

    def wait_for_end(self, run: Run | None) -> None:
        """Wait until that run makes room for another one or the stream ends."""
        while self.open and run is not None and self.task.run is run:
            self.bench.changed.wait(_LISTEN_S)


def every_n_samples(bench: Bench, request: Any, context: Any) -> Iterator[Any]:
    fields = fields_of(request)
    interval = int(fields["n_samples"])
    kind = fields["every_n_samples_event_type"]
    with bench.changed:
        task = task_named(bench, request.task.name)
        _check_interval(task, interval, kind)
        already = Code.EVERY_N_OUTPUT_REGISTERED if task.is_output else Code.EVERY_N_REGISTERED
        stream = EventStream(bench, request, context, "every_n", already)
    context.send_initial_metadata(())
    event = pb.RegisterEveryNSamplesEventResponse(
        every_n_samples_event_type=kind, every_n_samples_event_type_raw=kind, n_samples=interval
    )
    yield from _repeated(bench, stream, event, interval)


def _repeated(bench: Bench, stream: EventStream, event: Any, interval: int) -> Iterator[Any]:
    """The event at every `interval` counts of each run, until the task goes or nobody listens."""
    try:
        while True:
            with bench.changed:
                if not stream.wait_for_run():
                    return
                run = stream.task.run
            number = 0
            while True:
                with bench.changed:
                    if not stream.wait_for_count((number + 1) * interval, interval):
                        break
                number += 1
                yield event
            with bench.changed:
                stream.wait_for_end(run)
    finally:
        with bench.changed:
            stream.close()


def _check_interval(task: Task, interval: int, kind: int) -> None:
    if interval == 0:
        raise DaqmxError(Code.EVERY_N_ZERO)
    if task.is_output and kind == EveryNSamplesEventType.ACQUIRED_INTO_BUFFER.value:
        raise DaqmxError(Code.EVERY_N_NOT_FOR_OUTPUT)
    if not task.is_output and kind != EveryNSamplesEventType.ACQUIRED_INTO_BUFFER.value:
        raise DaqmxError(Code.EVERY_N_NOT_FOR_INPUT)


def done(bench: Bench, request: Any, context: Any) -> Iterator[Any]:
    with bench.changed:
        stream = EventStream(bench, request, context, "done", Code.DONE_REGISTERED)
    context.send_initial_metadata(())
    clock = bench.clock
    try:
        while True:
            status: int | None = None
            with bench.changed:
                if not stream.wait_for_run():
                    return
                run = stream.task.run
                while stream.open and run is not None and stream.task.run is run and status is None:
                    try:
                        run.check(clock.now())
                        if run.is_done(clock.now()):
                            status = 0
                            break
                    except DaqmxError as error:
                        status = error.code
                        break
                    last = run.last_sample()
                    if bench.readers_drive_time or last is None:
                        bench.changed.wait(_LISTEN_S)
                    else:
                        clock.wait(bench.changed, run.time_of_count(last), clock.deadline(-1))
            if status is not None:
                yield pb.RegisterDoneEventResponse(status=status)
            with bench.changed:
                stream.wait_for_end(run)
    finally:
        with bench.changed:
            stream.close()


def signal(bench: Bench, request: Any, context: Any) -> Iterator[Any]:
    """One event per sample, detected change or pulse; −200987 for a signal that the task does not make."""
    wanted = fields_of(request)["signal_id"]
    with bench.changed:
        task = task_named(bench, request.task.name)
        known = {Signal.SAMPLE_CLOCK.value, Signal.SAMPLE_COMPLETE.value}
        known |= {Signal.CHANGE_DETECTION_EVENT.value} if task.detects_changes else set()
        known |= {Signal.COUNTER_OUTPUT_EVENT.value} if task.io == "CO" else set()
        if wanted not in known:
            raise DaqmxError(Code.SIGNAL_EVENT_UNSUPPORTED)
        stream = EventStream(bench, request, context, f"signal{wanted}", Code.SIGNAL_REGISTERED)
    context.send_initial_metadata(())
    event = pb.RegisterSignalEventResponse(signal_id=wanted)
    yield from _repeated(bench, stream, event, 1)


def unregister(bench: Bench, task_name: str, kind: str) -> None:
    task_named(bench, task_name).events.discard(kind)
    bench.changed.notify_all()


STREAMS = {
    "RegisterEveryNSamplesEvent": every_n_samples,
    "RegisterDoneEvent": done,
    "RegisterSignalEvent": signal,
}
__all__ = ["STREAMS", "unregister"]
