"""Start and reference triggers: digital, analogue edge, window; and whose sample clock a task takes."""

from __future__ import annotations

import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, Slope, TriggerType, WindowTriggerCondition1
from nidaqmx.errors import DaqError, DaqReadError

from tests.support.server_support import Rig, TestSignals

RATE = 1000.0


def _finite(rig: Rig, samples: int = 300) -> nidaqmx.Task:
    task = rig.task()
    task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0", name_to_assign_to_channel="v")
    task.timing.cfg_samp_clk_timing(RATE, samps_per_chan=samples)
    return task


def _signal(first_s: float, n: int) -> np.ndarray:
    return TestSignals().volts(("x/ai0",), first_s + np.arange(n) / RATE)[0]


def test_analog_edge_start(rig: Rig) -> None:
    """The first sample is the first at or above the level, on a rising slope."""
    with _finite(rig) as task:
        task.triggers.start_trigger.cfg_anlg_edge_start_trig("v", Slope.RISING, 0.8)
        got = np.array(task.read(300))
    times = np.arange(1000) / RATE
    wave = TestSignals().volts(("x/ai0",), times)[0]
    first = next(k for k in range(1, 1000) if wave[k] >= 0.8 > wave[k - 1])
    assert np.max(np.abs(got - _signal(times[first], 300))) < 3e-4


def test_falling_edge_with_hysteresis_ignores_the_signal_before_it_rearms(rig: Rig) -> None:
    """Below level + hysteresis the trigger is not armed: a dip that starts there does not count."""
    with _finite(rig, 20) as task:
        trigger = task.triggers.start_trigger
        trigger.cfg_anlg_edge_start_trig("v", Slope.FALLING, -0.5)
        trigger.anlg_edge_hyst = 1.2
        got = np.array(task.read(20))
    # The sine must first have been above 0.7, then fallen through −0.5: (π + asin 0.5) / (2π 5 Hz).
    crossing = (np.pi + np.arcsin(0.5)) / (2 * np.pi * 5.0)
    first = np.ceil(crossing * RATE) / RATE
    assert np.max(np.abs(got - _signal(first, 20))) < 3e-4


@pytest.mark.parametrize(
    ("when", "level_before", "inside"),
    [
        (WindowTriggerCondition1.ENTERING_WINDOW, False, True),
        (WindowTriggerCondition1.LEAVING_WINDOW, True, False),
    ],
)
def test_window_start(rig: Rig, when: WindowTriggerCondition1, level_before: bool, inside: bool) -> None:
    with _finite(rig, 20) as task:
        task.triggers.start_trigger.cfg_anlg_window_start_trig(0.9, 0.5, "v", when)
        first = task.read(20)[0]
    assert (0.5 <= first <= 0.9) is inside


def test_digital_start_waits_for_the_edge(rig: Rig) -> None:
    """No sample before the edge (−200284); the acquisition begins with it."""
    with _finite(rig, 50) as task:
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1/PFI0")
        task.start()
        with pytest.raises(DaqReadError) as caught:
            task.read(10, timeout=0.5)
        assert (caught.value.error_code, caught.value.samps_per_chan_read) == (-200284, 0)
        instant = rig.control.command("digital_edge", terminal="/cDAQ1/PFI0")["time_s"]
        got = np.array(task.read(50))
    assert np.max(np.abs(got - _signal(instant, 50))) < 3e-4


def test_digital_reference_trigger(rig: Rig) -> None:
    """Samples from before and after the edge; nothing may be read until all are there."""
    with _finite(rig, 300) as task:
        task.triggers.reference_trigger.cfg_dig_edge_ref_trig("/cDAQ1/PFI1", pretrigger_samples=100)
        assert task.triggers.reference_trigger.trig_type == TriggerType.DIGITAL_EDGE
        task.start()
        with pytest.raises(DaqReadError):
            task.read(300, timeout=0.7)
        instant = rig.control.command("digital_edge", terminal="/cDAQ1/PFI1")["time_s"]
        got = np.array(task.read(300))
        assert task.is_task_done()
    trigger = int(np.floor(instant * RATE + 1e-6)) + 1
    assert np.max(np.abs(got - _signal((trigger - 100) / RATE, 300))) < 3e-4


