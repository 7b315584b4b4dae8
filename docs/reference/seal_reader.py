"""Proves the seal of a run file with nothing but the standard library: ``python seal_reader.py RUN.h5``.

Hashes only; whose signature it is, ``daq-app verify`` tells. The layout is that of docs/run-format.md.
"""

import hashlib
import struct
import sys
from pathlib import Path

MAGIC = b"\x8bRunSeal-1\r\n\x1a\n\x00\x00"
HEAD = struct.Struct("<16sQQIIQ")


def changed_ranges(content):
    """[(start, end)] of the bytes that are not those that were sealed. Raises ValueError without a seal."""
    at = content[:65536].find(MAGIC)
    if at < 0:
        raise ValueError("no seal")
    head = content[at : at + HEAD.size]
    _, file_bytes, offset, seal_bytes, block_bytes, count = HEAD.unpack(head)
    root = content[at + HEAD.size : at + HEAD.size + 32]
    first = at + HEAD.size + 32 + 32 + 64  # root, public key, signature
    digests = content[first : first + 32 * count]
    if hashlib.sha256(head + digests).digest() != root:
        raise ValueError("the seal itself is damaged")
    plain = content[:offset] + bytes(seal_bytes) + content[offset + seal_bytes :]
    changed = []
    for index in range(count):
        start = index * block_bytes
        block = plain[start : start + block_bytes]
        if hashlib.sha256(block).digest() != digests[32 * index : 32 * index + 32]:
            changed.append((start, start + block_bytes))
    if len(content) > file_bytes:
        changed.append((file_bytes, len(content)))
    return changed


if __name__ == "__main__":
    found = changed_ranges(Path(sys.argv[1]).read_bytes())
    for start, end in found:
        print(f"changed: bytes {start} to {end}")
    if not found:
        print("every byte is the one that was sealed")
    sys.exit(1 if found else 0)
