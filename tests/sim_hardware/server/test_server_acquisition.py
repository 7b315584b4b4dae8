"""Continuous and finite acquisition through the real nidaqmx client, as foreign programs do it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from nidaqmx.constants import (
    READ_ALL_AVAILABLE,
    AcquisitionType,
    FillMode,
    OverwriteMode,
    ReadRelativeTo,
    TaskMode,
)
from nidaqmx.errors import DaqError, DaqReadError
from nidaqmx.stream_readers import AnalogMultiChannelReader, AnalogSingleChannelReader

from tests.support.server_support import Rig, TestSignals, continuous

_PAIRS = "cDAQ1Mod{0}/ai0:7, cDAQ1Mod{0}/ai16:23"


def test_41_channels_continuous(rig: Rig) -> None:
    """Every sample of 41 channels is the signal at its own instant: skewed, quantised, in order."""
    with rig.task("wall") as task:
        for module in (1, 2):
            task.ai_channels.add_ai_voltage_chan(_PAIRS.format(module), min_val=-10, max_val=10)
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod5/ai0:7, cDAQ1Mod5/ai16", min_val=-10, max_val=10)
        task.timing.cfg_samp_clk_timing(4000, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=80_000)
        assert task.timing.samp_clk_rate == 4000.0
        task.start()
        reader = AnalogMultiChannelReader(task.in_stream)
        data = np.empty((41, 400))
        blocks = []
        for _ in range(5):
            assert reader.read_many_sample(data, 400, timeout=5.0) == 400
            blocks.append(data.copy())
    got = np.concatenate(blocks, axis=1)
    times = np.arange(2000) / 4000.0
    period = 14e-6  # 4 µs per conversion and 10 µs of padding: 16 channels have room for it
    step = 20 / 2**16
    for row in (0, 3, 20, 40):
        place = row % 16
        terminal = f"x/ai{place if place < 8 else place + 8}"
        expected = TestSignals().volts((terminal,), times + place * period)[0]
        assert np.max(np.abs(got[row] - expected)) <= step / 2 + 1e-12
    assert np.allclose(got / step, np.rint(got / step))


def test_delta_sigma_is_late_fine_and_faster(rig: Rig) -> None:
    """An NI 9234 turns 4000 Hz into 4266.67 Hz, shows the past, and resolves 24 bits."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod3/ai1", min_val=-5, max_val=5)
        continuous(task, 4000.0)
        rate = task.timing.samp_clk_rate
        assert rate == pytest.approx(51.2e3 / 12)
        got = np.array(task.read(1000))
    lag = (40 + 5 / 512) / rate + 2.6e-6
    expected = TestSignals().volts(("x/ai1",), np.arange(1000) / rate - lag)[0]
    assert np.max(np.abs(got - expected)) <= 10 / 2**24


@pytest.mark.parametrize("pieces", [(1000,), (1, 399, 600), (250,) * 4])
def test_same_seconds_same_volts_in_any_pieces(
    start_rig: Callable[..., Rig], pieces: tuple[int, ...]
) -> None:
    def record(sizes: tuple[int, ...]) -> np.ndarray:
        rig = start_rig()
        with rig.task() as task:
            task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:3")
            continuous(task)
            return np.concatenate([np.array(task.read(n)) for n in sizes], axis=1)

    assert np.array_equal(record(pieces), record((500, 500)))


def test_time_out_hands_over_what_there_is(rig: Rig) -> None:
    """−200284 comes with the samples that had arrived, and they are not read again."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1")
        continuous(task, 1000.0)
        reader = AnalogMultiChannelReader(task.in_stream)
        data = np.full((2, 500), np.nan)
        with pytest.raises(DaqReadError) as caught:
            reader.read_many_sample(data, 500, timeout=0.1)
        assert caught.value.error_code == -200284
        n = caught.value.samps_per_chan_read
        assert 95 <= n <= 105
        packed = data.reshape(-1)[: 2 * n].reshape(2, n)
        rest = np.empty((2, 100))
        reader.read_many_sample(rest, 100, timeout=5.0)
        joined = np.concatenate([packed, rest], axis=1)
    expected = TestSignals().volts(("x/ai0",), np.arange(n + 100) / 1000.0)[0]
    assert np.max(np.abs(joined[0] - expected)) < 1e-3


def test_overwritten_before_read_stops_the_task(rig: Rig) -> None:
    """Default mode: −200279 once and again, in the read and in whoever asks, until the task is restarted."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.in_stream.input_buf_size = 2000
        task.start()
        rig.skip(2.5)
        for _ in range(2):
            with pytest.raises(DaqError) as caught:
                task.read(10)
            assert caught.value.error_code == -200279
        assert "DAQmx_Read_RelativeTo" in str(caught.value)
        with pytest.raises(DaqError):
            task.is_task_done()
        task.stop()
        task.start()
        assert len(task.read(10)) == 10


