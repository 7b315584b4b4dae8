"""A recorded run played back as if it came from the hardware, at any speed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from daq_app.config.planning.plan import TaskPlan
from drivers.protocol import Block, DriverError, Opened


class Recording(Protocol):
    """What the replay needs of a run: the run file's reader keeps this without knowing of it."""

    @property
    def channel_ids(self) -> tuple[str, ...]:
        """Row order of `readings`."""
        ...

    @property
    def rate_hz(self) -> float: ...

    @property
    def n_samples(self) -> int: ...

    def readings(
        self, ids: tuple[str, ...] | None = None, start: int = 0, stop: int | None = None
    ) -> NDArray[np.float64]:
        """(n_channels, stop − start) readings; NaN where samples were lost."""
        ...


class ReplayDriver:
    """Keeps `drivers.protocol.Driver`. Samples appear at `speed` × the recorded rate.

    Gaps of the recording are skipped as gaps: the block after one begins beyond it. At the end
    of the recording `read` raises a `DriverError` that is neither retryable nor recoverable.
    """

    def __init__(
        self,
        recording: Recording,
        speed: float = 1.0,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not speed > 0:
            raise ValueError(f"speed must be positive, not {speed}")
        self._recording = recording
        self._speed = speed
        self._clock = clock
        self._sleep = sleep
        self._plan: TaskPlan | None = None
        self._started_s: float | None = None
        self._next = 0

    def open(self, plan: TaskPlan) -> Opened:
        """Check that the recording holds the plan's channels."""
        missing = [name for name in plan.channel_ids if name not in self._recording.channel_ids]
        if missing:
            raise DriverError(
                f"The recording lacks {len(missing)} of the rig's channels: {', '.join(missing)}",
                advice="Replay it with the rig file it was recorded with (it is inside the run file)",
            )
        self._plan = plan
        self._next = 0
        channels = {item.channel.id: item.channel for task in plan.tasks for item in task.channels}
        return Opened(
            rate_hz=self._recording.rate_hz,
            ranges={
                name: channel.range_si if channel.scaled_by_driver else channel.input_range_v
                for name, channel in channels.items()
            },
            buffer_samples=self._recording.n_samples,
            devices=(),
            driver=f"replay at {self._speed:g} × real time",
        )

    def start(self) -> None:
        """Start the clock at the recording's first sample."""
        self._opened()
        self._started_s = self._clock()
        self._next = 0

    def read(self, timeout_s: float, n_samples: int | None = None) -> Block:
        """See the protocol: waits until the samples are due."""
        plan = self._opened()
        if self._started_s is None:
            raise DriverError("The replay has not been started", advice="Start it first")
        if self._next >= self._recording.n_samples:
            raise DriverError("The recording has ended", advice="Start the replay again, or stop")
        wanted = plan.read_samples if n_samples is None else n_samples
        stop = min(self._next + wanted, self._recording.n_samples)
        self._wait_for(stop, timeout_s)
        readings = self._recording.readings(plan.channel_ids, self._next, stop)
        present = np.asarray(~np.isnan(readings).any(axis=0), dtype=np.bool_)
        if not present.any():
            self._next = stop
            return self.read(timeout_s, n_samples)
        # One block is one unbroken piece: up to the first gap, after any gap at its beginning.
        first = int(np.argmax(present))
        broken = np.flatnonzero(~present[first:])
        length = int(broken[0]) if broken.size else present.size - first
        block = Block(
            first_sample=self._next + first,
            readings=np.ascontiguousarray(readings[:, first : first + length], dtype=np.float64),
            read_time_ns=time.time_ns(),
            backlog_samples=max(0, self._due() - self._next - first - length),
        )
        self._next += first + length
        return block

    def _due(self) -> int:
        """Samples that the clock has reached."""
        assert self._started_s is not None
        elapsed = (self._clock() - self._started_s) * self._speed
        return min(self._recording.n_samples, int(elapsed * self._recording.rate_hz))

    def _wait_for(self, stop: int, timeout_s: float) -> None:
        assert self._started_s is not None
        due_s = self._started_s + stop / self._recording.rate_hz / self._speed
        wait = due_s - self._clock()
        if wait > timeout_s:
            self._sleep(max(0.0, timeout_s))
            raise DriverError(
                "No new samples arrived in time", advice="The read is tried again", retryable=True
            )
        if wait > 0:
            self._sleep(wait)

    def recover(self) -> str:
        """Nothing breaks that could be mended: does nothing."""
        return ""

    def stop(self) -> None:
        """Stop the clock."""
        self._started_s = None

    def close(self) -> None:
        """Forget the plan."""
        self._started_s = None
        self._plan = None

    def _opened(self) -> TaskPlan:
        if self._plan is None:
            raise DriverError("The replay is not open", advice="Open it first")
        return self._plan
