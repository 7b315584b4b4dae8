"""NI's write calls: analogue values, digital words and lines, pulses, waveforms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from ni.protobuf.types.waveform_conversion import (
    digital_waveform_from_protobuf,
    float64_analog_waveform_from_protobuf,
)
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx.constants import FillMode
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler
from sim_hardware.daqmx_server.services.attributes.tasks import line_bytes
from sim_hardware.daqmx_server.tasks.generation import line_levels
from sim_hardware.daqmx_server.tasks.samplers import pulse_times_s
from sim_hardware.daqmx_server.tasks.task import State, Task, task_named
from sim_hardware.daqmx_server.tasks.writing import write_once

Samples = NDArray[np.float64]


def put_out(task: Task, samples: Samples, auto_start: bool, timeout_s: float) -> int:
    """Samples (channels, samples) to the buffer, or at once where the task has no clock; their number."""
    if not task.channels:
        raise DaqmxError(Code.NO_OUTPUT_CHANNELS)
    if task.is_buffered:
        if task.generation.regenerates:
            room = task.output_buffer or task.timing.samples_per_channel
            count = task.generation.write(samples, room)
        else:
            count = write_once(task, samples, timeout_s)
        if auto_start and task.state is not State.RUNNING:
            task.start()
        elif task.run is not None:
            task.bench.world_changed()
        return count
    if task.state is not State.RUNNING:
        if not auto_start:
            raise DaqmxError(Code.TASK_NOT_RUNNING)
        task.start()
        task.auto_started = True
    now = task.bench.clock.glance()
    for row, channel in enumerate(task.channels):
        hold(task.bench, channel, float(samples[row, -1]), now)
    task.bench.world_changed()
    if task.auto_started:
        task.stop()
    return int(samples.shape[1])


def hold(bench: Bench, channel: VirtualChannel, value: float, now_s: float) -> None:
    """An output has a value from now on."""
    if channel.io == "AO":
        bench.loopback.hold(channel.physical, now_s, value)
        return
    for line, level in line_levels(channel, int(value)).items():
        bench.loopback.hold(line, now_s, float(level))


def _arranged(values: NDArray[Any], n_channels: int, layout: int) -> Samples:
    """Flat values of a request → (channels, samples)."""
    flat = np.asarray(values, dtype=np.float64)
    if n_channels and flat.size % n_channels:
        raise DaqmxError(Code.ARRAY_SIZES_DIFFER)
    if layout == FillMode.GROUP_BY_SCAN_NUMBER.value:
        return np.ascontiguousarray(flat.reshape(-1, n_channels).T)
    return flat.reshape(n_channels, -1)


def _volts_per_code(channel: VirtualChannel) -> float:
    """Volts of one binary code of an output: its range over its bits."""
    outputs = channel.product.outputs
    limit = max((high for _, high in outputs.ranges_v or outputs.ranges_a), default=10.0)
    return limit / 2.0 ** (outputs.bits - 1)


_ARRAYS: Final = {
    "WriteAnalogF64": "f8",
    "WriteBinaryI16": "i2",
    "WriteBinaryI32": "i4",
    "WriteBinaryU16": "u2",
    "WriteBinaryU32": "u4",
    "WriteDigitalU8": "u1",
    "WriteDigitalU16": "u2",
    "WriteDigitalU32": "u4",
}


def _array_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        fields = fields_of(request)
        task = task_named(bench, request.task.name)
        given = fields["write_array"]
        values = np.frombuffer(given, "u1") if isinstance(given, bytes) else np.array(given)
        samples = _arranged(values, len(task.channels), fields["data_layout"])
        if "Binary" in rpc:
            samples = samples * np.array([[_volts_per_code(channel)] for channel in task.channels])
        return reply(samps_per_chan_written=put_out(task, samples, fields["auto_start"], fields["timeout"]))

    return handler


def write_lines(bench: Bench, request: Any) -> Any:
    """One byte for each line."""
    fields = fields_of(request)
    task = task_named(bench, request.task.name)
    width = line_bytes(task)
    bits = np.frombuffer(fields["write_array"], "u1") != 0
    shape = (len(task.channels), -1, width)
    if fields["data_layout"] == FillMode.GROUP_BY_SCAN_NUMBER.value:
        bits = bits.reshape(-1, len(task.channels), width).transpose(1, 0, 2)
    else:
        bits = bits.reshape(shape)
    words = (bits * (2.0 ** np.arange(width))).sum(axis=2)
    written = put_out(task, words, fields["auto_start"], fields["timeout"])
    return pb.WriteDigitalLinesResponse(samps_per_chan_written=written)


def _scalar_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        if len(task.channels) > 1:
            raise DaqmxError(Code.SCALAR_OF_MANY)
        put_out(task, np.array([[float(request.value)]]), request.auto_start, request.timeout)
        return reply()

    return handler


def write_raw(bench: Bench, request: Any) -> Any:
    """Bytes as the device takes them: scan by scan, 16 bits an analogue output; part of a scan is left."""
    task = task_named(bench, request.task.name)
    wide = "<i2" if task.io == "AO" else {1: "u1", 2: "<u2"}.get((line_bytes(task) + 7) // 8, "<u4")
    values = np.frombuffer(request.write_array, wide).astype(np.float64)
    whole = values.size // max(len(task.channels), 1) * len(task.channels)
    samples = np.ascontiguousarray(values[:whole].reshape(-1, len(task.channels)).T)
    if task.io == "AO":
        samples = samples * np.array([[_volts_per_code(channel)] for channel in task.channels])
    return pb.WriteRawResponse(
        samps_per_chan_written=put_out(task, samples, request.auto_start, request.timeout)
    )


def _check_count(task: Task, waveforms: Sequence[Any]) -> None:
    """−200524 unless there is one waveform for each channel."""
    if len(waveforms) != len(task.channels):
        raise DaqmxError(Code.WRITE_NUM_CHANS_MISMATCH)


def write_analog_waveforms(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    _check_count(task, request.waveforms)
    waveforms = [float64_analog_waveform_from_protobuf(waveform) for waveform in request.waveforms]
    samples = np.array([waveform.scaled_data for waveform in waveforms], dtype=np.float64)
    written = put_out(task, samples, request.auto_start, request.timeout)
    return pb.WriteAnalogWaveformsResponse(samps_per_chan_written=written)


def write_digital_waveforms(bench: Bench, request: Any) -> Any:
    """States of lines, a column each, in the order of `VirtualChannel.columns`."""
    task = task_named(bench, request.task.name)
    _check_count(task, request.waveforms)
    words = []
    for channel, message in zip(task.channels, request.waveforms, strict=True):
        waveform = digital_waveform_from_protobuf(message)
        if waveform.signal_count != len(channel.lines):
            raise DaqmxError(Code.NUM_LINES_MISMATCH, f"Channel Name: {channel.name}")
        weights = [2.0 ** channel.lines.index(line) for line in channel.columns]
        words.append((waveform.data != 0) @ np.array(weights))
    written = put_out(task, np.array(words, dtype=np.float64), request.auto_start, request.timeout)
    return pb.WriteDigitalWaveformsResponse(samps_per_chan_written=written)


_PULSES: Final = {
    "WriteCtrFreq": {"frequency": "CO_PULSE_FREQ", "duty_cycle": "CO_PULSE_DUTY_CYC"},
    "WriteCtrTime": {"high_time": "CO_PULSE_HIGH_TIME", "low_time": "CO_PULSE_LOW_TIME"},
    "WriteCtrTicks": {"high_ticks": "CO_PULSE_HIGH_TICKS", "low_ticks": "CO_PULSE_LOW_TICKS"},
}


def _pulse_handler(rpc: str, scalar: bool) -> Handler:
    """Several pulses written before the start follow each other; at other times the last one goes on."""
    reply = getattr(pb, f"{rpc}ScalarResponse" if scalar else f"{rpc}Response")
    keys = _PULSES[rpc]

    def handler(bench: Bench, request: Any) -> Any:
        task = task_named(bench, request.task.name)
        arrays = [[getattr(request, field)] if scalar else list(getattr(request, field)) for field in keys]
        n_channels = max(len(task.channels), 1)
        written = len(arrays[0]) // n_channels
        in_turn = written > 1 and task.run is None and task.timing.is_implicit
        pulses = []
        for number in range(0 if in_turn else written - 1, written):
            for row, channel in enumerate(task.channels):
                place = row * written + number
                channel.attributes |= {
                    attribute: values[place] for attribute, values in zip(keys.values(), arrays, strict=True)
                }
            pulses.append(pulse_times_s(task.channels[0]))
        task.generation.pulses = np.array(pulses).T if in_turn else np.empty((2, 0))
        task.generation.written += written
        if request.auto_start and task.state is not State.RUNNING:
            task.start()
        elif task.run is not None and task.run.times is not None:
            now = bench.clock.now()
            done = task.run.acquired(now)
            task.run.pulse_rate_changed(now, done, task.pulse_rate_hz)
        bench.world_changed()
        return reply() if scalar else reply(num_samps_per_chan_written=written)

    return handler


def write_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out: dict[str, Handler] = {rpc: _array_handler(rpc) for rpc in _ARRAYS}
    out |= {rpc: _scalar_handler(rpc) for rpc in ("WriteAnalogScalarF64", "WriteDigitalScalarU32")}
    for rpc in _PULSES:
        out[rpc] = _pulse_handler(rpc, False)
        out[f"{rpc}Scalar"] = _pulse_handler(rpc, True)
    return out | {
        "WriteDigitalLines": write_lines,
        "WriteRaw": write_raw,
        "WriteAnalogWaveforms": write_analog_waveforms,
        "WriteDigitalWaveforms": write_digital_waveforms,
    }
