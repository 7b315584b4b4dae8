"""Samples of an output that are put out once: they fill the buffer and the memory of the device."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.tasks.needs import ONBOARD_OUTPUT_SAMPLES
from sim_hardware.daqmx_server.tasks.task import Task


def write_once(task: Task, samples: NDArray[np.float64], timeout_s: float) -> int:
    """Write samples (channels, samples) that are not regenerated, waiting for room; their number.

    −200293 before the start where they do not fit: nothing is written. −200292 at the time-out, with the
    number that has been written. A buffer that the client has not set takes
    whatever is written before the start.
    """
    count = int(samples.shape[1])
    generation = task.generation
    if task.run is None:
        if task.output_buffer and generation.written + count > task.output_buffer + ONBOARD_OUTPUT_SAMPLES:
            raise DaqmxError(Code.NO_MORE_SPACE, samples_written=0)
        return generation.write(samples, None)
    capacity = (task.output_buffer or generation.written_before_start) + ONBOARD_OUTPUT_SAMPLES
    clock = task.bench.clock
    deadline = clock.deadline(timeout_s)
    done = 0
    while task.run is not None:
        room = capacity - generation.written + task.run.acquired(clock.now())
        if room > 0:
            done += generation.write(samples[:, done : done + room], None)
        if done == count:
            return count
        next_s = task.run.time_of_count(generation.written - capacity + 1)
        if not clock.wait(task.bench.changed, next_s, deadline):
            break
    raise DaqmxError(Code.SAMPLES_NOT_YET_WRITABLE, samples_written=done)
