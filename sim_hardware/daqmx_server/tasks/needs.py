"""What a task needs for itself: parts of devices, and memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np
from nidaqmx.constants import AcquisitionType

from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.tasks.generation import Generation
from sim_hardware.daqmx_server.timing.task_timing import TaskTiming

_DEFAULT_BUFFERS: Final = ((100.0, 1_000), (10_000.0, 10_000), (1e6, 100_000), (np.inf, 1_000_000))
"""Fastest rate, Hz, and samples per channel of the input buffer that NI-DAQmx makes for it."""


class BufferedTask(Protocol):
    """A task as far as its buffers are concerned."""

    generation: Generation
    timing: TaskTiming
    input_buffer: int | None
    output_buffer: int | None

    @property
    def is_output(self) -> bool: ...


ONBOARD_OUTPUT_SAMPLES: Final = 8191
"""Samples that the memory of a device with analogue outputs holds (X Series)."""


def resources_of(channels: Sequence[VirtualChannel]) -> list[str]:
    """Parts of devices that a task with these channels reserves; inputs that only look need none."""
    out: list[str] = []
    for channel in channels:
        if channel.io == "AI":
            out.append(f"{channel.device.name}/ai")
        elif channel.io == "DI":
            reads_back = channel.attributes.get("DI_TRISTATE") is False
            out += [] if reads_back else list(channel.lines)
        else:
            out += channel.lines or (channel.physical,)
    return list(dict.fromkeys(out))


def buffer_size(task: BufferedTask) -> int:
    """Samples per channel of the circular buffer: as set, or NI's default for the rate."""
    if task.is_output:
        return max(int(task.generation.samples.shape[1]), task.output_buffer or 0)
    if task.input_buffer is not None:
        return task.input_buffer
    samples = task.timing.samples_per_channel
    if task.timing.mode == AcquisitionType.FINITE.value and not task.timing.retriggers:
        return samples
    rate = task.timing.rate_hz
    return max(next(size for limit, size in _DEFAULT_BUFFERS if rate <= limit), samples)
