"""Finds the good frames of a journal, whatever happened to the file.

Only a frame whose heading CRC, payload CRC and journal tag are right counts.  Where bytes are bad the
scan goes on at the next magic with a good heading.
"""

from __future__ import annotations

import zlib
from collections import Counter
from dataclasses import dataclass, field
from typing import BinaryIO, Final

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.journal.frames import HEADING_BYTES, MAGIC, Frame, FrameType, unpack_heading

_SEARCH_BYTES: Final = 2**20
_MAX_FRAMES: Final = 2_000_000
_MAX_REREAD: Final = 8
"""A file whose forged headings make us read it more than so many times over is given up."""


@dataclass(slots=True)
class Scan:
    """What lies in the file: good frames in order of sequence, and every stretch that is not one."""

    frames: list[Frame]
    bad_ranges: list[tuple[int, int]] = field(default_factory=list)
    """Byte ranges [start, end) that hold no good frame."""
    foreign: int = 0
    duplicates: int = 0
    conflicts: int = 0
    """Frames that claim the same place in the sequence with different content: none of them is used."""
    reordered: int = 0
    file_bytes: int = 0


def payload_is_good(file: BinaryIO, frame: Frame) -> bool:
    """Whether the payload is whole and matches its CRC; reads it in pieces."""
    file.seek(frame.payload_offset)
    left, crc = frame.payload_bytes, 0
    while left:
        piece = file.read(min(left, _SEARCH_BYTES))
        if not piece:
            return False
        crc = zlib.crc32(piece, crc)
        left -= len(piece)
    return crc == frame.payload_crc


def scan_frames(file: BinaryIO, file_bytes: int) -> Scan:
    """Scan a journal. Raises `RunFileError` if it holds no frame at all, or absurdly many."""
    scan = Scan([], file_bytes=file_bytes)
    frames: list[Frame] = []
    offset = 0
    reread = 0
    while offset + HEADING_BYTES <= file_bytes:
        frame = _heading_at(file, offset)
        if frame is not None and frame.end_offset <= file_bytes:
            if payload_is_good(file, frame):
                frames.append(frame)
                if len(frames) > _MAX_FRAMES:
                    raise RunFileError(f"more than {_MAX_FRAMES} frames: this is no journal of a test")
                offset = frame.end_offset
                continue
            reread += frame.payload_bytes
            if reread > _MAX_REREAD * file_bytes:
                raise RunFileError("too many broken frames to be worth reading")
        resume = _next_heading(file, offset, frame, file_bytes)
        scan.bad_ranges.append((offset, resume))
        offset = resume
    if offset < file_bytes:
        scan.bad_ranges.append((offset, file_bytes))
    scan.bad_ranges = _merged(scan.bad_ranges)
    _keep_one_journal(scan, frames)
    return scan


def _heading_at(file: BinaryIO, offset: int) -> Frame | None:
    file.seek(offset)
    return unpack_heading(file.read(HEADING_BYTES), offset)


def _next_heading(file: BinaryIO, offset: int, broken: Frame | None, file_bytes: int) -> int:
    """Where to go on after a bad place: right behind a frame with a bad payload, or at the next magic."""
    if broken is not None and _heading_at(file, broken.end_offset) is not None:
        return broken.end_offset
    position = offset + 1
    overlap = len(MAGIC) - 1
    while position < file_bytes:
        file.seek(position)
        piece = file.read(_SEARCH_BYTES + overlap)
        at = piece.find(MAGIC)
        if at >= 0:
            return position + at
        if len(piece) <= overlap:
            break
        position += len(piece) - overlap
    return file_bytes


def _keep_one_journal(scan: Scan, found: list[Frame]) -> None:
    """Keep the frames of the journal that fills this file, once each, in order of sequence."""
    weight: Counter[bytes] = Counter()
    for frame in found:
        weight[frame.tag] += HEADING_BYTES + frame.payload_bytes
    tags_with_header = {frame.tag for frame in found if frame.type is FrameType.HEADER}
    heaviest = max(tags_with_header, key=lambda tag: weight[tag], default=None)
    if heaviest is None:
        raise RunFileError(
            "no header of a journal was found in it", advice="If it is a journal, its first part is lost."
        )
    by_sequence: dict[int, Frame] = {}
    conflicting: set[int] = set()
    highest = -1
    for frame in found:
        if frame.tag != heaviest:
            scan.foreign += 1
            continue
        twin = by_sequence.get(frame.sequence)
        if twin is not None:
            same = _identity(twin) == _identity(frame)
            scan.duplicates += same
            if not same:
                conflicting.add(frame.sequence)
            continue
        scan.reordered += frame.sequence < highest
        highest = max(highest, frame.sequence)
        by_sequence[frame.sequence] = frame
    scan.conflicts = len(conflicting)
    scan.frames = [by_sequence[key] for key in sorted(by_sequence) if key not in conflicting]


def _identity(frame: Frame) -> tuple[object, ...]:
    return (
        frame.type,
        frame.first_sample,
        frame.n_samples,
        frame.n_channels,
        frame.payload_bytes,
        frame.payload_crc,
    )


def _merged(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    merged: list[tuple[int, int]] = []
    for start, end in ranges:
        if merged and merged[-1][1] == start:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((start, end))
    return merged
