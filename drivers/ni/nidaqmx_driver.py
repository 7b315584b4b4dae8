"""The driver for NI hardware, through the real nidaqmx client: local library or gRPC, same code."""

from __future__ import annotations

import contextlib
import time
import warnings
from pathlib import PurePath

import numpy as np
from nidaqmx import errors as ni_errors

from daq_app.config.planning.plan import TaskPlan
from drivers.ni.clock_line import ClockLine
from drivers.ni.connection import Connection
from drivers.ni.data_sheets import read_data_sheets, read_timing_modes
from drivers.ni.devices import Inspection, check_devices
from drivers.ni.error_advice import has_ended, is_garbled, translate
from drivers.ni.ledger import TaskLedger
from drivers.ni.stream import TaskStream
from drivers.ni.tasks import commit, create_task, log_to_tdms, read_ranges
from drivers.protocol import Block, ClockReading, DataSheet, DeviceInfo, DriverError, Opened

_HOUSEKEEPING_S = 0.08
"""Backlog and overloads are asked for this often: two round trips a task, at each read at the real rate
but not when reads come fast. The position is asked for at every read."""
_REPLY_MARGIN_S = 2.0
"""How much longer than the read's own time-out we wait for the server's reply, and how long for that of the
calls between two reads: one that never comes must be given up long before the device's buffer is full."""
_CATCH_UP_READS = 10
"""Most read periods fetched in one call when samples have piled up."""
_CLOSE_LIMIT_S = 2.0
_MOST_DOUBLINGS = 4
_OVERWRITTEN = -200279


class _OutOfStepError(DriverError):
    """What was just read may belong to other samples than we thought: it is read again, not handed out."""


