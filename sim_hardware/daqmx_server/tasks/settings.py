"""What a task is told to do: its channels and their settings, and what follows from them alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from nidaqmx.constants import SampleTimingType
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.inventory.devices import Device, channel_list
from sim_hardware.daqmx_server.tasks.generation import Generation
from sim_hardware.daqmx_server.tasks.needs import buffer_size
from sim_hardware.daqmx_server.tasks.samplers import pulse_times_s
from sim_hardware.daqmx_server.tasks.tdms_log import TdmsLog
from sim_hardware.daqmx_server.timing import triggers
from sim_hardware.daqmx_server.timing.task_timing import TaskTiming


class TaskSettings:
    """Channels, clocks, triggers and buffers of a task as the client has set them."""

    timing: TaskTiming

    def __init__(self, bench: Bench, name: str) -> None:
        self.bench = bench
        self.name = name
        self.channels: list[VirtualChannel] = []
        self.trigger: dict[str, Any] = {"START_TRIG_TYPE": triggers.NONE, "REF_TRIG_TYPE": triggers.NONE}
        self.reading: dict[str, Any] = {}
        self.exported: dict[str, Any] = {}
        self.real_time: dict[str, Any] = {}
        self.writing: dict[str, Any] = {}
        self.watchdog: dict[str, Any] = {}
        self.log = TdmsLog(self.reading)
        self.generation = Generation(self.writing)
        self.input_buffer: int | None = None
        self.output_buffer: int | None = None

    def channel(self, name: str) -> VirtualChannel:
        """By virtual or physical name; −200088-style error of NI otherwise."""
        wanted = name.strip().lower()
        for channel in self.channels:
            if wanted in (channel.name.lower(), channel.physical.lower()):
                return channel
        raise DaqmxError(Code.CHANNEL_NOT_IN_TASK, f"Channel Name: {name}")

    def channels_named(self, text: str) -> list[VirtualChannel]:
        """Channels of a list; all of them for an empty one."""
        whole = [channel for channel in self.channels if channel.name == text]
        if whole:
            return whole
        return [self.channel(name) for name in channel_list(text)] if text else list(self.channels)

    def read_rows(self) -> list[int] | None:
        """Rows of the channels to read, None for all in order."""
        text = self.reading.get("CHANNELS_TO_READ", "")
        return [self.channels.index(channel) for channel in self.channels_named(text)] if text else None

    @property
    def devices(self) -> list[str]:
        return list(dict.fromkeys(channel.device.name for channel in self.channels))

    @property
    def hosts(self) -> list[str]:
        """Owners of the clocks and triggers of this task's devices, the first one first."""
        return list(dict.fromkeys(self.bench.inventory.host_of(channel.device) for channel in self.channels))

    @property
    def is_buffered(self) -> bool:
        return self.io == "CO" or bool(self.timing.timing_type != SampleTimingType.ON_DEMAND.value)

    @property
    def detects_changes(self) -> bool:
        """Whether changes of digital lines are its sample clock."""
        return self.io == "DI" and self.timing.timing_type == SampleTimingType.CHANGE_DETECTION.value

    @property
    def pulse_periods_s(self) -> NDArray[np.float64]:
        """Periods of the pulses that a counter output makes in turn; empty for a regular train."""
        return np.asarray(self.generation.pulses.sum(axis=0))

    @property
    def host(self) -> Device | None:
        """The device that owns the task's clocks and triggers."""
        hosts = self.hosts
        return self.bench.inventory.devices.get(hosts[0]) if hosts else None

    @property
    def io(self) -> str:
        """Kind of the task's channels (AI, AO, DI, DO, CI, CO); empty without channels."""
        return self.channels[0].io if self.channels else ""

    @property
    def is_output(self) -> bool:
        return self.io in ("AO", "DO", "CO")

    @property
    def pulse_rate_hz(self) -> float:
        """Frequency of a task that puts out pulses; 0 for any other."""
        if self.io != "CO":
            return 0.0
        low_s, high_s = pulse_times_s(self.channels[0])
        return 1.0 / (low_s + high_s)

    @property
    def buffer_size(self) -> int:
        """Samples per channel of the circular buffer."""
        return buffer_size(self)
