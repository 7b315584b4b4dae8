"""Event streams: every N samples, done, signal."""

from __future__ import annotations

import queue
from collections.abc import Callable

import numpy as np
import pytest
from nidaqmx.constants import READ_ALL_AVAILABLE, AcquisitionType, Signal
from nidaqmx.errors import DaqError

from tests.support.server_support import Rig, TestSignals, continuous


@pytest.mark.parametrize("speed", [float("inf"), 20.0])
def test_every_n_samples_callback_reads_all(start_rig: Callable[..., Rig], speed: float) -> None:
    """The usual program: continuous acquisition, one read in each callback, nothing lost."""
    rig = start_rig(speed=speed)
    blocks: queue.Queue[list[float]] = queue.Queue()
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)

        def callback(handle: object, kind: int, n: int, data: object) -> int:
            blocks.put(task.read(n))
            return 0

        task.register_every_n_samples_acquired_into_buffer_event(100, callback)
        task.start()
        got = np.concatenate([blocks.get(timeout=20) for _ in range(8)])
        task.stop()
    expected = TestSignals().volts(("x/ai0",), np.arange(800) / 1000.0)[0]
    assert np.max(np.abs(got - expected)) < 2e-4


def test_events_can_be_registered_again_after_a_stop(rig: Rig) -> None:
    seen: queue.Queue[int] = queue.Queue()
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.in_stream.auto_start = False  # a late read in a callback must not start the stopped task again

        def callback(handle: object, kind: int, n: int, data: object) -> int:
            seen.put(n)
            task.read(READ_ALL_AVAILABLE)
            return 0

        for n in (50, 80):
            task.register_every_n_samples_acquired_into_buffer_event(n, callback)
            task.start()
            assert seen.get(timeout=20) == n
            task.stop()
            task.register_every_n_samples_acquired_into_buffer_event(n, None)
            while not seen.empty():
                seen.get()


def test_done_event_of_a_finite_task(start_rig: Callable[..., Rig]) -> None:
    rig = start_rig(speed=50.0)
    done: queue.Queue[int] = queue.Queue()
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=500)
        task.register_done_event(lambda handle, status, data: done.put(status) or 0)
        task.start()
        assert done.get(timeout=20) == 0
        assert task.is_task_done()
        assert len(task.read(READ_ALL_AVAILABLE)) == 500


def test_done_event_tells_of_a_failure(start_rig: Callable[..., Rig]) -> None:
    """A buffer that runs over ends the task: the event carries −200279."""
    rig = start_rig(speed=50.0)
    done: queue.Queue[int] = queue.Queue()
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(1000.0, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=1000)
        task.in_stream.input_buf_size = 1000
        task.register_done_event(lambda handle, status, data: done.put(status) or 0)
        task.start()
        assert done.get(timeout=20) == -200279


def test_sample_clock_signal(rig: Rig) -> None:
    ticks: queue.Queue[int] = queue.Queue()
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(100.0, samps_per_chan=5)
        task.register_signal_event(Signal.SAMPLE_CLOCK, lambda handle, kind, data: ticks.put(kind) or 0)
        task.start()
        task.read(5)
        assert [ticks.get(timeout=20) for _ in range(5)] == [Signal.SAMPLE_CLOCK.value] * 5


def test_what_cannot_be_registered(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")

        def code(register: Callable[[], object]) -> int:
            with pytest.raises(DaqError) as caught:
                register()
            return caught.value.error_code

        def callback(*arguments: object) -> int:
            return 0

        task.register_every_n_samples_acquired_into_buffer_event(10, callback)
        assert code(task.start) == -200848
        task.register_every_n_samples_acquired_into_buffer_event(10, None)
        continuous(task)
        assert code(lambda: task.register_every_n_samples_acquired_into_buffer_event(0, callback)) == -200880
        assert code(lambda: task.register_signal_event(Signal.CHANGE_DETECTION_EVENT, callback)) == -200987
        task.start()
        assert code(lambda: task.register_done_event(callback)) == -200960
