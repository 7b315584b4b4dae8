"""Clocks that lines or analogue signals decide, pulses one after the other, and outputs that are full."""

from __future__ import annotations

import queue
from dataclasses import replace

import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import (
    AcquisitionType,
    ActiveLevel,
    Edge,
    Level,
    LineGrouping,
    RegenerationMode,
    Signal,
    TriggerType,
    WindowTriggerCondition2,
)
from nidaqmx.errors import DaqError, DaqWriteError
from nidaqmx.stream_readers import CounterReader
from nidaqmx.stream_writers import CounterWriter
from numpy.typing import NDArray

from sim_hardware.daqmx_server.inventory.devices import device_from_text
from tests.support.server_support import Rig, TestSignals, continuous

RATE = 1000.0


@pytest.fixture
def card(rig: Rig) -> str:
    """A card whose lines and counters are real."""
    inventory = rig.bench.inventory
    device = device_from_text("Real=PCIe-6363", inventory)
    inventory.add(replace(device, simulated=False))
    return "Real"


def _change(rig: Rig, line: str, rising: bool) -> float:
    with rig.bench.changed:
        rig.bench.clock.power_on()
        rig.bench.clock.skip(0.1)
        now = rig.bench.clock.now()
        rig.bench.digital_edge(line, now, rising)
    return now


def _watching(rig: Rig, card: str, rising: str, falling: str = "") -> nidaqmx.Task:
    task = rig.task()
    task.di_channels.add_di_chan(f"{card}/port0/line0:1", line_grouping=LineGrouping.CHAN_FOR_ALL_LINES)
    task.timing.cfg_change_detection_timing(rising, falling, AcquisitionType.CONTINUOUS, samps_per_chan=100)
    return task


def test_each_change_of_a_line_that_is_watched_gives_a_sample(rig: Rig, card: str) -> None:
    with _watching(rig, card, f"{card}/port0/line0:1", f"{card}/port0/line1") as task:
        task.start()
        for line, rising in ((0, True), (1, True), (0, False), (1, False)):
            _change(rig, f"{card}/port0/line{line}", rising)
        words = task.read(3)
        left = task.in_stream.avail_samp_per_chan
    assert (words, left) == ([1, 3, 0], 0)


def test_lines_that_another_task_puts_out_are_watched_too(rig: Rig, card: str) -> None:
    with _watching(rig, card, f"{card}/port0/line0") as task, rig.task() as output:
        task.di_channels.all.di_tristate = False  # the lines are also put out
        output.do_channels.add_do_chan(f"{card}/port0/line0")
        output.timing.cfg_samp_clk_timing(RATE, samps_per_chan=10)
        output.write([False, True, False, True, True, False, True, False, False, True])
        task.start()
        output.start()
        output.wait_until_done()
        output.stop()
        assert task.read(4) == [1, 1, 1, 1]
        assert task.in_stream.avail_samp_per_chan == 0


def test_a_change_calls_back(rig: Rig, card: str) -> None:
    heard: queue.Queue[int] = queue.Queue()
    with _watching(rig, card, f"{card}/port0/line0") as task:
        task.register_signal_event(Signal.CHANGE_DETECTION_EVENT, lambda *_: heard.put(1) or 0)
        task.start()
        for rising in (True, False, True):
            _change(rig, f"{card}/port0/line0", rising)
        assert [heard.get(timeout=5) for _ in range(2)] == [1, 1]
        task.stop()
    assert heard.empty()


def test_changes_clock_the_analogue_inputs(rig: Rig, card: str) -> None:
    with _watching(rig, card, f"{card}/port0/line0") as task, rig.task() as analog:
        analog.ai_channels.add_ai_voltage_chan(f"{card}/ai0")
        analog.timing.cfg_samp_clk_timing(RATE, source=f"/{card}/ChangeDetectionEvent", samps_per_chan=2)
        task.control(nidaqmx.constants.TaskMode.TASK_RESERVE)
        analog.start()
        task.start()
        instants = [_change(rig, f"{card}/port0/line0", rising) for rising in (True, False, True)]
        seen = analog.read(2)
    wall = TestSignals().volts(("x/ai0",), np.array([instants[0], instants[2]]))[0]
    assert np.max(np.abs(np.array(seen) - wall)) < 1e-3


def test_a_signal_that_the_task_does_not_make_calls_nobody(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task)
        with pytest.raises(DaqError) as error:
            task.register_signal_event(Signal.CHANGE_DETECTION_EVENT, lambda *_: 0)
    assert error.value.error_code == -200987


@pytest.mark.parametrize("lines", ["", "Real/port9"])
def test_change_detection_needs_a_line(rig: Rig, card: str, lines: str) -> None:
    with _watching(rig, card, lines) as task, pytest.raises(DaqError) as error:
        task.start()
    assert error.value.error_code in (-200077, -200170)


def _paused(rig: Rig, kind: TriggerType) -> nidaqmx.Task:
    task = rig.task()
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    task.timing.cfg_samp_clk_timing(RATE, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=10_000)
    task.triggers.pause_trigger.trig_type = kind
    return task


def _unheld(n: int) -> NDArray[np.float64]:
    """The signal at the clock that nothing holds."""
    return TestSignals().volts(("x/ai0",), np.arange(n) / RATE)[0]


