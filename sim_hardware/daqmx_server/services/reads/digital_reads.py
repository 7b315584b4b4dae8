"""NI's read calls of digital inputs: words, lines, waveforms."""

from __future__ import annotations

from typing import Any, Final

import hightime
import numpy as np
from ni.protobuf.types.waveform_conversion import digital_waveform_to_protobuf
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx.constants import FillMode, WaveformAttributeMode
from nitypes.waveform import DigitalWaveform, Timing
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.channels.virtual import VirtualChannel
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler
from sim_hardware.daqmx_server.services.attributes.tasks import line_bytes
from sim_hardware.daqmx_server.tasks.reading import Reading, read
from sim_hardware.daqmx_server.tasks.task import Task, task_named

_WORDS: Final = {"ReadDigitalU8": "u1", "ReadDigitalU16": "u2", "ReadDigitalU32": "u4"}


def chosen_channels(task: Task, reading: Reading) -> list[VirtualChannel]:
    """Channels of a reading, in its order."""
    return task.channels if reading.rows is None else [task.channels[row] for row in reading.rows]


def _words_handler(rpc: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")
    dtype = _WORDS[rpc]

    def handler(bench: Bench, request: Any) -> Any:
        fields = fields_of(request)
        task = task_named(bench, request.task.name)
        got = read(task, fields["num_samps_per_chan"], fields["timeout"], fields["array_size_in_samps"])
        words = got.codes.astype(dtype)
        if fields["fill_mode"] == FillMode.GROUP_BY_SCAN_NUMBER.value:
            words = words.T
        flat = np.ascontiguousarray(words).ravel()
        values = flat.tobytes() if dtype == "u1" else flat.tolist()
        return reply(read_array=values, status=got.status, samps_per_chan_read=got.count)

    return handler


def read_lines(bench: Bench, request: Any) -> Any:
    """One byte for each line."""
    fields = fields_of(request)
    task = task_named(bench, request.task.name)
    width = line_bytes(task)
    room = fields["array_size_in_bytes"] // max(width, 1)
    got = read(task, fields["num_samps_per_chan"], fields["timeout"], room)
    bits = line_states(got.codes, width)
    if fields["fill_mode"] == FillMode.GROUP_BY_SCAN_NUMBER.value:
        bits = bits.transpose(1, 0, 2)
    return pb.ReadDigitalLinesResponse(
        read_array=np.ascontiguousarray(bits).tobytes(),
        status=got.status,
        samps_per_chan_read=got.count,
        num_bytes_per_samp=width,
    )


def line_states(words: NDArray[Any], width: int) -> NDArray[np.uint8]:
    """Words (channels, samples) → states (channels, samples, lines)."""
    shifts = np.arange(width, dtype=np.uint64)
    return (words.astype(np.uint64)[:, :, None] >> shifts & 1).astype(np.uint8)


def read_scalar(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    got = read(task, 1, request.timeout)
    if got.status or len(got.codes) != 1:
        raise DaqmxError(got.status or Code.SCALAR_OF_MANY)
    return pb.ReadDigitalScalarU32Response(value=int(got.codes[0, 0]))


def read_waveforms(bench: Bench, request: Any) -> Any:
    """States of the lines with the instant of the first sample, the interval and the channel's name."""
    fields = fields_of(request)
    task = task_named(bench, request.task.name)
    got = read(task, fields["num_samps_per_chan"], fields["timeout"])
    reply = pb.ReadDigitalWaveformsResponse(status=got.status, samps_per_chan_read=got.count)
    mode = fields["waveform_attribute_mode"]
    for words, channel in zip(got.codes, chosen_channels(task, got), strict=True):
        states = line_states(words[None, :], len(channel.lines))[0]
        order = [channel.lines.index(line) for line in channel.columns]
        waveform = DigitalWaveform.from_lines(np.ascontiguousarray(states[:, order]), dtype=np.uint8)
        if mode & WaveformAttributeMode.TIMING.value:
            waveform.timing = _timing(task, bench.utc(got.first_time_s))
        if mode & WaveformAttributeMode.EXTENDED_PROPERTIES.value:
            waveform.channel_name = channel.name
            waveform.extended_properties["NI_LineNames"] = ", ".join(channel.columns)
        reply.waveforms.append(digital_waveform_to_protobuf(waveform))
    return reply


def _timing(task: Task, start: hightime.datetime) -> Timing[Any, Any, Any]:
    """Instant of the first sample, and the interval of a clocked task."""
    if not task.is_buffered:
        return Timing.create_with_no_interval(timestamp=start)
    return Timing.create_with_regular_interval(hightime.timedelta(seconds=1.0 / task.timing.rate_hz), start)


def digital_read_handlers() -> dict[str, Handler]:
    """RPC name → handler."""
    out: dict[str, Handler] = {
        "ReadDigitalLines": read_lines,
        "ReadDigitalScalarU32": read_scalar,
        "ReadDigitalWaveforms": read_waveforms,
    }
    return out | {rpc: _words_handler(rpc) for rpc in _WORDS}
