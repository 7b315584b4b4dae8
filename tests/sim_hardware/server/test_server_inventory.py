"""What a foreign program finds: system, devices, physical channels, channel and timing attributes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from nidaqmx.constants import (
    AccelSensitivityUnits,
    AccelUnits,
    AcquisitionType,
    BusType,
    Coupling,
    Edge,
    ExcitationSource,
    LengthUnits,
    LVDTSensitivityUnits,
    ProductCategory,
    ReadRelativeTo,
    TerminalConfiguration,
    UsageTypeAI,
    VoltageUnits,
)
from nidaqmx.errors import DaqError
from nptdms import TdmsFile

from sim_hardware.daqmx_server.errors import Code, error_text
from tests.support.server_support import Rig, TestSignals, continuous


def code_of(call: Callable[[], object]) -> int:
    with pytest.raises(DaqError) as caught:
        call()
    assert f"Status Code: {caught.value.error_code}" in str(caught.value)
    return caught.value.error_code


def test_system_and_devices(rig: Rig) -> None:
    system = rig.system()
    assert tuple(system.driver_version) >= (24, 5, 0)
    assert [device.name for device in system.devices][:3] == ["cDAQ1", "cDAQ1Mod1", "cDAQ1Mod2"]
    chassis = system.devices["cDAQ1"]
    assert chassis.product_type == "cDAQ-9178"
    assert chassis.product_category == ProductCategory.COMPACT_DAQ_CHASSIS
    assert [module.name for module in chassis.chassis_module_devices] == [f"cDAQ1Mod{n}" for n in range(1, 6)]
    module = system.devices["cDAQ1Mod3"]
    assert (module.product_type, module.serial_num) == ("NI 9234", 0x01AB0003)
    assert (module.compact_daq_chassis_device.name, module.compact_daq_slot_num) == ("cDAQ1", 3)
    assert module.bus_type == BusType.COMPACT_DAQ
    assert module.is_simulated
    assert module.ai_voltage_rngs == [-5.0, 5.0]
    assert module.ai_simultaneous_sampling_supported
    assert module.ai_max_single_chan_rate == pytest.approx(51.2e3)
    assert UsageTypeAI.ACCELERATION_ACCELEROMETER_CURRENT_INPUT in module.ai_meas_types
    assert [channel.name for channel in module.ai_physical_chans] == [f"cDAQ1Mod3/ai{n}" for n in range(4)]
    assert len(module.ao_physical_chans) == len(module.di_lines) == len(module.co_physical_chans) == 0
    module.self_test_device()
    mux = system.devices["cDAQ1Mod1"]
    assert not mux.ai_simultaneous_sampling_supported
    assert mux.ai_max_multi_chan_rate == 250e3
    assert mux.ai_voltage_rngs == [-0.2, 0.2, -1.0, 1.0, -5.0, 5.0, -10.0, 10.0]
    terms = {n: mux.ai_physical_chans[n].ai_term_cfgs for n in (0, 8)}
    assert TerminalConfiguration.DIFF in terms[0]
    assert TerminalConfiguration.DIFF not in terms[8]
    assert code_of(lambda: system.devices["cDAQ7"].product_type) == -200220


def test_channel_attributes_read_back(rig: Rig) -> None:
    """Limits read back as the range that the module takes for them; what was only kept, as it was given."""
    with rig.task() as task:
        channel = task.ai_channels.add_ai_voltage_chan(
            "cDAQ1Mod1/ai16", "pot", TerminalConfiguration.RSE, min_val=-3.0, max_val=2.0
        )
        assert (channel.name, channel.physical_channel.name) == ("pot", "cDAQ1Mod1/ai16")
        assert (channel.ai_min, channel.ai_max) == (-5.0, 5.0)
        assert (channel.ai_rng_low, channel.ai_rng_high) == (-5.0, 5.0)
        assert channel.ai_term_cfg == TerminalConfiguration.RSE
        assert channel.ai_meas_type == UsageTypeAI.VOLTAGE
        assert channel.ai_voltage_units == VoltageUnits.VOLTS
        assert (channel.ai_resolution, channel.ai_raw_samp_size) == (16.0, 16)
        assert channel.ai_coupling == Coupling.DC
        channel.ai_max = 7.0
        assert (channel.ai_max, channel.ai_rng_high) == (10.0, 10.0)
        del channel.ai_max
        assert code_of(lambda: channel.ai_max) == -200695
        channel.ai_max = 2.0
        channel.ai_rng_high = 10.0
        assert (channel.ai_rng_low, channel.ai_rng_high) == (-10.0, 10.0)
        channel.description = "wire potentiometer at the top"
        assert channel.description == "wire potentiometer at the top"
        assert code_of(lambda: channel.ai_lvdt_sensitivity) == -200452
        two = task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1")
        two.ai_min = -0.15
        two.ai_max = 0.15
        assert [task.ai_channels[n].ai_rng_high for n in (1, 2)] == [0.2, 0.2]
        assert task.channel_names == ["pot", "cDAQ1Mod1/ai0", "cDAQ1Mod1/ai1"]
        assert [device.name for device in task.devices] == ["cDAQ1Mod1"]


def test_timing_and_read_attributes(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:15", terminal_config=TerminalConfiguration.RSE)
        assert task.timing.samp_clk_rate == 1000.0
        task.timing.cfg_samp_clk_timing(
            3000.0, sample_mode=AcquisitionType.CONTINUOUS, active_edge=Edge.FALLING
        )
        assert task.timing.samp_clk_rate == pytest.approx(80e6 / 26666)
        assert task.timing.samp_quant_samp_mode == AcquisitionType.CONTINUOUS
        assert task.timing.samp_clk_active_edge == Edge.FALLING
        assert task.timing.samp_clk_max_rate == pytest.approx(250e3 / 16)
        assert task.timing.ai_conv_rate == pytest.approx(1 / 14e-6)
        assert task.timing.samp_clk_term == "/cDAQ1/ai/SampleClock"
        assert task.in_stream.input_buf_size == 10_000
        task.timing.samp_quant_samp_per_chan = 50_000
        assert task.in_stream.input_buf_size == 50_000
        task.in_stream.input_buf_size = 12_345
        assert task.in_stream.input_buf_size == 12_345
        assert task.in_stream.relative_to == ReadRelativeTo.CURRENT_READ_POSITION
        assert task.in_stream.num_chans == 16
        assert task.in_stream.raw_data_width == 32
        task.start()
        assert code_of(lambda: setattr(task.timing, "samp_clk_rate", 100.0)) == -200557


def test_iepe_accelerometer_reads_acceleration(rig: Rig) -> None:
    """Volts become m/s² by the sensitivity; the default excitation of 4 mA is refused by the NI 9234."""
    with rig.task() as task:
        channel = task.ai_channels.add_ai_accel_chan(
            "cDAQ1Mod3/ai0",
            min_val=-5,
            max_val=5,
            units=AccelUnits.METERS_PER_SECOND_SQUARED,
            sensitivity=1000.0,
            sensitivity_units=AccelSensitivityUnits.MILLIVOLTS_PER_G,
            current_excit_source=ExcitationSource.INTERNAL,
            current_excit_val=0.004,
        )
        continuous(task)
        assert code_of(task.start) == -200077
        channel.ai_excit_val = 0.002
        rate = task.timing.samp_clk_rate
        got = np.array(task.read(500))
        assert channel.ai_coupling == Coupling.AC
        assert channel.ai_rng_high == 5.0
    lag = (40 + 5 / 512) / rate + 2.6e-6
    volts = TestSignals().volts(("x/ai0",), np.arange(500) / rate - lag)[0]
    assert np.max(np.abs(got - volts * 9.80665)) < 1e-5


def test_native_lvdt_reads_metres(rig: Rig) -> None:
    """The source is volts per volt of excitation; the PXIe-4340 divides by the sensitivity."""
    with rig.task() as task:
        channel = task.ai_channels.add_ai_pos_lvdt_chan(
            "PXI1Slot2/ai0",
            min_val=-0.02,
            max_val=0.02,
            units=LengthUnits.METERS,
            sensitivity=100.0,
            sensitivity_units=LVDTSensitivityUnits.MILLIVOLTS_PER_VOLT_PER_MILLIMETER,
            voltage_excit_source=ExcitationSource.INTERNAL,
            voltage_excit_val=3.0,
            voltage_excit_freq=2500.0,
        )
        continuous(task)
        assert task.timing.samp_clk_rate == 4000.0
        got = np.array(task.read(500))
        assert channel.ai_lvdt_sensitivity == 100.0
    ratio = TestSignals().volts(("x/ai0",), np.arange(500) / 4000.0)[0]
    assert np.max(np.abs(got - ratio / 100.0)) < 1e-6


def test_voltage_with_excitation_can_be_ratiometric(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan_with_excit(
            "cDAQ1Mod1/ai0",
            min_val=-1.0,
            max_val=1.0,
            voltage_excit_source=ExcitationSource.EXTERNAL,
            voltage_excit_val=5.0,
            use_excit_for_scaling=True,
        )
        continuous(task)
        got = np.array(task.read(200))
    volts = TestSignals().volts(("x/ai0",), np.arange(200) / 4000.0)[0]
    assert np.max(np.abs(got - volts / 5.0)) < 1e-4


def test_mistakes_have_ni_codes(rig: Rig) -> None:
    with rig.task("t") as task:
        add = task.ai_channels.add_ai_voltage_chan
        assert code_of(lambda: add("Dev9/ai0")) == -200220
        assert code_of(lambda: add("cDAQ1Mod1/ai32")) == -200170
        assert code_of(lambda: add("cDAQ1Mod1/di0")) == -200170
        assert code_of(lambda: add("PXI1Slot2/ai0")) == -200431
        assert code_of(lambda: task.ai_channels.add_ai_rtd_chan("cDAQ1Mod1/ai0")) == -200431
        add("cDAQ1Mod1/ai0")
        assert code_of(lambda: add("cDAQ1Mod1/ai0")) == -200489
        wide = add("cDAQ1Mod1/ai1", min_val=-20, max_val=20)
        with pytest.raises(DaqError) as caught:
            task.start()
        for line in (
            "Property: DAQmx_AI_Max",
            "Requested Value: 20.0",
            "Maximum Value: 10.0",
            "Task Name: t",
        ):
            assert line in str(caught.value)
        wide.ai_min, wide.ai_max = -10, 10
        differential = add("cDAQ1Mod1/ai8", terminal_config=TerminalConfiguration.DIFF)
        assert code_of(task.start) == -200077
        differential.ai_term_cfg = TerminalConfiguration.RSE
        task.timing.cfg_samp_clk_timing(200e3, sample_mode=AcquisitionType.CONTINUOUS)
        assert code_of(task.start) == -200332
        task.timing.cfg_samp_clk_timing(1e3, sample_mode=AcquisitionType.CONTINUOUS)
        task.start()
        assert code_of(task.start) == -200479
    with rig.task() as empty:
        assert code_of(empty.start) == -200478
        assert code_of(lambda: empty._interpreter.read_analog_scalar_f64(empty._handle, 1.0)) == -200460


def test_a_device_belongs_to_one_task(rig: Rig) -> None:
    """Reserved by the first task: −50103 for the second, until the first lets go."""
    from nidaqmx.constants import TaskMode

    first, second = rig.task("first"), rig.task("second")
    try:
        for task, channel in ((first, "ai0"), (second, "ai1")):
            task.ai_channels.add_ai_voltage_chan(f"cDAQ1Mod1/{channel}")
            continuous(task)
        first.control(TaskMode.TASK_RESERVE)
        assert code_of(second.start) == -50103
        first.control(TaskMode.TASK_UNRESERVE)
        second.start()
        assert code_of(first.start) == -50103
        second.stop()
        first.start()
    finally:
        first.close()
        second.close()


def test_reset_server_frees_leaked_tasks(rig: Rig) -> None:
    import session_pb2
    import session_pb2_grpc

    leaked = rig.task("leaked")
    leaked.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
    continuous(leaked)
    leaked.start()
    utilities = session_pb2_grpc.SessionUtilitiesStub(rig.channel)
    devices = utilities.EnumerateDevices(session_pb2.EnumerateDevicesRequest()).devices
    assert ("cDAQ1Mod3", "NI 9234", "01AB0003") in [(d.name, d.model, d.serial_number) for d in devices]
    assert utilities.ResetServer(session_pb2.ResetServerRequest()).is_server_reset
    assert code_of(lambda: leaked.read(1)) == -200088
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        assert isinstance(task.read(), float)


def test_same_name_attaches_and_leaves_the_task_to_its_owner(rig: Rig) -> None:
    with rig.task("shared") as owner:
        owner.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        with rig.task("shared") as guest:
            assert guest.channel_names == ["cDAQ1Mod1/ai0"]
        assert owner.channel_names == ["cDAQ1Mod1/ai0"]
    with rig.task("shared") as fresh:
        assert fresh.channel_names == []


def test_calls_that_are_not_simulated_say_so(rig: Rig) -> None:
    from nidaqmx.errors import RpcError

    with pytest.raises(RpcError, match="not supported"):
        rig.system().set_analog_power_up_states("PXI1Slot3", [])


def test_ni_daqmx_records_by_itself(rig: Rig, tmp_path: Path) -> None:
    """TDMS logging: what reads hand out, none of it while paused, in as many files as asked for."""
    from nidaqmx.constants import LoggingMode, LoggingOperation

    with rig.task("wall") as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1", name_to_assign_to_channel="a, b")
        continuous(task, 1000.0)
        task.in_stream.configure_logging(
            tmp_path / "one.tdms", LoggingMode.LOG_AND_READ, "", LoggingOperation.CREATE_OR_REPLACE
        )
        task.in_stream.logging_pause = True
        task.start()
        task.read(30)
        task.in_stream.logging_pause = False
        one = np.concatenate([np.array(task.read(50)), np.array(task.read(50))], axis=1)
        task.in_stream.start_new_file(str(tmp_path / "two.tdms"))
        two = np.array(task.read(20))
    for name, expected, offset in (("one", one, 0.03), ("two", two, 0.13)):
        with TdmsFile.open(tmp_path / f"{name}.tdms") as file:
            for row, channel in enumerate(file["wall"].channels()):
                assert channel.name == "ab"[row]
                assert np.array_equal(channel[:], expected[row])
                assert channel.properties["wf_increment"] == 1e-3
                assert channel.properties["unit_string"] == "Volts"
            if name == "two":
                assert channel.properties["wf_start_offset"] == pytest.approx(offset)


def test_every_code_of_the_server_is_ni_s_and_has_a_sentence() -> None:
    from nidaqmx.error_codes import DAQmxErrors

    for code in Code:
        assert DAQmxErrors(code.value)
        assert len(error_text(code)) > 20
    assert error_text(-200081) == "Sample rate num chans convert period combo."
    assert error_text(-123) == ""
