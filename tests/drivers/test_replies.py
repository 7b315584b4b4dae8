"""Replies of a device server are read where they lie, and by protobuf where they have another form."""

from __future__ import annotations

import numpy as np
import pytest
from google.protobuf.message import DecodeError
from nidaqmx._stubs.nidaqmx_pb2 import ReadAnalogF64Response

from drivers.ni.replies import SamplesReply, in_place

VALUES = np.array([1.5, -2.0, np.nan, 4.0e-300])
read = in_place(ReadAnalogF64Response.FromString)


def whole(status: int = 0, count: int = 2) -> bytes:
    reply = ReadAnalogF64Response(status=status, read_array=VALUES.tolist(), samps_per_chan_read=count)
    return bytes(reply.SerializeToString())


@pytest.mark.parametrize(("status", "count"), [(0, 2), (-200284, 1), (200_010, 70_000), (0, 0)])
def test_numbers_and_samples_are_those_of_protobuf(status: int, count: int) -> None:
    got = read(whole(status, count))
    assert isinstance(got, SamplesReply)
    assert (got.status, got.samps_per_chan_read) == (status, count)
    assert got.read_array.tobytes() == VALUES.tobytes()


def test_fields_in_another_order_are_the_same_reply() -> None:
    numbers = bytes(ReadAnalogF64Response(status=-5, samps_per_chan_read=2).SerializeToString())
    samples = bytes(ReadAnalogF64Response(read_array=VALUES.tolist()).SerializeToString())
    got = read(samples + numbers)
    assert isinstance(got, SamplesReply)
    assert (got.status, got.samps_per_chan_read) == (-5, 2)
    assert got.read_array.tobytes() == VALUES.tobytes()


@pytest.mark.parametrize(
    "extra",
    [
        pytest.param(bytes([9 << 3, 1]), id="a field that nobody knows"),
        pytest.param(bytes([2 << 3 | 1]) + np.float64(7.0).tobytes(), id="a sample by itself"),
        pytest.param(bytes([1 << 3, 3]), id="a status that comes twice"),
    ],
)
def test_a_reply_of_another_form_is_left_to_protobuf(extra: bytes) -> None:
    got = read(whole(7) + extra)
    expected = ReadAnalogF64Response.FromString(whole(7) + extra)
    assert isinstance(got, ReadAnalogF64Response)
    assert got.SerializeToString() == expected.SerializeToString()


def test_a_reply_that_is_cut_short_is_an_error_wherever_it_is_cut() -> None:
    reply = whole(-200284)
    samples = bytes(ReadAnalogF64Response(read_array=VALUES.tolist()).SerializeToString())
    for data, ends in ((reply, range(1, len(reply))), (samples, range(1, len(samples)))):
        for end in ends:
            try:
                expected = ReadAnalogF64Response.FromString(data[:end])
            except DecodeError:
                with pytest.raises(DecodeError):
                    read(data[:end])
            else:
                got = read(data[:end])
                assert got.samps_per_chan_read == expected.samps_per_chan_read
                assert list(got.read_array) == pytest.approx(list(expected.read_array), nan_ok=True)


def test_a_reply_without_samples_is_one() -> None:
    assert list(read(b"").read_array) == []
