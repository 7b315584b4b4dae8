"""Sensors' data sheets, digital waveforms, lines that are read back, counters that wait for an edge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nidaqmx.constants import (
    AccelSensitivityUnits,
    BridgeConfiguration,
    Edge,
    LineGrouping,
    LoggingMode,
    LoggingOperation,
    RTDType,
    StrainGageRosetteType,
    ThermocoupleType,
    TriggerType,
)
from nidaqmx.constants import StrainGageRosetteMeasurementType as Quantity
from nidaqmx.errors import DaqError
from nidaqmx.system.physical_channel import PhysicalChannel
from nidaqmx.system.watchdog import WatchdogTask
from nitypes.waveform import DigitalWaveform
from nptdms import TdmsFile

from sim_hardware.daqmx_server.inventory.devices import module_device
from tests.support.server_support import Rig, continuous
from tests.support.teds_file import as_bits, data_sheet_file, single

CARD = "PXI1Slot3"


def _sensor(rig: Rig, channel: str, file: Path) -> PhysicalChannel:
    place = PhysicalChannel(channel, grpc_options=rig.options())
    place.configure_teds(str(file))
    return place


def test_a_sensor_s_data_sheet_tells_who_made_it(rig: Rig, tmp_path: Path) -> None:
    place = _sensor(rig, f"{CARD}/ai0", data_sheet_file(tmp_path, 30, (0, 6)))

    assert (place.teds_mfg_id, place.teds_model_num, place.teds_serial_num) == (17, 1, 12345)
    assert (place.teds_version_letter, place.teds_version_num) == ("A", 1)
    assert place.teds_template_ids == [30]
    assert list(place.teds_bit_stream[:4]) == [17, 64, 0, 32]


def test_an_accelerometer_s_sensitivity_comes_from_its_data_sheet(rig: Rig, tmp_path: Path) -> None:
    sensitivity_v_per_m_s2 = 5e-7 * 1.0003**40000
    _sensor(rig, "cDAQ1Mod3/ai0", data_sheet_file(tmp_path, 25, (0, 1), (0, 1), (40000, 16)))

    with rig.task() as task:
        channel = task.ai_channels.add_teds_ai_accel_chan("cDAQ1Mod3/ai0", min_val=-5.0, max_val=5.0)
        assert channel.ai_teds_is_teds
        assert channel.ai_accel_sensitivity == pytest.approx(9.80665 * sensitivity_v_per_m_s2)
        assert channel.ai_accel_sensitivity_units == AccelSensitivityUnits.VOLTS_PER_G


def test_temperature_sensors_bring_their_curves(rig: Rig, tmp_path: Path) -> None:
    couple = data_sheet_file(tmp_path, 36, (0, 36), (3, 4))
    resistor = data_sheet_file(tmp_path, 37, (0, 56), (1, 3))
    thermistor = data_sheet_file(tmp_path, 38, (0, 78), single(1.3e-3), single(2.3e-4), single(1e-7))
    for number, file in enumerate((couple, resistor, thermistor)):
        _sensor(rig, f"{CARD}/ai{number}", file)

    with rig.task() as task:
        add = task.ai_channels
        assert add.add_teds_ai_thrmcpl_chan(f"{CARD}/ai0").ai_thrmcpl_type == ThermocoupleType.K
        rtd = add.add_teds_ai_rtd_chan(f"{CARD}/ai1")
        assert (rtd.ai_rtd_type, rtd.ai_rtd_a) == (RTDType.CUSTOM, 3.9083e-3)
        ntc = add.add_teds_ai_thrmstr_chan_iex(f"{CARD}/ai2")
        assert (ntc.ai_thrmstr_a, ntc.ai_thrmstr_c) == (pytest.approx(1.3e-3), pytest.approx(1e-7))


def test_a_bridge_s_impedance_and_unit_come_from_its_data_sheet() -> None:
    from sim_hardware.daqmx_server.channels.teds import DataSheet
    from sim_hardware.daqmx_server.channels.teds_templates import attributes_from

    fields = ((5, 6), (0, 64), (2, 2), (0, 64), (2, 2), (3490, 18))
    bits = as_bits((17, 14), (1, 15), (1, 5), (1, 6), (1, 24), (0, 2), (33, 8), *fields, (0, 6))
    stream = bytes(np.packbits(bits, bitorder="little"))

    read = attributes_from(DataSheet.from_stream(stream))

    assert read["AI_BRIDGE_CFG"] == BridgeConfiguration.FULL_BRIDGE.value
    assert read["AI_BRIDGE_NOM_RESISTANCE"] == pytest.approx(350.0)
    assert read["AI_TEDS_UNITS"] == "forcelb"


def test_a_channel_from_a_data_sheet_needs_one(rig: Rig) -> None:
    with rig.task() as task, pytest.raises(DaqError) as error:
        task.ai_channels.add_teds_ai_voltage_chan(f"{CARD}/ai5")
    assert error.value.error_code == -200709


def test_a_file_that_is_no_data_sheet_is_refused(rig: Rig, tmp_path: Path) -> None:
    (tmp_path / "noise.ted").write_bytes(bytes(300))
    with pytest.raises(DaqError) as error:
        _sensor(rig, f"{CARD}/ai0", tmp_path / "noise.ted")
    assert error.value.error_code == -200826


def test_columns_of_a_digital_waveform_are_lines_as_given_and_ports_from_the_top(rig: Rig) -> None:
    with rig.task() as task:
        lines = f"{CARD}/port0/line0:2, {CARD}/port1"
        task.di_channels.add_di_chan(lines, line_grouping=LineGrouping.CHAN_FOR_ALL_LINES)
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=10)
        waveform = task.read_waveform(10)

    assert isinstance(waveform, DigitalWaveform)
    names = waveform.extended_properties["NI_LineNames"].split(", ")
    assert names[:4] == [f"{CARD}/port0/line{i}" for i in range(3)] + [f"{CARD}/port1/line7"]
    assert waveform.data[1].tolist() == [1, 0, 0] + [0] * 7 + [1]  # sample 1: bit 0 of each group
    assert waveform.signals[0].name == f"{CARD}/port1/line0"


def test_a_digital_waveform_with_other_lines_than_the_channel_is_refused(rig: Rig) -> None:
    with rig.task() as task:
        task.do_channels.add_do_chan(f"{CARD}/port0/line0", line_grouping=LineGrouping.CHAN_PER_LINE)
        with pytest.raises(DaqError, match="number of lines in the data"):
            task.write_waveform(DigitalWaveform(5, 3))


def test_a_channel_of_more_than_32_lines_is_read_whole(rig: Rig) -> None:
    with rig.task() as task:
        lines = f"{CARD}/port0, {CARD}/port1"
        task.di_channels.add_di_chan(lines, line_grouping=LineGrouping.CHAN_FOR_ALL_LINES)
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=4)
        data = task.read_waveform(4).data
    # Sample 1: the lowest line of each eight. Columns: port0 from line 31 down, then port1 from line 7 down.
    assert np.flatnonzero(data[1]).tolist() == [7, 15, 23, 31, 39]


def test_a_pulse_train_waits_for_its_arm_start_edge(rig: Rig) -> None:
    clock, pulses, count = rig.task("clock"), rig.task("pulses"), rig.task("count")
    with clock, pulses, count:
        for task, number in ((clock, 0), (pulses, 1)):
            task.co_channels.add_co_pulse_chan_freq(f"{CARD}/ctr{number}", freq=1000.0)
            task.timing.cfg_implicit_timing(samps_per_chan=20)
        arm = pulses.triggers.arm_start_trigger
        arm.trig_type, arm.dig_edge_edge = TriggerType.DIGITAL_EDGE, Edge.RISING
        arm.dig_edge_src = f"/{CARD}/Ctr0InternalOutput"
        channel = count.ci_channels.add_ci_count_edges_chan(f"{CARD}/ctr2")
        channel.ci_count_edges_term = f"/{CARD}/Ctr1InternalOutput"
        count.timing.cfg_samp_clk_timing(
            1000.0, source=f"/{CARD}/Ctr0InternalOutput", active_edge=Edge.FALLING, samps_per_chan=20
        )
        count.start()
        pulses.start()
        rig.skip(0.005)
        clock.start()
        assert count.read(20) == list(range(1, 21))


def test_a_finite_pulse_train_clocks_as_many_samples_as_it_has_pulses(rig: Rig) -> None:
    clock, read = rig.task("clock"), rig.task("read")
    with clock, read:
        clock.co_channels.add_co_pulse_chan_freq(f"{CARD}/ctr0", freq=1000.0)
        clock.timing.cfg_implicit_timing(samps_per_chan=100)
        read.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0", min_val=-10.0, max_val=10.0)
        continuous(read, 1000.0)
        read.timing.samp_clk_src = f"/{CARD}/Ctr0InternalOutput"
        read.start()
        clock.start()
        rig.skip(0.5)
        clock.wait_until_done()
        clock.stop()
        assert len(read.read(75)) == 75
        with pytest.raises(DaqError) as error:
            read.read(75, timeout=0.1)
    assert error.value.error_code == -200284
    assert error.value.samps_per_chan_read == 25


def test_a_logged_file_says_when_its_first_sample_was_taken(rig: Rig, tmp_path: Path) -> None:
    with rig.task("wall") as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.timing.first_samp_timestamp_enable = True
        task.in_stream.configure_logging(
            tmp_path / "one.tdms", LoggingMode.LOG_AND_READ, "", LoggingOperation.CREATE_OR_REPLACE
        )
        task.start()
        task.read(50)
        started = task.timing.first_samp_timestamp_val
    with TdmsFile.open(tmp_path / "one.tdms") as file:
        stamp = file["wall"].channels()[0].properties["wf_start_time"]
    assert abs(stamp - np.datetime64(started.replace(tzinfo=None), "us")) < np.timedelta64(1, "ms")


def test_the_sine_of_an_open_terminal_stays_within_the_channel_s_limits() -> None:
    from sim_hardware.daqmx_server.channels.converter import Converter
    from sim_hardware.daqmx_server.timing.sample_times import SampleTimes
    from sim_hardware.daqmx_server.timing.sampling import Input, Sampler

    class Open:
        def volts(self, terminals: tuple[str, ...], times_s: np.ndarray) -> np.ndarray:
            return np.full((len(terminals), len(times_s)), np.nan)

        def distort(self, terminals: object, times_s: np.ndarray, volts: np.ndarray) -> np.ndarray:
            return volts

    entry = Input("Dev1/ai0", Converter(-5.0, 5.0, 16), 0.0, shown=(-2.5, 2.5))
    codes = Sampler(Open(), Open(), [entry], SampleTimes(0.0, 1000.0)).codes(0, 200)
    assert -16384 <= codes.min() < -16300
    assert 16300 < codes.max() <= 16383


def test_a_rosette_has_a_channel_for_each_quantity_it_is_asked_for(rig: Rig) -> None:
    rig.bench.inventory.add(module_device("Bridges", "PXIe-4331", "", 4))
    with rig.task() as task:
        task.ai_channels.add_ai_rosette_strain_gage_chan(
            "Bridges/ai0:2",
            StrainGageRosetteType.DELTA,
            0.0,
            [Quantity.PRINCIPAL_STRAIN_1, Quantity.MAX_SHEAR_STRAIN],
        )
        assert task.channel_names == ["rosette0_principalStrain1", "rosette0_maxShearStrain"]
        assert task.ai_channels[0].ai_rosette_strain_gage_rosette_type == StrainGageRosetteType.DELTA
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=10)
        assert np.shape(task.read(10)) == (2, 10)


def test_a_rosette_of_the_wrong_number_of_gauges_is_refused(rig: Rig) -> None:
    rig.bench.inventory.add(module_device("Bridges", "PXIe-4331", "", 4))
    with rig.task() as task, pytest.raises(DaqError, match="two strain gauges"):
        task.ai_channels.add_ai_rosette_strain_gage_chan(
            "Bridges/ai0:2", StrainGageRosetteType.TEE, 0.0, [Quantity.PRINCIPAL_STRAIN_1]
        )


def test_a_watchdog_s_time_runs_from_its_start(rig: Rig) -> None:
    rig.skip(100.0)
    with WatchdogTask(CARD, timeout=0.8, grpc_options=rig.options()) as task:
        task.start()
        assert not task.expired
        rig.skip(1.0)
        assert task.expired


def test_a_chassis_counts_with_counters_of_its_own(rig: Rig) -> None:
    with rig.task() as task:
        channel = task.ci_channels.add_ci_count_edges_chan("cDAQ1/_ctr0", initial_count=10)
        assert channel.ci_count == 10
        task.start()
        assert task.read() == 10
