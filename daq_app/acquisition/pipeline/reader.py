"""The reader thread: owns the driver, reads, and does nothing else.

It mends what can be mended without a new start (time-outs, samples overwritten, a network that was
away) and says where samples are lost; everything else ends the stream with the error.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final, Literal

from daq_app.acquisition.messages.items import Arrived, Item, Lost, Noted, SourceEnded, Started
from daq_app.acquisition.messages.published import EventMessage
from daq_app.acquisition.pipeline.clock_watch import ClockWatch
from daq_app.config.planning.plan import TaskPlan
from drivers import Block, Driver, DriverError

SILENCE_S: Final = 0.8
"""Looked at five times a second: the operator hears of it within one second."""
_OVERDUE_S: Final = 0.4
"""Several read periods: from then on a read that has found nothing is told."""
_READ_TIMEOUT_S: Final = 0.5
_PERIODS_IN_VAIN: Final = 5
_QUICK_READ_S: Final = 0.02
"""Read period while the wall moves: r must not wait for the end of a long block."""
_STUCK_RECOVERIES: Final = 20
"""So many recoveries in a row without one sample between them will not help any more."""


@dataclass(frozen=True, slots=True)
class Patience:
    """How long the reader waits before it gives a test up."""

    read_timeout_s: float | None = None
    """Limit of one read; None: five read periods, half a second at least. A stop is obeyed after it."""
    silence_limit_s: float = 30.0
    """Limit without any sample, though the device answers."""
    reconnect_limit_s: float = 30.0
    """Without any answer of the device."""
    retry_pause_s: float = 0.2


class Reader(threading.Thread):
    """Feeds `sink` with Started, Arrived, Lost, Noted and, at the end, SourceEnded."""

    def __init__(
        self,
        make_driver: Callable[[], Driver],
        plan: TaskPlan,
        sink: Callable[[Item], None],
        patience: Patience | None = None,
        speed: float = 1.0,
        saving: Callable[[], bool] = lambda: False,
    ) -> None:
        """`speed` is how much faster than real time a simulated device or a replay runs.

        A device whose time moves with the reads (infinite) is read at the real rate while `saving`: the
        processor belongs to the run that is being saved.
        """
        super().__init__(name="reader", daemon=True)
        self._speed = speed
        self._saving = saving
        self._clock_watch: ClockWatch | None = None
        self._overdue = False
        self._make_driver = make_driver
        self._plan = plan
        self._sink = sink
        self._patience = patience or Patience()
        self._read_timeout_s = self._patience.read_timeout_s or max(
            _READ_TIMEOUT_S, _PERIODS_IN_VAIN * plan.read_samples / plan.rate_hz
        )
        self._stop_asked = threading.Event()
        self._requests: queue.SimpleQueue[tuple[Callable[[Driver], Any], Future[Any]]] = queue.SimpleQueue()
        self._quick_samples = plan.read_samples
        if math.isfinite(speed):
            quick = max(1, round(_QUICK_READ_S * plan.rate_hz * speed))
            self._quick_samples = min(plan.read_samples, quick)
        self._at_once: int | None = None
        self._next_sample = 0
        self._recoveries = 0
        self._loss_reason = "samples never arrived"
        self._last_arrival_s = time.monotonic()
        self.opening = True
        """The device is being opened and started; a simulated one takes its time."""
        self.backlog_samples = 0
        """Samples per channel that waited in the device's buffer after the last read."""
        self.buffer_samples = 0

    @property
    def next_sample(self) -> int:
        """Samples per channel read, gaps counted."""
        return self._next_sample

    @property
    def silent_for_s(self) -> float:
        """Since the last samples came."""
        return time.monotonic() - self._last_arrival_s

    @property
    def silent(self) -> bool:
        """Whether the device runs, and no samples have come for so long that the operator must hear of it."""
        return self.is_alive() and self.buffer_samples > 0 and self.silent_for_s > SILENCE_S

    def ask(self, call: Callable[[Driver], Any]) -> Future[Any]:
        """Have `call(driver)` made between two reads, on the driver's own thread."""
        done: Future[Any] = Future()
        self._requests.put((call, done))
        return done

    def hurry(self, quickly: bool) -> None:
        """From the next read on: short reads for the motion, or those of the plan."""
        self._at_once = self._quick_samples if quickly else None

    def request_stop(self) -> None:
        """End after the read that is under way."""
        self._stop_asked.set()

    def run(self) -> None:
        """Open, start, read until told to stop or until it cannot go on."""
        error: DriverError | None = None
        driver: Driver | None = None
        try:
            driver = self._make_driver()
            opened = driver.open(self._plan)
            self.buffer_samples = opened.buffer_samples
            driver.start()
            self._last_arrival_s = time.monotonic()
            if math.isfinite(self._speed):
                self._clock_watch = ClockWatch(opened.rate_hz, self._speed)
            self._sink(Started(opened))
            self.opening = False
            self._read_on(driver)
        except DriverError as caught:
            error = caught
        except Exception as caught:  # a fault of ours must end in a saved run, too
            error = DriverError(
                f"The reader failed ({type(caught).__name__}: {caught})",
                advice="What had been read is saved. Please report this with the log",
            )
        finally:
            if driver is not None:
                _close(driver)
            self._fail_requests()
            self.opening = False
            self._sink(SourceEnded(error))

    def _read_on(self, driver: Driver) -> None:
        while not self._stop_asked.is_set():
            self._serve_requests(driver)
            try:
                block = driver.read(self._read_timeout_s, self._at_once)
            except DriverError as error:
                self._after(error, driver)
            else:
                self._recoveries = 0
                self._overdue = False
                self._deliver(block)
                if math.isinf(self._speed) and self._saving():
                    self._stop_asked.wait(block.n_samples / self._plan.rate_hz)

    def _deliver(self, block: Block) -> None:
        now = time.perf_counter()
        lost = block.first_sample - self._next_sample
        if lost > 0:
            self._sink(Lost(self._next_sample, lost, self._loss_reason))
        self._next_sample = block.first_sample + block.n_samples
        self.backlog_samples = block.backlog_samples
        self._last_arrival_s = time.monotonic()
        self._sink(Arrived(block, now))
        if block.clock is not None and self._clock_watch is not None:
            news = self._clock_watch.take(block.clock)
            if news is not None:
                self._note(
                    "warning", news.text, "clock", news.sample, {"clock": news.name, "value": news.value}
                )

    def _after(self, error: DriverError, driver: Driver) -> None:
        """Keep what was read, then wait, mend, or raise."""
        if error.partial is not None:
            self._deliver(error.partial)
        if error.retryable:
            if not self._overdue and (error.partial is not None or self.silent_for_s > _OVERDUE_S):
                self._overdue = True
                self._note("warning", str(error))
            if self.silent_for_s > self._patience.silence_limit_s:
                raise DriverError(
                    f"No samples for {self.silent_for_s:.0f} s: {error.message}",
                    advice="Check the chassis and the line of the sample clock, then start again",
                    code=error.code,
                    device=error.device,
                ) from error
            return
        if not error.recoverable:
            raise error
        self._recoveries += 1
        if self._recoveries > _STUCK_RECOVERIES:
            raise error
        self._mend(error, driver)

    def _mend(self, error: DriverError, driver: Driver) -> None:
        self._loss_reason = error.message
        self._note("warning", f"{error}")
        since = time.monotonic()
        while not self._stop_asked.is_set():
            try:
                remark = driver.recover()
            except DriverError as again:
                if not again.recoverable:
                    raise
                if time.monotonic() - since > self._patience.reconnect_limit_s:
                    raise DriverError(
                        f"No answer for {self._patience.reconnect_limit_s:.0f} s: {again.message}",
                        advice=again.advice,
                        code=again.code,
                        device=again.device,
                    ) from again
                self._stop_asked.wait(self._patience.retry_pause_s)
            else:
                away = time.monotonic() - since
                self._note("info", f"Reading goes on after {away:.1f} s. {remark or ''}".strip())
                if remark:
                    self._loss_reason = f"{error.message}. {remark}"
                    if self._clock_watch is not None:
                        self._clock_watch.restart()
                return

    def _note(
        self,
        severity: Literal["info", "warning"],
        text: str,
        kind: str = "driver",
        sample: int | None = None,
        data: dict[str, float | str] | None = None,
    ) -> None:
        at = self._next_sample if sample is None else sample
        event = EventMessage(kind=kind, sample=at, text=text, severity=severity, data=data or {})
        self._sink(Noted(event))

    def _serve_requests(self, driver: Driver) -> None:
        while True:
            try:
                call, done = self._requests.get_nowait()
            except queue.Empty:
                return
            try:
                done.set_result(call(driver))
            except Exception as error:
                done.set_exception(error)

    def _fail_requests(self) -> None:
        while True:
            try:
                _, done = self._requests.get_nowait()
            except queue.Empty:
                return
            done.set_exception(DriverError("The acquisition has stopped", advice="Start it again"))


def _close(driver: Driver) -> None:
    """Stop and close; a device that is gone must not keep us from saving."""
    for call in (driver.stop, driver.close):
        try:
            call()
        except Exception:
            continue
