"""Whose sample clock a task takes: of the task that drives the line, not of one that only could."""

from __future__ import annotations

from tests.support.server_support import Rig


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
