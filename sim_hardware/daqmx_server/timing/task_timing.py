"""Sample timing of a task: rate, mode, clock source, and when each channel is looked at."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, Protocol, cast

import numpy as np
from nidaqmx.constants import (
    AcquisitionType,
    DigitalWidthUnits,
    Level,
    SampleTimingType,
    SyncPulseType,
)
from numpy.typing import NDArray

from daq_app.config.hardware import catalogue
from daq_app.config.hardware.products import Product
from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.analog_input import AnalogInput
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import channel_list
from sim_hardware.daqmx_server.inventory.terminals import plain
from sim_hardware.daqmx_server.timing import triggers
from sim_hardware.daqmx_server.timing.found_times import FoundTimes
from sim_hardware.daqmx_server.timing.routing import SignalTask, terminals_of
from sim_hardware.daqmx_server.timing.sample_times import BurstTimes, PulseTimes, SampleTimes
from sim_hardware.daqmx_server.timing.sampling import BlockSource
from sim_hardware.faults.model import ClockChange

_RATE_OF_SLOW_MODULES_HZ = 100e3
_FEWEST_SAMPLES = 2
_OWN_CLOCKS = ("", "onboardclock")


class TimedTask(SignalTask, Protocol):
    """A task as far as its clocks and start are concerned."""

    bench: Bench
    channels: list[VirtualChannel]
    trigger: dict[str, Any]
    timing: TaskTiming

    @property
    def is_buffered(self) -> bool: ...

    @property
    def is_reserved(self) -> bool: ...

    @property
    def pulse_rate_hz(self) -> float:
        """Frequency of a task that puts out pulses; 0 for any other."""
        ...

    @property
    def pulse_periods_s(self) -> NDArray[np.float64]:
        """Periods of the pulses that a counter output makes in turn; empty for a regular train."""
        ...

    def make_sampler(self, times: SampleTimes) -> BlockSource: ...

    def trigger_readings(
        self, sampler: BlockSource, source: str, start: int, stop: int
    ) -> NDArray[np.float64]: ...


class TaskTiming:
    """`settings` are what the client set; the properties are what the hardware makes of it."""

    def __init__(self, task: TimedTask) -> None:
        self._task = task
        self.settings: dict[str, Any] = {}

    @property
    def timing_type(self) -> int:
        return int(self.settings.get("SAMP_TIMING_TYPE", SampleTimingType.ON_DEMAND.value))

    @property
    def is_implicit(self) -> bool:
        """Whether the measured or generated pulses are themselves the clock."""
        return self.timing_type == int(SampleTimingType.IMPLICIT.value)

    @property
    def mode(self) -> int:
        return int(self.settings.get("SAMP_QUANT_SAMP_MODE", AcquisitionType.FINITE.value))

    @property
    def samples_per_channel(self) -> int:
        return int(self.settings.get("SAMP_QUANT_SAMP_PER_CHAN", 1000))

    @property
    def source(self) -> str:
        return str(self.settings.get("SAMP_CLK_SRC", ""))

    @property
    def inputs(self) -> list[AnalogInput]:
        """The task's channels, where they are analogue inputs."""
        return [channel for channel in self._task.channels if isinstance(channel, AnalogInput)]

    @property
    def asked_rate_hz(self) -> float:
        """The rate that the client asked for, directly or as a divisor of the timebase."""
        if "SAMP_CLK_TIMEBASE_DIV" in self.settings:
            return self.timebase_hz / int(self.settings["SAMP_CLK_TIMEBASE_DIV"])
        return float(self.settings.get("SAMP_CLK_RATE", 1000.0))

    @property
    def rate_hz(self) -> float:
        """The rate the hardware makes of the one asked for: the slowest-dividing module decides."""
        asked = self.asked_rate_hz
        forced = self._task.bench.faults.forced_rate_hz([*self._task.hosts, *self._task.devices])
        if forced is not None:
            return forced
        pulses = self._task.pulse_rate_hz
        if pulses:
            return pulses
        inputs = self.inputs
        if not self._task.channels or self.source_is_foreign or asked <= 0:
            return asked
        if not inputs or ("SAMP_CLK_TIMEBASE_RATE" in self.settings and self.timebase_hz > 0):
            rate = self.timebase_hz / max(1, math.floor(self.timebase_hz / asked * (1 + 1e-12)))
            fastest = self.max_rate_hz
            return fastest if asked <= fastest < rate else rate
        products = {channel.product.name: channel.product for channel in inputs}
        try:
            return catalogue.coerce_rate(list(products.values()), asked)
        except ValueError:
            return asked  # refused by `verify`

    @property
    def max_rate_hz(self) -> float:
        """Fastest rate of this set of channels; 0 where nothing is known to limit it."""
        counts = Counter(channel.device.name for channel in self._task.channels)
        limits = []
        for channel in self._task.channels:
            product, n = channel.product, counts[channel.device.name]
            if channel.io in ("DI", "DO"):
                limits.append(product.ports.max_rate_hz)
            elif channel.io == "AO":
                limits.append(product.outputs.max_rate_hz)
            elif channel.io in ("CI", "CO"):
                limits.append(product.counters.max_rate_hz)
            elif product.converter != "slow":  # a slow one repeats its last value at any rate
                single = product.max_rate_hz
                shared = product.aggregate_rate_hz
                limits.append(min(single, shared / n) if shared else single)
        known = [limit for limit in limits if limit > 0]
        return min(known, default=_RATE_OF_SLOW_MODULES_HZ if counts else 0.0)

    @property
    def timebase_hz(self) -> float:
        """The clock that the sample clock is divided from; the client's own where it has set a rate."""
        if "SAMP_CLK_TIMEBASE_RATE" in self.settings:
            return float(self.settings["SAMP_CLK_TIMEBASE_RATE"])
        clocks = [c.product.delta_sigma.timebase_hz for c in self.inputs if c.product.delta_sigma]
        cards = [c.product.timebase_hz for c in self._task.channels]
        return max(clocks, default=0.0) or max(cards, default=0.0) or 80e6

    @property
    def source_is_foreign(self) -> bool:
        return self.source.lower().strip("/") not in _OWN_CLOCKS

    @property
    def waits_for_others(self) -> bool:
        """Whether the first sample needs something that this task does not make itself."""
        which = triggers.digital_start(self._task.trigger)
        if self.source_is_foreign or which is None:
            return self.source_is_foreign
        source = triggers.source_of(self._task.trigger, which)
        return not self._task.bench.fires_at_once(self._task.hosts[0], source)

    @property
    def start_delay_s(self) -> float:
        """Time from the start trigger to the first sample, s."""
        delay = float(self._task.trigger.get("START_TRIG_DELAY", 0.0))
        periods = DigitalWidthUnits.SAMPLE_CLOCK_PERIODS.value
        in_periods = self._task.trigger.get("START_TRIG_DELAY_UNITS", periods) == periods
        return delay / self.rate_hz if in_periods and delay else delay

    def not_before(self, first_s: float) -> float:
        """The first sample's instant, where the client has set a time of day for it or for the sync pulse."""
        instants = [first_s]
        if "FIRST_SAMP_CLK_WHEN" in self.settings:
            offset_s = float(self.settings.get("FIRST_SAMP_CLK_OFFSET", 0.0))
            instants.append(self._task.bench.instant_of(self.settings["FIRST_SAMP_CLK_WHEN"]) + offset_s)
        by_time = self.settings.get("SYNC_PULSE_TYPE") == SyncPulseType.TIME.value
        if by_time and "SYNC_PULSE_TIME_WHEN" in self.settings:
            instants.append(self._task.bench.instant_of(self.settings["SYNC_PULSE_TIME_WHEN"]))
        return max(instants)

    def verify(self) -> None:
        """Raise what NI-DAQmx raises for a clock that these channels cannot have."""
        if not self._task.is_buffered:
            triggered = any(
                self._task.trigger[f"{which}_TRIG_TYPE"] != triggers.NONE for which in ("START", "REF")
            )
            if triggered and self._task.io in ("AI", "AO", "DI", "DO"):
                raise DaqmxError(Code.TRIGGER_ON_DEMAND)
            return
        self.verify_count()
        if not self.rate_hz > 0:
            raise DaqmxError(
                Code.INVALID_VALUE, f"Property: DAQmx_SampClk_Rate\nRequested Value: {self.rate_hz}"
            )
        if self.rate_hz > self.max_rate_hz * (1 + 1e-9):
            raise DaqmxError(
                Code.SAMPLE_RATE_TOO_HIGH,
                f"Property: DAQmx_SampClk_Rate\nRequested Value: {self.rate_hz}\n"
                f"Maximum Value: {self.max_rate_hz}",
            )
        self._verify_convert_clock()
        if self.timing_type == SampleTimingType.CHANGE_DETECTION.value:
            self._verify_change_detection()

    def changing_lines(self) -> list[tuple[str, bool]]:
        """Lines that change detection watches, and whether their rising edges count or their falling ones."""
        inventory = self._task.bench.inventory
        return [
            (line, edge == "RISING")
            for edge in ("RISING", "FALLING")
            for text in channel_list(
                str(self.settings.get(f"CHANGE_DETECT_DI_{edge}_EDGE_PHYSICAL_CHANS", ""))
            )
            for line in inventory.digital_lines(text)[1]
        ]

    def _verify_change_detection(self) -> None:
        """−200077 for a task that has no digital input, or that watches no line."""
        if self._task.io != "DI":
            raise DaqmxError(Code.INVALID_VALUE, "Property: DAQmx_SampTimingType")
        if not self.changing_lines():
            raise DaqmxError(
                Code.INVALID_VALUE,
                "Property: DAQmx_ChangeDetect_DI_RisingEdge_PhysicalChans\nRequested Value: (none)",
            )

    def verify_count(self) -> None:
        """−200077 for fewer than two samples per channel of a clocked finite task."""
        clocked = self.timing_type == SampleTimingType.SAMPLE_CLOCK.value
        if (
            clocked
            and self.samples_per_channel < _FEWEST_SAMPLES
            and self.mode == AcquisitionType.FINITE.value
        ):
            raise DaqmxError(
                Code.INVALID_VALUE,
                f"Property: DAQmx_SampQuant_SampPerChan\nRequested Value: {self.samples_per_channel}\n"
                f"Minimum Value: {_FEWEST_SAMPLES}",
            )

    def _verify_convert_clock(self) -> None:
        inputs = self.inputs
        if not inputs:
            return
        n_channels = max(Counter(c.device.name for c in inputs).values())
        period = self.convert_period_s()
        fastest = max(c.product.min_convert_period_s for c in inputs)
        if period and not fastest * (1 - 1e-9) <= period <= (1 + 1e-9) / (self.rate_hz * n_channels):
            raise DaqmxError(
                Code.INVALID_VALUE,
                f"Property: DAQmx_AIConv_Rate\nRequested Value: {1 / period}\n"
                f"Maximum Value: {1 / fastest}\nMinimum Value: {self.rate_hz * n_channels}",
            )

    def convert_period_s(self) -> float:
        """Time between the conversions of the first multiplexed device; 0 if there is none."""
        if "AI_CONV_RATE" in self.settings:
            return 1.0 / float(self.settings["AI_CONV_RATE"])
        if "AI_CONV_TIMEBASE_DIV" in self.settings:
            return int(self.settings["AI_CONV_TIMEBASE_DIV"]) / self.timebase_hz
        devices = {c.device.name: c.product for c in self.inputs}
        counts = Counter(c.device.name for c in self.inputs)
        periods = catalogue.convert_periods_s(
            [(p, counts[name]) for name, p in devices.items()], self.rate_hz
        )
        return next((period for period in periods if period > 0), 0.0)

    def time_offsets_s(self) -> list[float]:
        """Per channel: multiplexer skew by place in the device's scan list, minus the converter's lag."""
        rate = self.rate_hz
        inputs = self.inputs
        scan = [(c.device.name, c.product) for c in inputs]
        skews = catalogue.task_skews_s(scan, rate)
        if "AI_CONV_RATE" in self.settings:
            skews = _skews_at(scan, 1.0 / float(self.settings["AI_CONV_RATE"]))
        return [
            skew - catalogue.input_delay_s(channel.product, rate)
            for skew, channel in zip(skews, inputs, strict=True)
        ]

    def clock_from(self, first_s: float, rate_hz: float) -> SampleTimes:
        """A sample clock from an instant on, with what faults and pauses do to it."""
        periods_s = self._task.pulse_periods_s
        if len(periods_s):
            return PulseTimes(first_s, periods_s)
        owner = self.source_task() or self._task
        places = [*owner.hosts, *owner.devices]
        return SampleTimes(
            first_s, rate_hz, [*self._task.bench.faults.clock_changes(places), *owner.timing.pauses()]
        )

    def retimed(self, times: SampleTimes) -> SampleTimes:
        """A clock that runs already, with what faults and pauses do to it by now."""
        if isinstance(times, FoundTimes):
            return times
        if isinstance(times, BurstTimes):
            bursts = [self.clock_from(burst.first_s, burst.rate_hz) for burst in times.bursts]
            return BurstTimes(bursts, times.samples)
        return self.clock_from(times.first_s, times.rate_hz)

    def pauses(self) -> tuple[ClockChange, ...]:
        """When a digital level holds the sample clock, as far as that is known."""
        trigger = self._task.trigger
        if trigger.get("PAUSE_TRIG_TYPE") != triggers.LEVEL:
            return ()
        source = str(trigger.get("DIG_LVL_PAUSE_TRIG_SRC", ""))
        high = trigger.get("DIG_LVL_PAUSE_TRIG_WHEN", Level.HIGH.value) == Level.HIGH.value
        return tuple(
            ClockChange(start_s, end_s, 0.0) for start_s, end_s in self._task.bench.level_spans(source, high)
        )

    @property
    def retriggers(self) -> bool:
        """Whether a finite acquisition takes its samples anew at each start trigger."""
        trigger = self._task.trigger
        return bool(
            trigger.get("START_TRIG_RETRIGGERABLE", False)
            and self.mode == AcquisitionType.FINITE.value
            and trigger["START_TRIG_TYPE"] != triggers.NONE
            and self._task.io in ("AI", "DI")
        )

    def source_task(self) -> TimedTask | None:
        """The task whose sample clock this one uses: one that runs before one that only holds its devices.

        A task that has reserved nothing drives no line.
        """
        if not self.source_is_foreign:
            return None
        wanted = self._task.bench.inventory.joined(plain(self.source))
        drivers = [
            other
            for other in cast("dict[str, TimedTask]", self._task.bench.tasks).values()
            if other is not self._task
            and other.is_reserved
            and not other.timing.source_is_foreign
            and wanted & terminals_of(other, "SampleClock")
        ]
        running = [other for other in drivers if other.run is not None]
        return next(iter(running or drivers), None)


def _skews_at(scan: list[tuple[str, Product]], period_s: float) -> list[float]:
    """Skews where the client has set the convert clock itself."""
    seen: Counter[str] = Counter()
    out = []
    for device, product in scan:
        out.append(seen[device] * period_s if product.converter == "multiplexed" else 0.0)
        seen[device] += 1
    return out
