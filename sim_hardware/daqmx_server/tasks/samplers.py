"""What a task reads and puts out, by the kind of its channels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Protocol, cast

import numpy as np
from nidaqmx.constants import Level
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.bench.loopback import Player
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.inventory.terminals import plain
from sim_hardware.daqmx_server.tasks.generation import Generation
from sim_hardware.daqmx_server.timing.acquisition import Run
from sim_hardware.daqmx_server.timing.counting import TIMEBASE_HZ, CounterSampler, Pulses
from sim_hardware.daqmx_server.timing.digital import DigitalSampler
from sim_hardware.daqmx_server.timing.found_times import FoundTimes, HeldClock
from sim_hardware.daqmx_server.timing.routing import terminals_of
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
from sim_hardware.daqmx_server.timing.sampling import BlockSource, Sampler
from sim_hardware.daqmx_server.timing.scan import Scan
from sim_hardware.daqmx_server.timing.task_timing import TaskTiming


class ChannelTask(Protocol):
    """A task as far as its samples are concerned."""

    bench: Bench
    channels: list[VirtualChannel]
    exported: dict[str, Any]
    generation: Generation
    run: Run | None
    timing: TaskTiming
    armed_s: float
    taken_on_demand: int

    @property
    def io(self) -> str: ...

    @property
    def hosts(self) -> list[str]: ...

    @property
    def devices(self) -> list[str]: ...

    @property
    def detects_changes(self) -> bool: ...

    @property
    def scan(self) -> Scan: ...


_ON_DEMAND_CHUNK: Final = 16
"""Samples made at a time for a program that takes them one by one."""


class NoSamples:
    """An output task has nothing to read."""

    def codes(self, start: int, stop: int) -> NDArray[Any]:
        return np.zeros((0, stop - start))


def sampler_of(task: ChannelTask, times: SampleTimes) -> BlockSource:
    """Samples of the task's channels by a clock."""
    bench = task.bench
    if isinstance(times, FoundTimes) and isinstance(times.finder, HeldClock):
        return times.finder
    if task.io == "DI":
        return DigitalSampler(task.channels, times, bench.loopback)
    if task.io == "CI":
        implicit = task.timing.is_implicit
        return CounterSampler(
            task.channels, times, task.armed_s, lambda channel: pulses_at(task, channel), implicit
        )
    if task.io == "AI":
        return Sampler(bench.wiring, bench.faults, task.scan.inputs, times, bench.helper)
    return NoSamples()


def on_demand_sampler(task: ChannelTask, now_s: float) -> BlockSource:
    """Samples taken by software, one after the other at the device's own pace."""
    times = SampleTimes(now_s, max(task.timing.max_rate_hz, 1.0))
    if task.io in ("DI", "DO"):  # lines that are put out can be read back
        return DigitalSampler(task.channels, times, task.bench.loopback, task.taken_on_demand)
    if task.io == "AI":
        bench, taken = task.bench, task.taken_on_demand
        inputs = task.scan.inputs
        return Sampler(bench.wiring, bench.faults, inputs, times, None, taken, _ON_DEMAND_CHUNK)
    return sampler_of(task, times)


def pulse_times_s(channel: VirtualChannel) -> tuple[float, float]:
    """Low and high time of a counter output, s."""
    attributes = channel.attributes
    if channel.measurement == "PULSE_FREQUENCY":
        period = 1.0 / float(attributes["CO_PULSE_FREQ"])
        high = period * float(attributes["CO_PULSE_DUTY_CYC"])
        return period - high, high
    if channel.measurement == "PULSE_TIME":
        return float(attributes["CO_PULSE_LOW_TIME"]), float(attributes["CO_PULSE_HIGH_TIME"])
    ticks = int(attributes["CO_PULSE_LOW_TICKS"]), int(attributes["CO_PULSE_HIGH_TICKS"])
    return ticks[0] / TIMEBASE_HZ, ticks[1] / TIMEBASE_HZ


