"""When the first sample of a task is taken, and the first one after each further trigger."""

from __future__ import annotations

from functools import partial

from nidaqmx.constants import Edge

from sim_hardware.daqmx_server.timing import triggers
from sim_hardware.daqmx_server.timing.acquisition import StartRule
from sim_hardware.daqmx_server.timing.found_times import FoundTimes, HeldClock, LineChanges
from sim_hardware.daqmx_server.timing.sample_times import BurstTimes, SampleTimes
from sim_hardware.daqmx_server.timing.task_timing import TimedTask
from sim_hardware.daqmx_server.timing.triggers import CrossingSearch


def start_rule(task: TimedTask, armed_s: float) -> StartRule:
    """How the instant of the first sample is found, once and for all at the start of the task."""
    if task.timing.source_is_foreign:
        return _SharedClock(task, armed_s)
    return _OwnClock(task, armed_s)


def _start_edge(task: TimedTask, after_s: float) -> float | None:
    """The edge that a digital start trigger waits for, if it has come."""
    which = triggers.digital_start(task.trigger) or "START"
    source = triggers.source_of(task.trigger, which)
    rising = triggers.is_rising(task.trigger, which)
    return task.bench.trigger_edge(task.hosts[0], source, after_s, rising)


class _OwnClock:
    """The clock starts at the start trigger, or at once; each further trigger may start it again."""

    def __init__(self, task: TimedTask, armed_s: float) -> None:
        self._task = task
        self._armed_s = armed_s
        self._kind = int(task.trigger["START_TRIG_TYPE"])
        self._search: CrossingSearch | None = None
        self._held: HeldClock | None = None
        by_channel = not triggers.waits_for_edge(task.trigger, "START")
        if self._kind in (triggers.ANALOG, triggers.WINDOW) and by_channel:
            self._search = CrossingSearch(triggers.Condition.of(task.trigger, "START"), 0)
            self._listen()

    def disturbed(self) -> None:
        if self._search is not None:
            self._listen()
        if self._held is not None:
            times = self._task.timing.retimed(self._held.times)
            self._held.renew(times, self._task.make_sampler(times))

    def _listen(self) -> None:
        """An analogue trigger looks at its channel at the rate of the acquisition to come."""
        self._times = self._task.timing.clock_from(self._armed_s, self._task.timing.rate_hz)
        self._sampler = self._task.make_sampler(self._times)

    def __call__(self, now_s: float) -> SampleTimes | None:
        times = self._clock_after(self._armed_s, now_s)
        if times is None:
            return None
        self._task.bench.faults.acquisition_started(times.first_s, times.rate_hz)
        if self._task.timing.retriggers:
            return BurstTimes([times], self._task.timing.samples_per_channel)
        return self._found(times)

    def _found(self, times: SampleTimes) -> SampleTimes:
        """The same clock, or one whose instants lines or an analogue signal decide."""
        task = self._task
        if task.detects_changes and not any(channel.device.simulated for channel in task.channels):
            lines = [
                (partial(task.bench.loopback.changes, line), rising)
                for line, rising in task.timing.changing_lines()
            ]
            return FoundTimes(LineChanges(times.first_s, lines), times.rate_hz)
        if triggers.holds_by_analog(task.trigger) and task.io == "AI":
            source = triggers.source_of(task.trigger, "PAUSE")
            self._held = HeldClock(
                times,
                task.make_sampler(times),
                lambda sampler, start, stop: task.trigger_readings(sampler, source, start, stop),
                triggers.Hold(task.trigger),
            )
            return FoundTimes(self._held, times.rate_hz)
        return times

    def again(self, times: SampleTimes, now_s: float) -> SampleTimes | None:
        if not isinstance(times, BurstTimes) or times.end_s >= now_s:
            return None
        if self._search is not None:
            condition = triggers.Condition.of(self._task.trigger, "START")
            self._search = CrossingSearch(condition, self._times.count(times.end_s))
        burst = self._clock_after(times.end_s, now_s)
        return None if burst is None else times.then(burst)

    def _clock_after(self, instant_s: float, now_s: float) -> SampleTimes | None:
        """The clock that the first trigger at or after an instant starts, if it has come."""
        triggered_s = self._trigger_instant(instant_s, now_s)
        if triggered_s is None:
            return None
        first_s = self._task.timing.not_before(triggered_s + self._task.timing.start_delay_s)
        for pause in self._task.timing.pauses():  # a clock that is held gives no first sample
            if pause.start_s <= first_s < pause.end_s:
                first_s = pause.end_s
        timing = self._task.timing
        return None if first_s == float("inf") else timing.clock_from(first_s, timing.rate_hz)

    def _trigger_instant(self, after_s: float, now_s: float) -> float | None:
        if triggers.digital_start(self._task.trigger) is not None:
            return _start_edge(self._task, after_s)
        if self._kind == triggers.TIME:
            when = self._task.trigger["START_TRIG_TRIG_WHEN"]
            return max(after_s, self._task.bench.instant_of(when))
        if self._search is None:
            return after_s
        source = triggers.source_of(self._task.trigger, "START")
        hit = self._search.find(
            lambda start, stop: self._task.trigger_readings(self._sampler, source, start, stop),
            self._times.count(now_s),
        )
        return None if hit is None else self._times.time_of(hit)


class _SharedClock:
    """Samples are taken at the clock of another task, from its first edge after this one is armed."""

    def __init__(self, task: TimedTask, armed_s: float) -> None:
        self._task = task
        self._armed_s = armed_s

    def disturbed(self) -> None:
        """The master's clock is disturbed by itself."""

    def again(self, times: SampleTimes, now_s: float) -> SampleTimes | None:
        if not isinstance(times, BurstTimes):
            return None
        newer = self(now_s)
        return newer if isinstance(newer, BurstTimes) and newer.end_s > times.end_s else None

    def __call__(self, now_s: float) -> SampleTimes | None:
        master = self._task.timing.source_task()
        if master is None or master.run is None or master.run.times is None:
            return None
        times = master.run.times
        if self._task.timing.settings.get("SAMP_CLK_ACTIVE_EDGE") == Edge.FALLING.value:
            times = times.later(0.5 / times.rate_hz)
        armed = self._armed_s
        if triggers.digital_start(self._task.trigger) is not None:
            edge = _start_edge(self._task, armed)
            if edge is None:
                return None
            armed = edge
        if armed <= times.first_s:
            return times
        return times.from_sample(times.count(armed - 1e-12))
