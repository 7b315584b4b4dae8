"""Attributes through the real client: who has them, what they take, what reads back, what is refused."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator

import nidaqmx
import pytest
from nidaqmx._grpc_time import convert_time_to_timestamp
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx._stubs import nidaqmx_pb2_grpc
from nidaqmx.constants import (
    ADCTimingMode,
    Coupling,
    ExportAction,
    Slope,
    TaskMode,
    TerminalConfiguration,
    TimestampEvent,
    TriggerType,
)
from nidaqmx.errors import DaqError
from nidaqmx.task.channels import AIChannel

from sim_hardware.daqmx_server.inventory.devices import module_device
from tests.support.server_support import Rig

UNSUPPORTED = -200452
CARD = "PXI1Slot3"


def refused(action: Callable[[], object]) -> int:
    """NI's code with which an action is refused."""
    with pytest.raises(DaqError) as caught:
        action()
    return int(caught.value.error_code)


@pytest.fixture
def task(rig: Rig) -> Iterator[nidaqmx.Task]:
    for slot, product in ((6, "NI 9213"), (7, "NI 9237")):
        rig.bench.inventory.add(module_device(f"cDAQ1Mod{slot}", product, "cDAQ1", slot))
    with rig.task() as task:
        yield task


@pytest.mark.parametrize(
    "attribute",
    [
        "ai_adc_timing_mode",
        "ai_bridge_cfg",
        "ai_excit_val",
        "ai_temp_units",
        "ai_lowpass_enable",
        "ai_dig_fltr_enable",
        "ai_resistance_cfg",
        "ai_open_thrmcpl_detect_enable",
    ],
)
def test_a_multifunction_card_s_voltage_has_no_attribute_of_other_hardware(
    task: nidaqmx.Task, attribute: str
) -> None:
    channel = task.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0")
    assert refused(lambda: getattr(channel, attribute)) == UNSUPPORTED


def test_a_product_keeps_the_attributes_of_what_it_measures(task: nidaqmx.Task) -> None:
    thermocouple: AIChannel = task.ai_channels.add_ai_thrmcpl_chan("cDAQ1Mod6/ai0")
    thermocouple.ai_adc_timing_mode = ADCTimingMode.HIGH_SPEED
    thermocouple.ai_open_thrmcpl_detect_enable = True
    assert thermocouple.ai_adc_timing_mode is ADCTimingMode.HIGH_SPEED
    assert thermocouple.ai_open_thrmcpl_detect_enable

    bridge: AIChannel = task.ai_channels.add_ai_bridge_chan(
        "cDAQ1Mod7/ai0", min_val=-0.02, max_val=0.02, voltage_excit_val=2.5
    )
    bridge.ai_filter_delay_adjustment = 0.5
    assert (bridge.ai_bridge_nom_resistance, bridge.ai_excit_val) == (350.0, 2.5)
    assert refused(lambda: bridge.ai_adc_timing_mode) == UNSUPPORTED


def test_the_range_that_is_asked_for_becomes_one_that_the_device_has(task: nidaqmx.Task) -> None:
    channel = task.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0", min_val=-3.0, max_val=3.0)
    assert (channel.ai_min, channel.ai_max, channel.ai_rng_low, channel.ai_rng_high) == (-5, 5, -5, 5)
    channel.ai_rng_high, channel.ai_rng_low = 10.0, -10.0
    assert (channel.ai_min, channel.ai_max, channel.ai_rng_low, channel.ai_rng_high) == (-10, 10, -10, 10)
    del channel.ai_rng_high, channel.ai_rng_low
    assert (channel.ai_rng_low, channel.ai_rng_high) == (-5, 5)


def test_a_range_that_no_device_has_is_refused_under_its_own_name(task: nidaqmx.Task) -> None:
    channel = task.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0", min_val=-3.0, max_val=3.0)
    channel.ai_rng_high = 99.0
    with pytest.raises(DaqError, match=r"DAQmx_AI_Rng_High\nRequested Value: 99\.0\nMaximum Value: 10\.0"):
        _ = channel.ai_rng_high


def test_limits_that_were_reset_are_missing_each_by_its_code(task: nidaqmx.Task) -> None:
    channel = task.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0")
    del channel.ai_min
    assert refused(lambda: channel.ai_min) == -200694
    del channel.ai_max
    assert refused(lambda: channel.ai_max) == -200695


def clocked(task: nidaqmx.Task, device: str = CARD) -> nidaqmx.Task:
    task.ai_channels.add_ai_voltage_chan(f"{device}/ai0")
    task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=100)
    return task


def test_a_timebase_of_the_client_s_own_is_what_the_clock_is_divided_from(task: nidaqmx.Task) -> None:
    timing = clocked(task).timing
    timing.samp_clk_timebase_src, timing.samp_clk_timebase_rate = "PFI3", 3000.0
    assert timing.samp_clk_timebase_src == f"/{CARD}/PFI3"
    assert (timing.samp_clk_timebase_rate, timing.samp_clk_timebase_div, timing.samp_clk_rate) == (
        3000,
        3,
        1000,
    )
    timing.samp_clk_rate = 1200.0
    assert timing.samp_clk_rate == 1500.0
    del timing.samp_clk_timebase_src, timing.samp_clk_timebase_rate
    assert timing.samp_clk_timebase_rate == 100e6
    assert timing.samp_clk_timebase_src == f"/{CARD}/ai/SampleClockTimebase"


@pytest.mark.parametrize("attribute", ["samp_clk_timebase_src", "samp_clk_src"])
def test_a_clock_from_a_terminal_that_no_device_has_is_refused(task: nidaqmx.Task, attribute: str) -> None:
    timing = clocked(task).timing
    setattr(timing, attribute, "PFI99")
    assert refused(lambda: getattr(timing, attribute)) == -89120
    assert refused(lambda: task.control(TaskMode.TASK_VERIFY)) == -89120