_TIMEBASES_HZ: Final = {"100mhztimebase": 100e6, "20mhztimebase": 20e6, "100khztimebase": 100e3}
"""Clocks of a card that its counters can listen to."""


def _on_device(channel: VirtualChannel, terminal: str) -> str:
    """Plain name of a terminal; one without a device is on the channel's own."""
    name = plain(terminal)
    return name if "/" in name or not name else f"{plain(channel.device.name)}/{name}"


def pulses_at(task: ChannelTask, channel: VirtualChannel) -> Pulses | None:
    """The train that reaches a counter input: of the counter output whose terminal it listens to."""
    group = channel.kind.group
    keys = [key for key in channel.attributes if key.startswith(group) and key.endswith("_TERM")]
    wanted = {_on_device(channel, str(channel.attributes[key])) for key in keys}
    for terminal in wanted:
        timebase_hz = _TIMEBASES_HZ.get(terminal.rpartition("/")[2])
        if timebase_hz is not None:
            return Pulses.regular(0.0, 0.5 / timebase_hz, 0.5 / timebase_hz)
    for other in cast("dict[str, ChannelTask]", task.bench.tasks).values():
        run = other.run
        if other.io != "CO" or run is None:
            continue
        run.look(task.bench.clock.now())
        if run.times is None:
            continue
        if wanted & terminals_of(other, "SampleClock"):
            lows_s, highs_s = _pulse_sequence_s(other)
            total = run.last_sample()
            high_first = other.channels[0].attributes.get("CO_PULSE_IDLE_STATE") == Level.HIGH.value
            count = np.inf if total is None else float(total)
            return Pulses(run.times.first_s, lows_s, highs_s, count, high_first)
    return None


def _pulse_sequence_s(task: ChannelTask) -> NDArray[np.float64]:
    """Low and high times of the pulses that a counter output makes in turn, s, shape (2, pulses)."""
    if task.generation.pulses.shape[1]:
        return task.generation.pulses
    return np.array([[time_s] for time_s in pulse_times_s(task.channels[0])])


@dataclass(frozen=True, slots=True)
class _Playing:
    """Written samples that drive outputs from a run's first clock on."""

    task: ChannelTask
    run: Run

    def _times(self) -> SampleTimes | None:
        """When the samples are put out; None before the first one, or where none is written."""
        self.run.look(self.task.bench.clock.now())
        return self.run.times if self.task.generation.samples.size else None

    def values(self, row: int, bit: int | None, instants: NDArray[np.float64]) -> NDArray[np.float64]:
        """Row of the samples, or one bit of its words, at instants in s; NaN before the first sample."""
        times = self._times()
        if times is None:
            return np.full(len(instants), np.nan)
        out = self.task.generation.at(row, times, instants, self.run.plan.total)
        if bit is None:
            return out
        words = np.nan_to_num(out).astype(np.int64)
        return np.where(np.isnan(out), np.nan, words >> bit & 1)

    def steps(self, after_s: float, until_s: float) -> NDArray[np.float64]:
        """Instants after one and up to another at which a sample is put out, s."""
        times = self._times()
        if times is None:
            return np.empty(0)
        end = times.count(until_s)
        if self.run.plan.total is not None:
            end = min(end, self.run.plan.total)
        return times.at(np.arange(times.count(after_s), end))


def play(task: ChannelTask, run: Run) -> None:
    """The written samples drive the outputs from the run's first clock on."""
    playing = _Playing(task, run)
    for row, channel in enumerate(task.channels):
        if task.io == "AO":
            player = Player(partial(playing.values, row, None), playing.steps)
            task.bench.loopback.play(channel.physical, player)
        for bit, line in enumerate(channel.lines):
            task.bench.loopback.play(line, Player(partial(playing.values, row, bit), playing.steps))
    task.bench.world_changed()


def stop_playing(task: ChannelTask, now_s: float) -> None:
    """The outputs keep the value they have now."""
    for channel in task.channels:
        for terminal in channel.lines or (channel.physical,):
            task.bench.loopback.stop(terminal, now_s)
