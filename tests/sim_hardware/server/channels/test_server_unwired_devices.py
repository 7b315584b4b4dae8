"""Simulated devices with nothing wired behave as NI documents its own: triggers fire, counters read 0."""

from __future__ import annotations

from collections.abc import Iterator

import grpc
import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import AcquisitionType, ReadRelativeTo, TaskMode
from nidaqmx.errors import DaqError

from sim_hardware.control import SimControl
from sim_hardware.daqmx_server.options import parser
from sim_hardware.daqmx_server.program import build_bench
from sim_hardware.daqmx_server.services.server import DaqmxServer

NOISE_V = 0.03 * 2.0 + 1e-3
"""Three per cent of the full scale of these tests, and a code."""
DEVICES = ["--device", "Dev1=PCIe-6361", "--device", "Dev2=PCIe-6361", "--real", "Dev2"]


@pytest.fixture(params=["max", "100"])
def server(request: pytest.FixtureRequest) -> Iterator[DaqmxServer]:
    """A bench of two unwired cards, Dev2 not simulated; time moves with the reads, or by the clock."""
    server = DaqmxServer(build_bench(parser().parse_args([*DEVICES, "--speed", request.param])))
    server.start()
    yield server
    server.stop()


@pytest.fixture
def options(server: DaqmxServer) -> Iterator[nidaqmx.GrpcSessionOptions]:
    with grpc.insecure_channel(server.address) as channel:
        yield nidaqmx.GrpcSessionOptions(channel, "")


def _finite(task: nidaqmx.Task, device: str) -> None:
    task.ai_channels.add_ai_voltage_chan(f"{device}/ai0")
    task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=50)


def test_a_digital_start_trigger_on_a_simulated_device_fires_at_once(
    options: nidaqmx.GrpcSessionOptions,
) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        _finite(task, "Dev1")
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI0")
        assert len(task.read(50, timeout=5.0)) == 50


def test_a_digital_reference_trigger_on_a_simulated_device_fires_once_the_pretrigger_samples_are_there(
    options: nidaqmx.GrpcSessionOptions,
) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        _finite(task, "Dev1")
        task.triggers.reference_trigger.cfg_dig_edge_ref_trig("/Dev1/PFI0", pretrigger_samples=20)
        assert len(task.read(50, timeout=5.0)) == 50


def test_an_analogue_trigger_listens_at_the_terminals_for_it(options: nidaqmx.GrpcSessionOptions) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        _finite(task, "Dev1")
        task.triggers.start_trigger.cfg_anlg_edge_start_trig("APFI0", trigger_level=0.5)
        assert len(task.read(50, timeout=5.0)) == 50


@pytest.mark.parametrize("source", ["/Dev2/PFI0", "PFI0"])
def test_a_device_that_is_not_simulated_waits_for_its_edge(
    options: nidaqmx.GrpcSessionOptions, source: str
) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        _finite(task, "Dev2")
        task.triggers.start_trigger.cfg_dig_edge_start_trig(source)
        with pytest.raises(DaqError) as refused:
            task.read(50, timeout=0.2)
    assert refused.value.error_code == -200284


def test_a_trigger_that_another_task_drives_waits_for_that_task(options: nidaqmx.GrpcSessionOptions) -> None:
    with nidaqmx.Task(grpc_options=options) as master, nidaqmx.Task(grpc_options=options) as slave:
        _finite(master, "Dev2")
        master.export_signals.start_trig_output_term = "/Dev1/PFI3"
        _finite(slave, "Dev1")
        slave.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI3")
        slave.start()
        with pytest.raises(DaqError):
            slave.read(50, timeout=0.2)
        master.start()
        assert len(slave.read(50, timeout=5.0)) == 50


def test_edges_that_somebody_gives_are_waited_for(
    server: DaqmxServer, options: nidaqmx.GrpcSessionOptions
) -> None:
    with nidaqmx.Task(grpc_options=options) as task, SimControl(server.address) as control:
        control.command("digital_edge", terminal="/Dev1/PFI0", edge="falling")
        _finite(task, "Dev1")
        task.triggers.start_trigger.cfg_dig_edge_start_trig("/Dev1/PFI0")
        task.start()
        with pytest.raises(DaqError):
            task.read(50, timeout=0.2)