class NidaqmxDriver:
    """Keeps `drivers.protocol.Driver`. All calls from one thread.

    `backup_folder` switches on the NI driver's own TDMS logging (`start_backup`); `ledger` lets the
    next session clear the tasks that this one leaves on a device server if it is killed; `object_to`
    may refuse devices before a wrong module gives a puzzling error. `clock_speed` is how much faster than
    real time a simulated device runs: the length of a gap is told by this computer's clock.
    """

    def __init__(
        self,
        connection: str,
        *,
        backup_folder: PurePath | None = None,
        ledger: TaskLedger | None = None,
        object_to: Inspection | None = None,
        clock_speed: float = 1.0,
    ) -> None:
        self._connection = Connection(connection)
        self._ledger = ledger if self._connection.is_remote else None
        self._backup_folder = backup_folder
        self._object_to = object_to
        self._plan: TaskPlan | None = None
        self._streams: list[TaskStream] = []
        self._next_sample = 0
        self._origin = 0
        """Number that sample 0 of the running tasks has in the whole stream: they may have been restarted."""
        self._backlog = 0
        self._overloaded: tuple[str, ...] = ()
        self._clock: ClockReading | None = None
        self._clock_speed = clock_speed
        self._line = ClockLine(1.0)
        self._last_housekeeping = 0.0
        self._buffer_samples = 0
        self._in_vain = 0
        """Recoveries since the last read that succeeded, at each of which samples had been overwritten."""
        self._garbled = False
        """Whether the last recovery met a reply that could not be understood."""
        self._rate_hz = 0.0
        self._backup_stem = ""
        self._data_sheets: dict[str, DataSheet] | None = None

    def open(self, plan: TaskPlan) -> Opened:
        """Reserve and commit the tasks. Raises `DriverError`, leaving nothing reserved."""
        self._plan = plan
        opened = self._make_tasks(plan)
        self._rate_hz = opened.rate_hz
        return opened

    def _make_tasks(self, plan: TaskPlan) -> Opened:
        self._connection.limit_calls_to()
        try:
            devices = check_devices(self._connection, plan, self._object_to)
            self._clear_what_was_left(plan)
            if self._data_sheets is None:  # a recovery loses no time with sensors that have not changed
                self._data_sheets = read_data_sheets(self._connection.system(), plan)
            for planned in plan.tasks:
                self._streams.append(TaskStream(planned, create_task(self._connection, planned)))
            for stream in self._streams:
                if self._backup_folder is not None:
                    log_to_tdms(stream.task, self._backup_folder / f"{stream.planned.name}-session.tdms")
                commit(stream.task)
            return self._read_back(devices)
        except Exception as error:
            self._close_tasks()
            raise translate(error, doing="opening the tasks") from error

    def _clear_what_was_left(self, plan: TaskPlan) -> None:
        """Clear the tasks of a session of ours that was killed: they hold the hardware."""
        if self._ledger is None:
            return
        target = str(self._connection.target)
        for name in self._ledger.left_behind(target):
            with contextlib.suppress(Exception):  # a server that was restarted has none of them
                self._connection.attach_by_full_name(name).close()
        self._ledger.opening(target, [self._connection.full_name(task.name) for task in plan.tasks])

    def _read_back(self, devices: tuple[DeviceInfo, ...]) -> Opened:
        rates = [float(stream.task.timing.samp_clk_rate) for stream in self._streams]
        if max(rates) - min(rates) > 1e-9 * max(rates):
            listed = ", ".join(
                f"{stream.planned.name} {rate:g} Hz"
                for stream, rate in zip(self._streams, rates, strict=True)
            )
            raise DriverError(
                f"The hardware gives the tasks different rates: {listed}",
                advice="Take a rate that every module has (`daq-app config show` lists them)",
            )
        ranges: dict[str, tuple[float, float]] = {}
        for stream in self._streams:
            ranges |= read_ranges(stream.task, stream.planned)
        self._buffer_samples = min(int(stream.task.in_stream.input_buf_size) for stream in self._streams)
        return Opened(
            rate_hz=rates[0],
            ranges=ranges,
            buffer_samples=self._buffer_samples,
            devices=devices,
            driver=self._connection.versions(),
            adc_timing=read_timing_modes((stream.task, stream.planned) for stream in self._streams),
            data_sheets=self._data_sheets or {},
        )

    def start(self) -> None:
        """Start the clock: slaves armed first, the master last."""
        self._start_tasks()
        self._next_sample = self._origin = 0
        self._line = ClockLine(self._rate_hz * self._clock_speed)

    def _start_tasks(self) -> None:
        by_role = sorted(self._streams, key=lambda stream: stream.planned.role == "master")
        self._connection.limit_calls_to()
        try:
            for stream in by_role:
                stream.begin()
                stream.task.start()
        except Exception as error:
            self.stop()
            raise translate(error, doing="starting the tasks") from error
        self._backlog = 0
        self._last_housekeeping = time.monotonic()

    def read(self, timeout_s: float, n_samples: int | None = None) -> Block:
        """See the protocol. Blocks up to `timeout_s` for every task together."""
        plan = self._opened_plan()
        wanted = self._read_size(plan, n_samples)
        deadline = time.monotonic() + timeout_s
        try:
            for stream in self._streams:
                left = max(0.0, deadline - time.monotonic())
                self._connection.limit_calls_to(left + _REPLY_MARGIN_S)
                stream.fill(wanted, left)
            self._connection.limit_calls_to(_REPLY_MARGIN_S)
            self._check_positions()
            self._housekeeping()
        except Exception as error:
            out_of_step = isinstance(error, _OutOfStepError)
            partial = None if out_of_step else self._block(min(s.n_pending for s in self._streams))
            raise translate(error, doing="reading", partial=partial) from error
        block = self._block(wanted)
        assert block is not None
        self._in_vain = 0
        return block

    def _read_size(self, plan: TaskPlan, asked: int | None) -> int:
        """What was asked for, or whole read periods where samples have piled up."""
        waiting = self._backlog // plan.read_samples
        if waiting == 0 and asked is not None:
            return asked
        return min(_CATCH_UP_READS, max(1, waiting)) * plan.read_samples

    def _block(self, n_samples: int) -> Block | None:
        """The next `n_samples` of all tasks as one rectangle; None for no samples."""
        if n_samples == 0:
            return None
        plan = self._opened_plan()
        if len(self._streams) == 1 and np.array_equal(self._streams[0].rows, np.arange(plan.n_channels)):
            readings = self._streams[0].take(n_samples)
        else:
            readings = np.empty((plan.n_channels, n_samples))
            for stream in self._streams:
                readings[stream.rows] = stream.take(n_samples)
        block = Block(
            first_sample=self._next_sample,
            readings=readings,
            read_time_ns=time.time_ns(),
            backlog_samples=self._backlog,
            overloaded=self._overloaded,
            clock=self._clock,
        )
        self._overloaded = ()
        self._clock = None
        self._next_sample += n_samples
        self._backlog = max(0, self._backlog - n_samples)
        return block

    def _check_positions(self) -> None:
        """Raise unless what has just been read is what followed: replies can be lost or exchanged."""
        for stream in self._streams:
            at = stream.device_position()
            if at != stream.position:
                raise _OutOfStepError(
                    f"The device stands at sample {at} where {stream.position} was expected",
                    advice="Reading goes on at the right sample; if it happens often, restart the server",
                    recoverable=True,
                )

    def _housekeeping(self) -> None:
        now = time.monotonic()
        if now - self._last_housekeeping < _HOUSEKEEPING_S:
            return
        self._last_housekeeping = now
        overloaded: list[str] = []
        backlog = []
        for stream in self._streams:
            before = time.monotonic()
            total = stream.total_acquired()
            if stream.planned.role == "master":
                self._clock = ClockReading(before, time.monotonic(), self._origin + total)
                self._line.add(self._clock)
            backlog.append(total - stream.position)
            overloaded.extend(stream.overloaded())
        # Counted before this read's block is handed out, so that `_block` subtracts it once.
        self._backlog = max(backlog) + min(stream.n_pending for stream in self._streams)
        self._overloaded = tuple(overloaded)

    def recover(self) -> str:
        """See the protocol: same tasks over a new socket, or the same plan started again."""
        if self._plan is None:
            raise DriverError("The tasks are not open", advice="Open the hardware first")
        try:
            self._connection.limit_calls_to()
            if self._connection.is_remote:
                self._connection.reconnect()
            if self._tasks_run_on():
                return self._go_on_in_the_buffer(self._plan)
        except Exception as error:
            raise translate(error, doing="taking up reading again") from error
        return self._start_again(self._plan)

    def _tasks_run_on(self) -> bool:
        """Whether the tasks still sample; false where device or server have dropped them."""
        try:
            for stream in self._streams:
                if self._connection.is_remote:
                    stream.attach(self._connection.attach_task(stream.planned.name))
                if stream.task.is_task_done():
                    return False
        except ni_errors.Error as error:
            # Tasks that still hold samples must not be cleared for one damaged reply; two are an answer.
            self._garbled, garbled_before = is_garbled(error), self._garbled
            if has_ended(error) and (garbled_before or not self._garbled):
                return False
            if isinstance(error, ni_errors.DaqError) and int(error.error_code) == _OVERWRITTEN:
                return False  # a task that must not overwrite has stopped before its full buffer
            raise
        self._garbled = False
        return bool(self._streams)

    def _go_on_in_the_buffer(self, plan: TaskPlan) -> str:
        """Read on where reading stood, or at the oldest sample there is; says so where some are gone."""
        # The oldest samples are being overwritten while we ask for them: leave a margin, and a larger one
        # each time that it was too small, since this computer or the way to the device is slow.
        margin = max(2 * plan.read_samples, self._buffer_samples // 20) << self._in_vain
        margin = min(margin, self._buffer_samples // 2)
        oldest = max(stream.total_acquired() for stream in self._streams) - self._buffer_samples + margin
        position = asked = max(self._next_sample - self._origin, oldest)
        for _ in self._streams:  # one that cannot go back takes the others along
            position = max(stream.seek(position, _REPLY_MARGIN_S) for stream in self._streams)
        overwritten = self._origin + position > self._next_sample
        self._next_sample = self._origin + position
        self._last_housekeeping = time.monotonic()
        if not overwritten:
            return ""
        if position > asked:
            return "What the lost reply held cannot be asked for again while NI-DAQmx writes its own files"
        self._in_vain = min(self._in_vain + 1, _MOST_DOUBLINGS)
        kept_s = self._buffer_samples / self._rate_hz
        return f"The device's buffer holds {kept_s:.0f} s: older samples had been overwritten"

    def _start_again(self, plan: TaskPlan) -> str:
        """New tasks in place of those that have ended; their samples take their place by the clock."""
        self._close_tasks()
        try:
            opened = self._make_tasks(plan)
            if opened.rate_hz != self._rate_hz:
                self._close_tasks()
                raise DriverError(
                    f"The hardware came back with {opened.rate_hz:g} Hz where it had {self._rate_hz:g} Hz",
                    advice="What had been read is saved. Check the modules, then start the acquisition again",
                )
            before = time.monotonic()
            self._start_tasks()
            after = time.monotonic()
        except DriverError as error:
            # Hardware that is away today may be back in a second; who waits for it sets the limit.
            error.recoverable = error.recoverable or error.code is not None
            raise
        estimate = self._line.sample_at(before, after)
        index, uncertain_s = (self._next_sample, 0.0) if estimate is None else estimate
        self._origin = self._next_sample = max(index, self._next_sample)
        remark = (
            "The tasks were started again; the length of the gap, and with it every later time, is known "
            f"to {1e3 * uncertain_s:.1f} ms"
        )
        if self._backup_stem:
            self.start_backup(f"{self._backup_stem}-from-{self._origin}")
        return remark

    def start_backup(self, stem: str) -> tuple[str, ...]:
        """Begin one TDMS file per task, written by the NI driver itself; answers the paths.

        Empty where no `backup_folder` was given. Raises `DriverError`.
        """
        if self._backup_folder is None:
            return ()
        self._backup_stem = stem.partition("-from-")[0]
        self._connection.limit_calls_to()
        paths = []
        try:
            for stream in self._streams:
                path = self._backup_folder / f"{stem}-{stream.planned.name}.tdms"
                stream.task.in_stream.start_new_file(path)
                stream.task.in_stream.logging_pause = False
                paths.append(str(path))
        except Exception as error:
            raise translate(error, doing="starting the second recorder") from error
        return tuple(paths)

    def stop_backup(self) -> None:
        """Pause the NI driver's own recording until the next test."""
        self._backup_stem = ""
        if self._backup_folder is None:
            return
        self._connection.limit_calls_to()
        try:
            for stream in self._streams:
                stream.task.in_stream.logging_pause = True
        except Exception as error:
            raise translate(error, doing="stopping the second recorder") from error

    def stop(self) -> None:
        """Stop the clock: the master first, so that the slaves get no further edge."""
        self._connection.limit_calls_to(_CLOSE_LIMIT_S)
        for stream in sorted(self._streams, key=lambda stream: stream.planned.role != "master"):
            with contextlib.suppress(Exception), warnings.catch_warnings():
                # NI warns that a continuous task was stopped before it was done: that is what stopping is.
                warnings.simplefilter("ignore", ni_errors.DaqWarning)
                stream.task.stop()

    def close(self) -> None:
        """Give the hardware back. Safe at any time and twice; a server that is gone does not hold it up."""
        self._close_tasks()
        self._connection.close()

    def _close_tasks(self) -> None:
        self._connection.limit_calls_to(_CLOSE_LIMIT_S)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ni_errors.DaqWarning)
            for stream in self._streams:
                self._clear(stream)
        if self._ledger is not None and self._streams:
            self._ledger.closed()
        self._streams = []

    def _clear(self, stream: TaskStream) -> None:
        """Clear the task. One that is left on a device server keeps its reservation for ever, so a task
        whose way was cut is looked for once more."""
        try:
            stream.task.close()
        except Exception:
            if self._connection.is_remote:
                with contextlib.suppress(Exception):
                    self._connection.attach_task(stream.planned.name).close()

    def _opened_plan(self) -> TaskPlan:
        if self._plan is None or not self._streams:
            raise DriverError("The tasks are not open", advice="Open the hardware first")
        return self._plan
