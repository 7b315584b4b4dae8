"""One run of a task, from its start to its stop: which samples exist, and which may be read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
from sim_hardware.daqmx_server.timing.sampling import BlockSource
from sim_hardware.daqmx_server.timing.triggers import CrossingSearch


@dataclass(frozen=True, slots=True)
class RunPlan:
    """What a task settles when it starts."""

    rate_hz: float
    total: int | None
    """Samples per channel of a finite acquisition."""
    pretrigger: int | None
    """Samples before the reference trigger, where there is one."""
    buffer: int
    overwrite: bool
    instant: bool
    """Finite acquisitions are complete as soon as they are triggered (NI's own simulated devices)."""


class StartRule(Protocol):
    """Answers, once it is known, when the first sample is taken."""

    def __call__(self, now_s: float) -> SampleTimes | None: ...

    def again(self, times: SampleTimes, now_s: float) -> SampleTimes | None:
        """The clock with the samples of a further trigger, if one has come."""
        ...

    def disturbed(self) -> None:
        """What has been made ahead of now is no longer right."""
        ...


class Run:
    """State of a running (or finished, not yet stopped) acquisition. All under the bench's lock."""

    def __init__(
        self,
        plan: RunPlan,
        start_rule: StartRule,
        make_sampler: Callable[[SampleTimes], BlockSource],
        ref_search: Callable[[Run, float], int | None] | None = None,
        arrived: Callable[[float], float] = lambda now_s: now_s,
    ) -> None:
        """`arrived` answers which instant's samples have reached the computer by now."""
        self.plan = plan
        self.read_position = 0
        self.failure: DaqmxError | None = None
        self.aborted = False
        self.start_rule = start_rule
        self._make_sampler = make_sampler
        self._ref_search = ref_search
        self._arrived = arrived
        self._ref_sample: int | None = None
        self._end_s = np.inf
        self.times: SampleTimes | None = None
        self.sampler: BlockSource | None = None

    # --- time ---------------------------------------------------------------------------------

    def look(self, now_s: float) -> None:
        """Find out what has happened by now: start trigger, reference trigger."""
        if self.times is None:
            self.times = self.start_rule(now_s)
            if self.times is not None:
                self.sampler = self._make_sampler(self.times)
        else:
            while (times := self.start_rule.again(self.times, now_s)) is not None:
                self.retime(times)
        if self.times is not None and self._ref_sample is None and self._ref_search is not None:
            self._ref_sample = self._ref_search(self, now_s)

    def retime(self, times: SampleTimes) -> None:
        """Take the clock and the world as they are from now on; earlier samples stay what they were."""
        if self.times is not None:
            self.times = times
            self.sampler = self._make_sampler(times)

    def pulse_rate_changed(self, now_s: float, done: int, rate_hz: float) -> None:
        """A counter output goes on at another frequency from now on."""
        if self.times is not None:
            self.times = SampleTimes(now_s - done / rate_hz, rate_hz)

    def halt(self, now_s: float) -> None:
        """No further samples: the clock that feeds this run has gone."""
        self._end_s = min(self._end_s, now_s)

    def elapsed_samples(self, now_s: float) -> int:
        """Sample clocks seen by now, whatever the task does with them."""
        return 0 if self.times is None else self.times.count(min(self._arrived(now_s), self._end_s))

    def last_sample(self) -> int | None:
        """Number of samples after which the acquisition is complete, where that is known."""
        if self.plan.pretrigger is None:
            return self.plan.total
        if self._ref_sample is None:
            return None
        return self._ref_sample + (self.plan.total or 0) - self.plan.pretrigger

    def acquired(self, now_s: float) -> int:
        """Samples per channel taken by now."""
        self.look(now_s)
        last = self.last_sample()
        if self.plan.instant and last is not None and self.times is not None:
            return last
        count = self.elapsed_samples(now_s)
        return count if last is None else min(count, last)

    def is_done(self, now_s: float) -> bool:
        """A finite acquisition that is complete, or any that has failed."""
        if self.failure is not None:
            return True
        acquired = self.acquired(now_s)
        last = self.last_sample()
        return last is not None and acquired >= last

    def time_of_count(self, count: int) -> float | None:
        """Instant at which `count` samples exist; None if that is not known yet."""
        last = self.last_sample()
        if self.times is None or (self.plan.pretrigger is not None and last is None):
            return None
        instant = self.times.time_of(count - 1)
        return instant if np.isfinite(instant) and instant <= self._end_s else None

    # --- reading ------------------------------------------------------------------------------

    @property
    def base(self) -> int:
        """Sample that positions count from: the first pre-trigger sample if there is a reference trigger."""
        if self.plan.pretrigger is None or self._ref_sample is None:
            return 0
        return self._ref_sample - self.plan.pretrigger

    @property
    def ref_sample(self) -> int | None:
        return self._ref_sample

    def readable(self, now_s: float) -> int:
        """Position after the last sample that may be read: nothing before a reference trigger is done."""
        acquired = self.acquired(now_s)
        if self.plan.pretrigger is not None and not self.is_done(now_s):
            return 0
        return acquired - self.base

    def available(self, now_s: float) -> int:
        return max(self.readable(now_s) - self.read_position, 0)

    def check(self, now_s: float) -> None:
        """Raise the failure of the run, and fail it if unread samples have been overwritten."""
        if self.aborted:
            raise DaqmxError(Code.ABORTED)
        if self.failure is not None:
            raise self.failure
        if self.plan.overwrite or self.plan.total is not None:
            return
        if self.acquired(now_s) - self.read_position > self.plan.buffer:
            self.fail_overwritten()

    def fail_overwritten(self, position: str = "DAQmx_Val_CurrReadPos", offset: int = 0) -> None:
        """The acquisition has stopped because the buffer ran over: −200279 from now on."""
        self.failure = overwritten(position, offset)
        raise self.failure

    def block(self, position: int, count: int, rows: Sequence[int] | None = None) -> NDArray[Any]:
        """Codes of `count` samples from a position, shape (channels, count)."""
        assert self.sampler is not None
        codes = self.sampler.codes(self.base + position, self.base + position + count)
        return codes if rows is None else codes[list(rows)]


def overwritten(position: str, offset: int) -> DaqmxError:
    """−200279 with the lines NI adds."""
    return DaqmxError(
        Code.SAMPLES_OVERWRITTEN,
        f"Property: DAQmx_Read_RelativeTo\nCorresponding Value: {position}",
        f"Property: DAQmx_Read_Offset\nCorresponding Value: {offset}",
    )


class ReferenceSearch:
    """Where the reference trigger lies: an edge at a terminal, or a crossing of a channel of the task."""

    def __init__(
        self,
        pretrigger: int,
        edge: Callable[[float], float | None] | None = None,
        crossing: CrossingSearch | None = None,
        readings: Callable[[Run, int, int], NDArray[np.float64]] | None = None,
    ) -> None:
        self._pretrigger = pretrigger
        self._edge = edge
        self._crossing = crossing
        self._readings = readings

    def __call__(self, run: Run, now_s: float) -> int | None:
        """Index of the first sample after the trigger; one before the pre-trigger samples is ignored."""
        assert run.times is not None
        count = run.elapsed_samples(now_s)
        readings = self._readings
        if self._crossing is not None and readings is not None:
            return self._crossing.find(lambda start, stop: readings(run, start, stop), count)
        assert self._edge is not None
        ready_s = run.times.time_of(self._pretrigger)
        instant = self._edge(ready_s)
        if instant is None or instant > now_s:
            return None
        return max(run.times.count(instant), self._pretrigger)