def test_overwrite_mode_goes_on_at_the_oldest_sample(rig: Rig) -> None:
    """With overwriting allowed a reader that was deaf seeks to a sample that still exists and goes on."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.in_stream.input_buf_size = 2000
        task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        task.start()
        rig.skip(2.5)
        with pytest.raises(DaqError) as caught:
            task.read(10)
        assert caught.value.error_code == -200279
        total = task.in_stream.total_samp_per_chan_acquired
        oldest = total - 2000 + 100
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        task.in_stream.offset = oldest
        first = task.read(10)
        assert task.in_stream.curr_read_pos == oldest + 10
        task.in_stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
        task.in_stream.offset = 0
        got = np.array(first + task.read(10))
    expected = TestSignals().volts(("x/ai0",), (oldest + np.arange(20)) / 1000.0)[0]
    assert np.max(np.abs(got - expected)) < 1e-3


def test_most_recent_samples(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.in_stream.overwrite = OverwriteMode.OVERWRITE_UNREAD_SAMPLES
        task.in_stream.relative_to = ReadRelativeTo.MOST_RECENT_SAMPLE
        task.in_stream.offset = -5
        task.start()
        rig.skip(1.0)
        got = task.read(5)
        assert task.in_stream.curr_read_pos == 1001
    expected = TestSignals().volts(("x/ai0",), np.arange(996, 1001) / 1000.0)[0]
    assert np.max(np.abs(np.array(got) - expected)) < 1e-3


def test_finite_acquisition_by_auto_start(rig: Rig) -> None:
    """The shortest program: no start, read all; the task may be run again."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1")
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=50)
        first = task.read(READ_ALL_AVAILABLE)
        second = task.read(READ_ALL_AVAILABLE)
        assert len(first) == len(second) == 2
        assert len(first[0]) == len(second[0]) == 50
        assert task.is_task_done()


def test_finite_acquisition_step_by_step(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=100)
        task.start()
        assert not task.is_task_done()
        task.wait_until_done(timeout=1.0)
        assert task.is_task_done()
        assert task.in_stream.avail_samp_per_chan == 100
        assert len(task.read(60)) == 60
        assert len(task.read(60)) == 40
        with pytest.raises(DaqError) as caught:
            task.read(1)
        assert caught.value.error_code == -200278
        task.stop()


def test_finite_task_of_an_ni_simulated_device_is_done_at_once(start_rig: Callable[..., Rig]) -> None:
    rig = start_rig(speed=1.0, finite="instant")
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(10.0, samps_per_chan=10_000)
        task.start()
        assert task.is_task_done()
        assert len(task.read(READ_ALL_AVAILABLE)) == 10_000


def test_wait_until_done_gives_up(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        task.timing.cfg_samp_clk_timing(100.0, samps_per_chan=1000)
        task.start()
        with pytest.raises(DaqError) as caught:
            task.wait_until_done(timeout=1.0)
        assert caught.value.error_code == -200560


def test_on_demand_reads(rig: Rig) -> None:
    """Without timing each read takes samples now."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        assert isinstance(task.read(), float)
        assert len(task.read(3)) == 3
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai1")
        assert len(task.read()) == 2
        data = np.empty(2)
        AnalogMultiChannelReader(task.in_stream).read_one_sample(data)
        assert np.all(np.abs(data) < 1.2)


def test_read_variants_agree(rig: Rig) -> None:
    """F64, single-channel reader, scalars, integer codes, raw bytes and waveforms hold the same samples."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0", min_val=-1, max_val=1)
        continuous(task, 1000.0)
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        task.start()
        floats = np.array(task.read(100))
        step = 2 / 2**16
        codes = np.rint(floats / step)
        buffer = np.empty(100)
        AnalogSingleChannelReader(task.in_stream).read_many_sample(buffer, 100)
        assert np.array_equal(buffer, floats)
        assert AnalogSingleChannelReader(task.in_stream).read_one_sample() == floats[0]
        raw = task.in_stream.read(100)
        assert raw.dtype == np.int16
        assert np.array_equal(raw, codes)
        assert task.read_waveform(100).scaled_data.tolist() == floats.tolist()
        for dtype, method in ((np.int16, "i16"), (np.int32, "i32")):
            ints = np.zeros(100, dtype=dtype)
            getattr(task._interpreter, f"read_binary_{method}")(task._handle, 100, 5.0, 0, ints)
            assert np.array_equal(ints, codes)
        for dtype, method in ((np.uint16, "u16"), (np.uint32, "u32")):
            words = np.zeros(100, dtype=dtype)
            getattr(task._interpreter, f"read_binary_{method}")(task._handle, 100, 5.0, 0, words)
            assert np.array_equal(words, codes.astype(np.int64).astype(dtype))