def test_analog_reference_trigger_after_its_pretrigger_samples(rig: Rig) -> None:
    """Crossings before the pre-trigger samples are complete do not count."""
    with _finite(rig, 400) as task:
        task.triggers.reference_trigger.cfg_anlg_edge_ref_trig("v", 250, Slope.RISING, 0.1)
        got = np.array(task.read(400, timeout=10.0))
    assert got[249] < 0.1 <= got[250]
    wave = _signal(0.0, 1000)
    first = next(k for k in range(251, 1000) if wave[k] >= 0.1 > wave[k - 1])
    assert np.max(np.abs(got - _signal((first - 250) / RATE, 400))) < 3e-4


def test_window_reference_trigger(rig: Rig) -> None:
    with _finite(rig, 100) as task:
        task.triggers.reference_trigger.cfg_anlg_window_ref_trig(
            "v", 0.9, 0.5, 50, WindowTriggerCondition1.ENTERING_WINDOW
        )
        got = np.array(task.read(100, timeout=10.0))
    assert 0.5 <= got[50] <= 0.9
    assert not 0.5 <= got[49] <= 0.9


def test_trigger_mistakes(rig: Rig) -> None:
    """A source that is no channel of the task; a reference trigger on a continuous task."""
    with _finite(rig) as task:
        task.triggers.start_trigger.cfg_anlg_edge_start_trig("nothing", Slope.RISING, 0.5)
        with pytest.raises(DaqError) as caught:
            task.start()
        assert caught.value.error_code == -200265
        task.triggers.start_trigger.disable_start_trig()
        task.timing.cfg_samp_clk_timing(RATE, sample_mode=AcquisitionType.CONTINUOUS)
        task.triggers.reference_trigger.cfg_dig_edge_ref_trig("/cDAQ1/PFI0", 10)
        with pytest.raises(DaqError) as caught:
            task.start()
        assert caught.value.error_code == -200358
        task.triggers.reference_trigger.disable_ref_trig()
        task.start()


def test_exported_start_trigger_starts_another_task(rig: Rig) -> None:
    """A task that exports its start trigger to a PFI line starts whoever listens there."""
    first, second = rig.task("first"), rig.task("second")
    try:
        for task, module in ((first, 1), (second, 2)):
            task.ai_channels.add_ai_voltage_chan(f"cDAQ1Mod{module}/ai0")
            task.timing.cfg_samp_clk_timing(RATE, sample_mode=AcquisitionType.CONTINUOUS)
        first.export_signals.start_trig_output_term = "/cDAQ1/PFI1"
        assert first.export_signals.start_trig_output_term == "/cDAQ1/PFI1"
        second.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1/PFI1")
        second.start()
        rig.skip(0.3)
        first.start()
        assert np.array_equal(second.read(50), first.read(50))
    finally:
        second.close()
        first.close()


def test_an_idle_task_left_on_the_chassis_does_not_take_over_the_shared_clock(rig: Rig) -> None:
    with rig.task("left behind") as idle, rig.task("master") as master, rig.task("slave") as slave:
        idle.ai_channels.add_ai_voltage_chan("cDAQ1Mod5/ai0")
        idle.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=100)
        master.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        master.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=100)
        slave.ai_channels.add_ai_voltage_chan("cDAQ1Mod2/ai0")
        slave.timing.cfg_samp_clk_timing(1000.0, source="/cDAQ1/te0/SampleClock", samps_per_chan=100)
        slave.start()
        master.start()
        assert len(slave.read(100, timeout=2.0)) == 100


def test_a_reserved_master_is_found_before_it_runs(rig: Rig) -> None:
    with rig.task("master") as master, rig.task("slave") as slave:
        master.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        master.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=50)
        slave.ai_channels.add_ai_voltage_chan("cDAQ1Mod2/ai0")
        slave.timing.cfg_samp_clk_timing(1000.0, source="/cDAQ1/ai/SampleClock", samps_per_chan=50)
        slave.start()
        assert not slave.is_task_done()
        master.start()
        assert len(slave.read(50, timeout=2.0)) == 50
