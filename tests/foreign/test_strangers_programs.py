"""Four programs as strangers write them, on the simulated server that they reach by two lines."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import grpc
import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import (
    READ_ALL_AVAILABLE,
    AcquisitionType,
    Edge,
    LoggingMode,
    LoggingOperation,
)
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.stream_writers import AnalogSingleChannelWriter
from nptdms import TdmsFile

from sim_hardware.control import SimControl
from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.program import build_bench
from sim_hardware.daqmx_server.services.server import DaqmxServer

DEVICES = ["Dev1=PCIe-6363", "cDAQ1=cDAQ-9178", "cDAQ1Mod1=NI 9205", "cDAQ1Mod2=NI 9234"]
WAIT_S = 30.0


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    options = [part for device in DEVICES for part in ("--device", device)]
    server = DaqmxServer(build_bench(parser().parse_args([*options, "--real", "Dev1", "--speed", "5"])))
    server.start()
    yield server.address
    server.stop()


@pytest.fixture
def options(address: str) -> Iterator[nidaqmx.GrpcSessionOptions]:
    with grpc.insecure_channel(address, options=[("grpc.max_receive_message_length", -1)]) as channel:
        yield nidaqmx.GrpcSessionOptions(channel, "")


def test_a_logger_with_callbacks_stream_reader_and_tdms_file(
    options: nidaqmx.GrpcSessionOptions, tmp_path: Path
) -> None:
    """Twelve blocks by an event each, every sample twice: in the program's memory and in NI's own file."""
    n_blocks, block, n_channels = 12, 200, 4
    got: list[np.ndarray] = []
    enough = threading.Event()
    with nidaqmx.Task("logger", grpc_options=options) as task:
        for module in ("cDAQ1Mod1/ai0:1", "cDAQ1Mod1/ai16:17"):
            task.ai_channels.add_ai_voltage_chan(module, min_val=-5.0, max_val=5.0)
        task.timing.cfg_samp_clk_timing(2000.0, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=20_000)
        task.timing.first_samp_timestamp_enable = True
        task.in_stream.configure_logging(
            str(tmp_path / "log.tdms"),
            LoggingMode.LOG_AND_READ,
            "Wall",
            LoggingOperation.CREATE_OR_REPLACE,
        )
        reader = AnalogMultiChannelReader(task.in_stream)
        data = np.empty((n_channels, block))

        def on_block(task_handle: object, event_type: int, n_samples: int, callback_data: object) -> int:
            if len(got) < n_blocks:
                reader.read_many_sample(data, n_samples, timeout=WAIT_S)
                got.append(data.copy())
            if len(got) == n_blocks:
                enough.set()
            return 0

        task.register_every_n_samples_acquired_into_buffer_event(block, on_block)
        task.start()
        assert enough.wait(WAIT_S)
        started = task.timing.first_samp_timestamp_val
        task.stop()
        task.register_every_n_samples_acquired_into_buffer_event(block, None)

    with TdmsFile.open(tmp_path / "log.tdms") as file:
        logged = np.array([channel[:] for channel in file["Wall"].channels()])
        properties = file["Wall"].channels()[0].properties
    assert np.array_equal(logged, np.concatenate(got, axis=1))
    assert properties["wf_increment"] == pytest.approx(1 / 2000.0)
    late = np.datetime64(started.replace(tzinfo=None), "us") - properties["wf_start_time"]
    assert abs(late) < np.timedelta64(1, "ms")


def test_a_loopback_check_writes_a_ramp_and_reads_it_back(options: nidaqmx.GrpcSessionOptions) -> None:
    """Output and input of a card on one clock: what was written is what is read, one sample later."""
    ramp = np.linspace(-2.0, 2.0, 500)
    with nidaqmx.Task(grpc_options=options) as out, nidaqmx.Task(grpc_options=options) as back:
        out.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-5.0, max_val=5.0)
        out.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=len(ramp))
        back.ai_channels.add_ai_voltage_chan("Dev1/_ao0_vs_aognd", min_val=-5.0, max_val=5.0)
        back.timing.cfg_samp_clk_timing(
            1000.0, source="/Dev1/ao/SampleClock", active_edge=Edge.FALLING, samps_per_chan=len(ramp)
        )
        AnalogSingleChannelWriter(out.out_stream).write_many_sample(ramp)
        back.start()
        out.start()
        read = np.array(back.read(READ_ALL_AVAILABLE, timeout=WAIT_S))
    assert len(read) == len(ramp)
    assert np.max(np.abs(read - ramp)) < 1e-3


def test_two_modules_in_one_task_give_waveforms_with_times_and_units(
    options: nidaqmx.GrpcSessionOptions,
) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0", "wire")
        task.ai_channels.add_ai_accel_chan("cDAQ1Mod2/ai0", "top", sensitivity=100.0, current_excit_val=0.002)
        task.timing.cfg_samp_clk_timing(2048.0, samps_per_chan=1024)
        waveforms = task.read_waveform(1024, timeout=WAIT_S)
        rate = task.timing.samp_clk_rate

    assert [(w.channel_name, w.units) for w in waveforms] == [("wire", "Volts"), ("top", "g")]
    assert {len(w.scaled_data) for w in waveforms} == {1024}
    assert waveforms[0].timing.start_time == waveforms[1].timing.start_time
    assert waveforms[0].timing.sample_interval.total_seconds() == pytest.approx(1 / rate)


def test_a_shock_recorder_takes_the_same_window_at_each_trigger(
    options: nidaqmx.GrpcSessionOptions, address: str
) -> None:
    with nidaqmx.Task(grpc_options=options) as task, SimControl(address) as hammer:
        task.ai_channels.add_ai_voltage_chan("cDAQ1Mod1/ai0:1")
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=100)
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/cDAQ1/PFI0")
        task.triggers.start_trigger.retriggerable = True
        task.start()
        windows = []
        for _ in range(3):
            hammer.command("digital_edge", terminal="/cDAQ1/PFI0", edge="rising")
            windows.append(np.array(task.read(100, timeout=WAIT_S)))
        acquired = task.in_stream.total_samp_per_chan_acquired

    assert [window.shape for window in windows] == [(2, 100)] * 3
    assert acquired == 300
