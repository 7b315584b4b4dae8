"""Samples of a device server's reply where they lie: an array over its bytes, not a message with a copy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

READ_CALL: Final = "/nidaqmx_grpc.NiDAQmx/ReadAnalogF64"
_STATUS, _SAMPLES, _COUNT = 1, 2, 3
"""Numbers of the fields in NI's nidaqmx.proto."""
_VARINT, _BYTES = 0, 2
_LONGEST_VARINT: Final = 10


class SamplesReply(NamedTuple):
    """What the client takes from a reply of `READ_CALL`."""

    status: int
    read_array: NDArray[np.float64]
    samps_per_chan_read: int


def in_place(parse: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    """A reader of replies; one of another form than NI's server sends goes to `parse`, a damaged one, too."""

    def read(reply: bytes) -> Any:
        return _samples_in(reply) or parse(reply)

    return read


def _samples_in(reply: bytes) -> SamplesReply | None:
    """None unless the reply is whole: two numbers and one run of doubles, each at most once."""
    found: dict[int, Any] = {}
    position = 0
    try:
        while position < len(reply):
            key, position = _varint(reply, position)
            field, wire = key >> 3, key & 7
            if field in found:
                return None
            if wire == _VARINT and field in (_STATUS, _COUNT):
                value, position = _varint(reply, position)
                found[field] = _signed(value)
            elif wire == _BYTES and field == _SAMPLES:
                size, position = _varint(reply, position)
                if size % 8 or position + size > len(reply):
                    return None
                found[field] = np.frombuffer(reply, "<f8", size // 8, position)
                position += size
            else:
                return None
    except IndexError:  # the bytes end within a number
        return None
    if _SAMPLES not in found:
        return None
    return SamplesReply(found.get(_STATUS, 0), found[_SAMPLES], found.get(_COUNT, 0))


def _varint(data: bytes, position: int) -> tuple[int, int]:
    """A number of protobuf's form, and where the next thing begins."""
    value = 0
    for place in range(_LONGEST_VARINT):
        byte = data[position + place]
        value |= (byte & 0x7F) << 7 * place
        if byte < 0x80:
            return value, position + place + 1
    raise IndexError("a number without an end")


def _signed(value: int) -> int:
    """An int32 comes as the 64 bits of its two's complement."""
    return value - 2**64 if value >= 2**63 else value
