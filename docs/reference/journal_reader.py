"""Reads a journal of the rocking-test recorder with nothing but Python's standard library.

    python journal_reader.py RUN.journal > readings.csv

Written for the person who finds such a file in twenty years. The format is in journal-format.md.
"""

import json
import struct
import sys
import zlib
from pathlib import Path

MAGIC = b"\x8bRKJ\r\n\x1a\n"
HEADING = struct.Struct("<8sHHI8sQqIII")  # followed by the CRC-32 of these 52 bytes
HEADING_BYTES = HEADING.size + 4
HEADER, DATA, EVENT, GAP, END = 1, 2, 3, 4, 5


def good_frames(content):
    """Every frame whose two CRCs are right, as (tag, sequence, type, channels, first, count, payload)."""
    at = content.find(MAGIC)
    while at >= 0:
        following = at + 1
        heading = content[at : at + HEADING_BYTES]
        if len(heading) == HEADING_BYTES and zlib.crc32(heading[:-4]) == struct.unpack("<I", heading[-4:])[0]:
            _, version, kind, channels, tag, sequence, first, count, size, crc = HEADING.unpack(heading[:-4])
            payload = content[at + HEADING_BYTES : at + HEADING_BYTES + size]
            if version == 1 and len(payload) == size and zlib.crc32(payload) == crc:
                yield tag, sequence, kind, channels, first, count, payload
                following = at + HEADING_BYTES + size
        at = content.find(MAGIC, following)


def read_journal(path):
    """Returns header (dict), blocks [(first sample, rows of readings)], events, gaps [(first, count, why)].

    Samples that no block holds are lost: they are not zero, and must not be interpolated silently.
    """
    frames = list(good_frames(Path(path).read_bytes()))
    # A recycled disk block may hold frames of another journal: the journal with most bytes is ours.
    weight = {}
    for tag, *_, payload in frames:
        weight[tag] = weight.get(tag, 0) + HEADING_BYTES + len(payload)
    own = max((f[0] for f in frames if f[2] == HEADER), key=weight.get, default=None)
    if own is None:
        sys.exit(f"{path}: no header of a journal was found")
    by_sequence, contradicting = {}, set()
    for _, sequence, *rest in (f for f in frames if f[0] == own):
        if by_sequence.setdefault(sequence, rest) != rest:
            contradicting.add(sequence)
    header, blocks, events, gaps, next_sample = None, [], [], [], None
    for sequence in sorted(by_sequence.keys() - contradicting):
        kind, channels, first, count, payload = by_sequence[sequence]
        if kind == HEADER and header is None:
            header = json.loads(payload)
        elif kind == EVENT:
            events.append({"sample": first, **json.loads(payload)})
        elif kind == GAP:
            gaps.append((first, count, payload.decode()))
        elif kind == DATA and (next_sample is None or first >= next_sample):
            values = struct.unpack(f"<{channels * count}d", payload)
            blocks.append((first, [values[row * count : (row + 1) * count] for row in range(channels)]))
            next_sample = first + count
    return header, blocks, events, gaps


if __name__ == "__main__":
    header, blocks, events, gaps = read_journal(sys.argv[1])
    print("sample,time_s," + ",".join(header["channel_ids"]))
    for first, rows in blocks:
        for column in range(len(rows[0])):
            values = ",".join(repr(row[column]) for row in rows)
            print(f"{first + column},{(first + column) / header['rate_hz']!r},{values}")
    for event in events:
        print("event:", json.dumps(event), file=sys.stderr)
    for first, count, why in gaps:
        print(f"gap: samples {first} to {first + count - 1}: {why}", file=sys.stderr)
