"""NI's read calls: the same samples as floating point, integers, raw bytes or waveforms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from ni.protobuf.types.precision_timestamp_conversion import hightime_datetime_to_protobuf
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx.constants import FillMode, WaveformAttributeMode
from numpy.typing import NDArray

from sim_hardware.daqmx_server.bench.bench import Bench
from sim_hardware.daqmx_server.errors import Code, DaqmxError
from sim_hardware.daqmx_server.requests import fields_of
from sim_hardware.daqmx_server.services.attributes.groups import Handler
from sim_hardware.daqmx_server.services.reads.digital_reads import chosen_channels
from sim_hardware.daqmx_server.tasks.reading import read
from sim_hardware.daqmx_server.tasks.task import task_named


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append((value & 0x7F) | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


_ARRAY_TAG: Final = _varint(pb.ReadAnalogF64Response.DESCRIPTOR.fields_by_name["read_array"].number << 3 | 2)


def encode_f64(values: NDArray[np.float64], status: int, count: int) -> bytes:
    """A serialised ReadAnalogF64Response, without one Python object per sample.

    The packed field of doubles is the little-endian memory of the array itself.
    """
    head: bytes = pb.ReadAnalogF64Response(status=status, samps_per_chan_read=count).SerializeToString()
    body = np.ascontiguousarray(values, dtype="<f8").tobytes()
    return b"".join((head, _ARRAY_TAG, _varint(len(body)), body))


def _layout(values: NDArray[Any], fill_mode: int) -> NDArray[Any]:
    """(channels, samples) in the order the client asked for."""
    return values.T if fill_mode == FillMode.GROUP_BY_SCAN_NUMBER.value else values


def read_f64(bench: Bench, request: Any) -> bytes:
    fields = fields_of(request)
    task = task_named(bench, request.task.name)
    got = read(task, fields["num_samps_per_chan"], fields["timeout"], fields["array_size_in_samps"])
    values = _layout(task.scan.readings(got.codes, got.rows), fields["fill_mode"])
    spoiled = bench.faults.take("reply_cut_short", task.name)
    if spoiled is None:
        return encode_f64(values, got.status, got.count)
    if spoiled.text("part") == "array":
        return encode_f64(values.ravel()[: values.size // 2], got.status, got.count)
    whole = encode_f64(values, got.status, got.count)
    return whole[: len(whole) // 2]


def read_scalar(bench: Bench, request: Any) -> Any:
    task = task_named(bench, request.task.name)
    got = read(task, 1, request.timeout)
    if got.status or len(got.codes) != 1:
        raise DaqmxError(got.status or Code.SCALAR_OF_MANY)
    return pb.ReadAnalogScalarF64Response(value=float(task.scan.readings(got.codes, got.rows)[0, 0]))


def _binary_handler(rpc: str, dtype: str) -> Handler:
    reply = getattr(pb, f"{rpc}Response")

    def handler(bench: Bench, request: Any) -> Any:
        fields = fields_of(request)
        task = task_named(bench, request.task.name)
        got = read(task, fields["num_samps_per_chan"], fields["timeout"], fields["array_size_in_samps"])
        codes = _layout(got.codes.astype(dtype), fields["fill_mode"])
        return reply(read_array=codes.ravel().tolist(), status=got.status, samps_per_chan_read=got.count)

    return handler


def read_raw(bench: Bench, request: Any) -> Any:
    """Bytes as the device sends them: scan by scan, each channel in its own width.

    As many as the client's array has: it clears what is behind the last scan with them.
    """
    task = task_named(bench, request.task.name)
    width = sum(channel.raw_bytes for channel in task.channels)
    got = read(task, request.num_samps_per_chan, request.timeout)
    types = [
        (f"c{row}", "<i2" if channel.raw_bytes == 2 else "<i4")
        for row, channel in enumerate(chosen_channels(task, got))
    ]
    scans = np.empty(got.count, dtype=types)
    for (name, _), codes in zip(types, got.codes, strict=True):
        scans[name] = codes
    read_array = scans.tobytes().ljust(request.array_size_in_bytes, b"\0")
    return pb.ReadRawResponse(
        status=got.status, read_array=read_array, samps_read=got.count, num_bytes_per_samp=width
    )


def read_waveforms(bench: Bench, request: Any) -> Any:
    """Readings with the instant of the first sample, the interval, name and unit of each channel."""
    task = task_named(bench, request.task.name)
    got = read(task, request.num_samps_per_chan, request.timeout)
    mode = fields_of(request)["waveform_attribute_mode"]
    reply = pb.ReadAnalogWaveformsResponse(status=got.status, samps_per_chan_read=got.count)
    readings = task.scan.readings(got.codes, got.rows)
    for values, channel in zip(readings, chosen_channels(task, got), strict=True):
        waveform = reply.waveforms.add()
        waveform.y_data.extend(values.tolist())
        if mode & WaveformAttributeMode.TIMING.value:
            waveform.dt = 1.0 / task.timing.rate_hz if task.is_buffered else 0.0
            waveform.t0.CopyFrom(hightime_datetime_to_protobuf(bench.utc(got.first_time_s)))
        if mode & WaveformAttributeMode.EXTENDED_PROPERTIES.value:
            waveform.attributes["NI_ChannelName"].string_value = channel.name
            waveform.attributes["NI_UnitDescription"].string_value = channel.unit_name
    return reply


def read_handlers() -> dict[str, Callable[[Bench, Any], Any]]:
    """RPC name → handler."""
    out: dict[str, Handler] = {
        "ReadAnalogF64": read_f64,
        "ReadAnalogScalarF64": read_scalar,
        "ReadRaw": read_raw,
        "ReadAnalogWaveforms": read_waveforms,
    }
    for rpc, dtype in (
        ("ReadBinaryI16", "i2"),
        ("ReadBinaryU16", "u2"),
        ("ReadBinaryI32", "i4"),
        ("ReadBinaryU32", "u4"),
    ):
        out[rpc] = _binary_handler(rpc, dtype)
    return out


__all__ = ["encode_f64", "read_handlers"]