def test_channels_of_a_task_show_sines_five_degrees_apart(options: nidaqmx.GrpcSessionOptions) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:2", min_val=-2.0, max_val=2.0)
        task.timing.cfg_samp_clk_timing(1000.0, samps_per_chan=100)
        first = np.array(task.read(100, timeout=5.0))[:, 0]
    assert first == pytest.approx(2.0 * np.sin(np.deg2rad([0.0, 5.0, 10.0])), abs=NOISE_V)


def test_the_sine_has_noise_of_three_per_cent_that_is_the_same_when_it_is_read_again(
    options: nidaqmx.GrpcSessionOptions,
) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:1", min_val=-2.0, max_val=2.0)
        task.timing.cfg_samp_clk_timing(10_000.0, samps_per_chan=2000)
        first = np.array(task.read(2000, timeout=5.0))
        task.in_stream.relative_to = ReadRelativeTo.FIRST_SAMPLE
        again = np.array(task.read(2000, timeout=5.0))
    phase = 2.0 * np.pi * np.arange(2000) / 100 + np.deg2rad([[0.0], [5.0]])
    noise = (first - 2.0 * np.sin(phase))[np.abs(np.sin(phase)) < 0.9]
    assert 0.9 * NOISE_V < np.abs(noise).max() < NOISE_V
    assert abs(noise.mean()) < 0.05 * NOISE_V
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first - 2.0 * np.sin(phase))[0, 1]) < 0.1


def test_values_that_software_takes_one_by_one_go_along_the_sine(options: nidaqmx.GrpcSessionOptions) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=-2.0, max_val=2.0)
        taken = [task.read(timeout=5.0) for _ in range(26)]
    assert taken == pytest.approx(2.0 * np.sin(2.0 * np.pi * np.arange(26) / 100), abs=NOISE_V)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_raw_array_is_cleared_behind_the_last_scan(options: nidaqmx.GrpcSessionOptions) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.ai_channels.add_ai_voltage_chan("Dev1/ai0:1", min_val=1.0, max_val=2.0)
        raw = np.full(7, -32768, dtype=np.int16)
        assert task.in_stream.readinto(raw) == 3
    assert (raw[:6] > 0).all()
    assert raw[6] == 0


def test_a_counter_without_pulses_reads_0(options: nidaqmx.GrpcSessionOptions) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.ci_channels.add_ci_freq_chan("Dev1/ctr0", min_val=1.0, max_val=10_000.0)
        assert task.read(timeout=5.0) == 0.0


def test_an_output_that_nobody_reads_does_not_overflow(
    server: DaqmxServer, options: nidaqmx.GrpcSessionOptions
) -> None:
    with nidaqmx.Task(grpc_options=options) as task:
        task.co_channels.add_co_pulse_chan_freq("Dev1/ctr1", freq=100_000.0)
        task.timing.cfg_implicit_timing(sample_mode=AcquisitionType.CONTINUOUS)
        task.start()
        with server.bench.changed:
            server.bench.clock.skip(60.0)
        assert not task.is_task_done()


def test_limits_that_no_device_can_do_are_refused_when_the_task_is_verified(
    options: nidaqmx.GrpcSessionOptions,
) -> None:
    def code_of(task: nidaqmx.Task) -> int:
        with pytest.raises(DaqError) as refused:
            task.control(TaskMode.TASK_VERIFY)
        return refused.value.error_code

    with nidaqmx.Task(grpc_options=options) as far, nidaqmx.Task(grpc_options=options) as turned:
        far.ao_channels.add_ao_voltage_chan("Dev1/ao0", min_val=-1e5, max_val=1e5)
        turned.ai_channels.add_ai_voltage_chan("Dev1/ai0", min_val=10.0, max_val=-10.0)
        assert code_of(far) == -200077
        assert code_of(turned) == -200082