@pytest.mark.parametrize("when", list(ActiveLevel))
def test_an_analogue_level_holds_the_clock(rig: Rig, when: ActiveLevel) -> None:
    with _paused(rig, TriggerType.ANALOG_LEVEL) as task:
        pause = task.triggers.pause_trigger
        pause.anlg_lvl_src, pause.anlg_lvl_lvl, pause.anlg_lvl_when = "cDAQ1Mod1/ai0", 0.3, when
        values = np.array(task.read(300))
    wall = _unheld(1000)
    kept = wall[wall <= 0.3] if when is ActiveLevel.ABOVE else wall[wall >= 0.3]
    assert np.max(np.abs(values - kept[:300])) < 1e-3


def test_with_hysteresis_the_clock_goes_on_only_beyond_it(rig: Rig) -> None:
    with _paused(rig, TriggerType.ANALOG_LEVEL) as task:
        pause = task.triggers.pause_trigger
        pause.anlg_lvl_src, pause.anlg_lvl_lvl, pause.anlg_lvl_hyst = "cDAQ1Mod1/ai0", 0.3, 0.6
        pause.anlg_lvl_when = ActiveLevel.ABOVE
        values = np.array(task.read(300))
    falling = np.diff(values) < 0
    assert values.max() <= 0.3
    assert np.all(values[:-1][falling] <= 0.301)
    assert not np.any((values[:-1][falling] > -0.299) & (np.abs(np.diff(values)[falling]) < 0.1))


def test_an_analogue_window_holds_the_clock(rig: Rig) -> None:
    with _paused(rig, TriggerType.ANALOG_WINDOW) as task:
        pause = task.triggers.pause_trigger
        pause.anlg_win_src, pause.anlg_win_btm, pause.anlg_win_top = "cDAQ1Mod1/ai0", -0.2, 0.2
        pause.anlg_win_when = WindowTriggerCondition2.INSIDE_WINDOW
        first, second = task.read(70), task.read(130)
    wall = _unheld(1000)
    kept = wall[np.abs(wall) > 0.2][:200]
    assert np.max(np.abs(np.array([*first, *second]) - kept)) < 1e-3


def test_a_pause_trigger_listens_to_a_channel_of_the_task(rig: Rig) -> None:
    with _paused(rig, TriggerType.ANALOG_LEVEL) as task:
        task.triggers.pause_trigger.anlg_lvl_src = "cDAQ1Mod1/ai7"
        with pytest.raises(DaqError) as error:
            task.start()
    assert error.value.error_code == -200265


def _measure(rig: Rig, card: str, idle: Level) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """High and low times written to a counter, and those that another one reads."""
    high = np.array([1e-3, 2e-3, 3e-3, 4e-3, 5e-3])
    low = np.array([5e-4, 6e-4, 7e-4, 8e-4, 9e-4])
    with rig.task() as output, rig.task() as counter:
        output.co_channels.add_co_pulse_chan_time(f"{card}/ctr0", idle_state=idle)
        output.timing.cfg_implicit_timing(samps_per_chan=5)
        counter.ci_channels.add_ci_pulse_chan_time(f"{card}/ctr1", min_val=1e-4, max_val=0.01)
        counter.ci_channels.all.ci_pulse_time_term = f"/{card}/Ctr0InternalOutput"
        counter.timing.cfg_implicit_timing(samps_per_chan=4)
        CounterWriter(output.out_stream, auto_start=False).write_many_sample_pulse_time(high, low)
        counter.start()
        output.start()
        high_read, low_read = np.zeros(4), np.zeros(4)
        CounterReader(counter.in_stream).read_many_sample_pulse_time(high_read, low_read, 4, 2)
    return high, low, high_read, low_read


def test_pulses_of_a_buffer_come_one_after_the_other(rig: Rig, card: str) -> None:
    high, low, high_read, low_read = _measure(rig, card, Level.HIGH)
    assert np.allclose(high_read, high[1:])
    assert np.allclose(low_read, low[1:])


def test_from_a_low_idle_state_a_pulse_is_measured_with_the_low_time_of_the_next(rig: Rig, card: str) -> None:
    high, low, high_read, low_read = _measure(rig, card, Level.LOW)
    assert np.allclose(high_read, high[:-1])
    assert np.allclose(low_read, low[1:])


def _once(rig: Rig, card: str, source: str = "") -> nidaqmx.Task:
    task = rig.task()
    task.ao_channels.add_ao_voltage_chan(f"{card}/ao0")
    mode = AcquisitionType.CONTINUOUS
    task.timing.cfg_samp_clk_timing(RATE, source, Edge.RISING, mode, samps_per_chan=100)
    task.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
    return task


def test_what_does_not_fit_before_the_start_is_not_written(rig: Rig, card: str) -> None:
    with _once(rig, card) as task:
        task.out_stream.output_buf_size = 100
        with pytest.raises(DaqWriteError) as error:
            task.write(np.zeros(20_000), auto_start=False)
    assert (error.value.error_code, error.value.samps_per_chan_written) == (-200293, 0)


def test_an_output_that_stands_still_fills_up(rig: Rig, card: str) -> None:
    with _once(rig, card, f"/{card}/Ctr0InternalOutput") as task:
        task.write(np.zeros(1000), auto_start=False)
        task.start()
        with pytest.raises(DaqWriteError) as error:
            task.write(np.zeros(20_000), timeout=0.2)
    assert (error.value.error_code, error.value.samps_per_chan_written) == (-200292, 8191)


def test_an_output_that_runs_takes_more_as_it_goes_on(rig: Rig, card: str) -> None:
    with _once(rig, card) as task:
        task.write(np.zeros(1000), auto_start=False)
        task.start()
        assert task.write(np.zeros(20_000), timeout=60.0) == 20_000
        assert task.out_stream.total_samp_per_chan_generated >= 20_000 - 8191