def test_a_trigger_takes_only_the_types_that_it_can_have(task: nidaqmx.Task) -> None:
    start, pause = clocked(task).triggers.start_trigger, task.triggers.pause_trigger
    pause.trig_type = TriggerType.DIGITAL_LEVEL
    assert refused(lambda: setattr(pause, "trig_type", TriggerType.ANALOG_EDGE)) == -200077
    assert refused(lambda: setattr(start, "trig_type", TriggerType.DIGITAL_LEVEL)) == -200077
    assert pause.trig_type is TriggerType.DIGITAL_LEVEL
    assert task.triggers.handshake_trigger.trig_type is TriggerType.NONE
    assert start.anlg_edge_coupling is Coupling.DC


def test_a_unit_or_level_of_another_attribute_is_no_value_of_this_one(task: nidaqmx.Task) -> None:
    channel = clocked(task).ai_channels[0]
    wrong = TerminalConfiguration.DEFAULT
    assert refused(lambda: setattr(channel, "ai_term_cfg", wrong)) == -200077
    assert (
        refused(lambda: setattr(task.export_signals, "hshk_event_output_behavior", ExportAction.TOGGLE))
        == -200077
    )


@pytest.mark.parametrize("trigger", ["digital", "reference", "analogue"])
def test_a_trigger_without_a_sample_clock_is_refused(task: nidaqmx.Task, trigger: str) -> None:
    task.ai_channels.add_ai_voltage_chan(f"{CARD}/ai0")
    if trigger == "digital":
        task.triggers.start_trigger.cfg_dig_edge_start_trig("PFI0")
    elif trigger == "reference":
        task.triggers.reference_trigger.cfg_dig_edge_ref_trig("PFI0", 10)
    else:
        task.triggers.start_trigger.cfg_anlg_edge_start_trig(f"{CARD}/ai0")
    assert refused(lambda: task.control(TaskMode.TASK_VERIFY)) == -200262


def test_a_start_is_delayed_by_periods_unless_seconds_are_asked_for(task: nidaqmx.Task) -> None:
    start = clocked(task).triggers.start_trigger
    start.delay = 50.0
    start.timestamp_enable = task.timing.first_samp_timestamp_enable = True
    task.start()
    task.read(100)
    delay = task.timing.first_samp_timestamp_val - start.timestamp_val
    assert delay.total_seconds() == pytest.approx(0.05, abs=1e-6)


def test_the_reference_trigger_s_time_stamp_is_its_own(task: nidaqmx.Task, rig: Rig) -> None:
    reference = clocked(task).triggers.reference_trigger
    reference.cfg_anlg_edge_ref_trig(f"{CARD}/ai0", 20, Slope.RISING, 0.9)
    reference.timestamp_enable = task.timing.first_samp_timestamp_enable = True
    task.start()
    values = task.read(100)
    assert values[19] < 0.9 <= values[20]
    after_s = (reference.timestamp_val - task.timing.first_samp_timestamp_val).total_seconds()
    position = task.in_stream.total_samp_per_chan_acquired - 80
    assert after_s == pytest.approx(position / 1000.0, abs=1e-6)
    assert task.wait_for_valid_timestamp(TimestampEvent.REFERENCE_TRIGGER) == reference.timestamp_val


def test_a_time_stamp_that_is_not_enabled_is_not_told(task: nidaqmx.Task) -> None:
    assert refused(lambda: clocked(task).timing.first_samp_timestamp_val) == -200983
    task.start()
    task.read(100)
    assert refused(lambda: task.timing.first_samp_timestamp_val) == -209842
    with pytest.raises(DaqError, match="StartTrig_Timestamp"):
        _ = task.triggers.start_trigger.timestamp_val


def test_the_first_sample_waits_for_a_time_of_day(task: nidaqmx.Task, rig: Rig) -> None:
    """The client of version 1.7.0 cannot set this attribute: the service is called as it calls it."""
    timing = clocked(task).timing
    timing.first_samp_timestamp_enable = True
    with rig.bench.changed:
        when = rig.bench.utc(rig.bench.clock.now() + 0.75)
    stub = nidaqmx_pb2_grpc.NiDAQmxStub(rig.channel)
    attribute = pb.TIMING_ATTRIBUTE_FIRST_SAMP_CLK_WHEN
    stub.SetTimingAttributeTimestamp(
        pb.SetTimingAttributeTimestampRequest(
            task=task._handle, attribute_raw=attribute, value=convert_time_to_timestamp(when)
        )
    )
    task.start()
    task.read(100)
    stamp = timing.first_samp_timestamp_val
    assert abs((stamp.replace(tzinfo=dt.UTC) - when).total_seconds()) < 1e-6


def test_faulty_channels_are_named_only_after_the_question_whether_there_are_any(task: nidaqmx.Task) -> None:
    stream = clocked(task).in_stream
    assert refused(lambda: stream.open_chans) == -201194
    assert not stream.open_chans_exist
    assert (stream.open_chans, stream.open_chans_details) == ([], [])


def test_a_self_calibration_has_its_date(rig: Rig) -> None:
    system, card = rig.system(), rig.system().devices[CARD]
    factory = card.self_cal_last_date_and_time
    system._interpreter.self_cal(CARD)
    with rig.bench.changed:
        now = rig.bench.utc(rig.bench.clock.now())
    assert factory < card.self_cal_last_date_and_time
    assert abs(card.self_cal_last_date_and_time.replace(tzinfo=dt.UTC) - now) < dt.timedelta(minutes=2)
    assert rig.system().devices["cDAQ1Mod1"].self_cal_last_date_and_time == factory
