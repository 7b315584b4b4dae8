"""One frame of a journal: a heading of 56 bytes and a payload, each with its CRC-32.

Little-endian.  CRC-32 is that of IEEE 802.3 (`zlib.crc32`): every Python has it, and at 3 GB/s it is
sixty times faster than 41 channels at 40 times the rate need.  ``docs/reference/journal-format.md`` is the
specification.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

MAGIC: Final = b"\x8bRKJ\r\n\x1a\n"
JOURNAL_VERSION: Final = 1
_HEADING: Final = struct.Struct("<8sHHI8sQqIII")
_CRC: Final = struct.Struct("<I")
HEADING_BYTES: Final = _HEADING.size + _CRC.size
MAX_PAYLOAD_BYTES: Final = 2**28
MAX_TEXT_BYTES: Final = 2**24
"""Longest header, event or reason: more is read by nobody."""
TAG_BYTES: Final = 8


class FrameType(IntEnum):
    """What a frame's payload is."""

    HEADER = 1
    """UTF-8 JSON of `RunHeader`; written again later so that no single place on disk holds it alone."""
    DATA = 2
    """float64 readings, channel after channel (n_channels, n_samples)."""
    EVENT = 3
    """UTF-8 JSON {kind, text, data}; `first_sample` is the event's sample."""
    GAP = 4
    """UTF-8 reason; `n_samples` samples from `first_sample` are not there."""
    END = 5
    """Empty: the run was closed in good order; `first_sample` is one past the last sample."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Heading of a frame whose heading CRC was good, and where its payload lies."""

    type: FrameType
    tag: bytes
    """Random per journal: a frame of another journal (a recycled disk block) is not ours."""
    sequence: int
    first_sample: int
    n_samples: int
    n_channels: int
    payload_bytes: int
    payload_crc: int
    payload_offset: int

    @property
    def end_offset(self) -> int:
        return self.payload_offset + self.payload_bytes

    @property
    def end_sample(self) -> int:
        return self.first_sample + self.n_samples


def pack_frame(
    type_: FrameType,
    tag: bytes,
    sequence: int,
    payload: bytes | memoryview,
    *,
    first_sample: int = 0,
    n_samples: int = 0,
    n_channels: int = 0,
) -> bytes:
    """Heading and payload as one piece, so that a frame is one write."""
    heading = _HEADING.pack(
        MAGIC,
        JOURNAL_VERSION,
        type_,
        n_channels,
        tag,
        sequence,
        first_sample,
        n_samples,
        len(payload),
        zlib.crc32(payload),
    )
    return b"".join((heading, _CRC.pack(zlib.crc32(heading)), payload))


def unpack_heading(data: bytes, offset: int) -> Frame | None:
    """The heading in `data` (56 bytes read at file `offset`), or None if it is no good heading."""
    if len(data) < HEADING_BYTES or data[: len(MAGIC)] != MAGIC:
        return None
    if zlib.crc32(data[: _HEADING.size]) != _CRC.unpack_from(data, _HEADING.size)[0]:
        return None
    fields = _HEADING.unpack_from(data)
    _, version, type_, n_channels, tag, sequence, first_sample, n_samples, payload_bytes, payload_crc = fields
    if version != JOURNAL_VERSION or type_ not in FrameType.__members__.values():
        return None
    if payload_bytes > MAX_PAYLOAD_BYTES:
        return None
    if type_ == FrameType.DATA and payload_bytes != 8 * n_channels * n_samples:
        return None
    return Frame(
        FrameType(type_),
        tag,
        sequence,
        first_sample,
        n_samples,
        n_channels,
        payload_bytes,
        payload_crc,
        offset + HEADING_BYTES,
    )