def test_samples_can_be_grouped_by_scan(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:2")
        continuous(task, 1000.0)
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        by_channel = np.array(task.read(50))
        by_scan = np.zeros((50, 3))
        task._interpreter.read_analog_f64(task._handle, 50, 5.0, FillMode.GROUP_BY_SCAN_NUMBER.value, by_scan)
    assert np.array_equal(by_scan, by_channel.T)


def test_waveform_names_its_channel_and_time(rig: Rig) -> None:
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1", name_to_assign_to_channel="left, right")
        continuous(task, 1000.0)
        waves = task.read_waveform(50)
        second = task.read_waveform(50)
    assert [wave.channel_name for wave in waves] == ["left", "right"]
    assert waves[0].units == "Volts"
    assert waves[0].timing.sample_interval.total_seconds() == pytest.approx(1e-3)
    gap = second[0].timing.timestamp - waves[0].timing.timestamp
    assert gap.total_seconds() == pytest.approx(0.05, abs=1e-6)


def test_scan_order_and_channel_subset(rig: Rig) -> None:
    """`channels_to_read` picks rows in the order given."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:3")
        continuous(task, 1000.0)
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        task.start()
        all_rows = np.array(task.read(20))
        task.in_stream.channels_to_read = task.ai_channels["cDAQ1Mod1/ai3, cDAQ1Mod1/ai1"]
        assert np.array_equal(np.array(task.read(20)), all_rows[[3, 1]])


def test_slave_follows_the_clock_of_its_master(rig: Rig) -> None:
    """Two tasks with one sample clock and start trigger: the same instants, whoever is read first."""
    master, slave = rig.task("master"), rig.task("slave")
    try:
        master.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        master.timing.cfg_samp_clk_timing(4000.0, sample_mode=AcquisitionType.CONTINUOUS)
        slave.ai_channels.add_ai_voltage_chan("cDAQ1Mod2/ai0")
        slave.timing.cfg_samp_clk_timing(
            4000.0, source="/cDAQ1/ai/SampleClock", sample_mode=AcquisitionType.CONTINUOUS
        )
        slave.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1/ai/StartTrigger")
        for task in (master, slave):
            task.control(TaskMode.TASK_COMMIT)
        slave.start()
        assert slave.in_stream.avail_samp_per_chan == 0
        rig.skip(1.0)
        master.start()
        one, two = np.array(slave.read(500)), np.array(master.read(500))
        assert np.array_equal(one, two)
        master.stop()
        with pytest.raises(DaqReadError) as caught:
            slave.read(50_000, timeout=5.0)
        assert caught.value.error_code == -200284
    finally:
        slave.close()
        master.close()


def test_rails_and_overload(rig: Rig) -> None:
    """A signal past the range is clipped; the NI 9234 says so, the NI 9205 cannot."""
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod3/ai0", name_to_assign_to_channel="accel")
        continuous(task, 1000.0)
        task.start()
        task.read(100)
        assert not task.in_stream.overloaded_chans_exist
        rig.control.command("shift", volts=20.0)
        got = np.array(task.read(400))
        assert got.max() == pytest.approx(5.0, abs=1e-6)
        assert task.in_stream.overloaded_chans_exist
        assert task.in_stream.overloaded_chans == ["accel"]
        rig.control.command("shift", volts=-20.0)
        task.read(400)
        task.in_stream.overloaded_chans_exist  # noqa: B018 - reading it clears it
        task.read(10)
        assert not task.in_stream.overloaded_chans_exist
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        assert np.max(task.read(400)) <= 5.0
        with pytest.raises(DaqError) as caught:
            task.in_stream.overloaded_chans_exist  # noqa: B018
        assert caught.value.error_code == -200452


def test_real_time_clock_runs_at_its_speed(start_rig: Callable[..., Rig]) -> None:
    """At speed 20 a second of samples takes a twentieth, and time goes on between the reads."""
    rig = start_rig(speed=20.0)
    with rig.task() as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.start()
        got = np.array(task.read(1000, timeout=30.0))
        before = task.in_stream.total_samp_per_chan_acquired
        assert before >= 1000
        while task.in_stream.total_samp_per_chan_acquired < before + 100:
            pass
    expected = TestSignals().volts(("x/ai0",), np.arange(1000) / 1000.0)[0]
    assert np.max(np.abs(got - expected)) < 2e-4  # the very first sample clock starts the world at 0 s


def test_stop_ends_a_waiting_read(start_rig: Callable[..., Rig]) -> None:
    from concurrent.futures import ThreadPoolExecutor

    rig = start_rig(speed=1.0)
    with rig.task("waiting") as task, ThreadPoolExecutor(1) as pool:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0")
        continuous(task, 1000.0)
        task.in_stream.auto_start = False
        task.start()
        waiting = pool.submit(task.read, 1_000_000, 60.0)
        while not rig.is_waiting("waiting"):
            pass
        task.stop()
        with pytest.raises(DaqError):
            waiting.result(timeout=10)
