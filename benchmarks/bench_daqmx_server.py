"""The simulated device server through the real nidaqmx client: how many rigs one client could read.

The server runs in its own process with the rocking wall of FR1 wired to it; its clock moves with the
reads, so the figure is the throughput of both together, as a multiple of 41 channels at 4000 Hz. On a
machine that others use, too, the processor time that a second of record costs says more.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import grpc
import nidaqmx
import numpy as np
import psutil
from nidaqmx.constants import AcquisitionType
from nidaqmx.grpc_session_options import GrpcSessionOptions
from nidaqmx.stream_readers import AnalogMultiChannelReader

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.config import load_rig

_RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_RATE_HZ = 4000.0
_SECONDS = 5.0
_RUNS = 3


def figures(effort: Effort) -> list[Figure]:
    """Multiples of real time for reads of 0.1 s and of 1 s; processor time of client and server."""
    count, seconds = effort.of(_RUNS, 1), effort.of(_SECONDS, 0.3)
    server = subprocess.Popen(
        [sys.executable, "-m", "sim_hardware.daqmx_server", "--config", str(_RIG), "--speed", "max"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert server.stdout is not None
        match = re.search(r"port (\d+)", server.stdout.readline())
        if match is None:
            raise RuntimeError("the simulated device server did not start")
        out = []
        for samples in (400, 4000):
            runs = [bare_loop(match[1], samples, psutil.Process(server.pid), seconds) for _ in range(count)]
            multiple, client, served = (float(np.median(column)) for column in zip(*runs, strict=True))
            name = f"41 channels through nidaqmx, {samples} samples a read"
            out.append(Figure(name, multiple, "x 4000 Hz", count, 40.0, "high"))
            out.append(Figure(f"{name}: client", client * 1e3, "ms of CPU per s of record", count, 25.0))
            out.append(Figure(f"{name}: server", served * 1e3, "ms of CPU per s of record", count, 25.0))
        return out
    finally:
        server.terminate()
        server.wait()


def bare_loop(port: str, samples: int, server: psutil.Process, seconds: float) -> tuple[float, float, float]:
    """A bare loop of reads: (multiple of real time, CPU s of the client, of the server per s of record)."""
    rig = load_rig(_RIG)
    options = [("grpc.max_receive_message_length", -1)]
    with (
        grpc.insecure_channel(f"127.0.0.1:{port}", options=options) as channel,
        nidaqmx.Task(grpc_options=GrpcSessionOptions(channel, "")) as task,
    ):
        for sensor in rig.channels:
            low, high = sensor.input_range_v
            task.ai_channels.add_ai_voltage_chan(sensor.physical_channel, min_val=low, max_val=high)
        task.timing.cfg_samp_clk_timing(
            _RATE_HZ, sample_mode=AcquisitionType.CONTINUOUS, samps_per_chan=80_000
        )
        task.start()
        reader = AnalogMultiChannelReader(task.in_stream)
        data = np.empty((len(rig.channels), samples))
        reader.read_many_sample(data, samples)
        start, blocks = time.perf_counter(), 0
        client, served = time.process_time(), sum(server.cpu_times()[:2])
        while time.perf_counter() - start < seconds:
            reader.read_many_sample(data, samples)
            blocks += 1
        lasted = time.perf_counter() - start
        record_s = blocks * samples / _RATE_HZ
        client = time.process_time() - client
        served = sum(server.cpu_times()[:2]) - served
        return record_s / lasted, client / record_s, served / record_s
