"""The seal of a file: SHA-256 of every block, in a place reserved inside the file (docs/run-format.md).

The seal lies in the first 64 KiB, so that it is found without any knowledge of the file's format: bytes are
proven before a library interprets them.  The seal's own bytes count as zeros in the hashes.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from daq_app.runfile.errors import RunFileError

MAGIC: Final = b"\x8bRunSeal-1\r\n\x1a\n\x00\x00"
_HEAD: Final = struct.Struct("<16sQQIIQ")
_DIGEST_BYTES: Final = 32
KEY_BYTES: Final = 32
SIGNATURE_BYTES: Final = 64
_ROOT_AT: Final = _HEAD.size
_KEY_AT: Final = _ROOT_AT + _DIGEST_BYTES
_DIGESTS_AT: Final = _KEY_AT + KEY_BYTES + SIGNATURE_BYTES
SEARCHED_BYTES: Final = 2**16
"""The seal begins within so many bytes from the start of the file."""
BLOCK_BYTES: Final = 2**16
"""Smallest block that has a hash of its own."""
_MAX_BLOCKS: Final = 2**15
"""A larger file has larger blocks: the seal never exceeds a megabyte."""

Sign = Callable[[bytes], tuple[bytes, bytes]]
"""(public key, signature) of a root hash."""


class BrokenSealError(RunFileError):
    """The seal itself is damaged: nothing in the file is proven."""


@dataclass(frozen=True, slots=True)
class Seal:
    """What the file was when it was sealed; `root` covers every other field but key and signature."""

    file_bytes: int
    offset: int
    """First byte of the seal in the file."""
    seal_bytes: int
    block_bytes: int
    digests: tuple[bytes, ...]
    """SHA-256 of each block, the seal's own bytes taken as zeros."""
    root: bytes
    public_key: bytes = b""
    """Ed25519 key of who sealed the file; empty if it is not signed."""
    signature: bytes = b""
    """Ed25519 signature of `root`."""

    @property
    def end(self) -> int:
        return self.offset + self.seal_bytes

    def without_itself(self, content: bytes, start: int) -> bytes:
        """Bytes of the file from `start` on, with the seal's own bytes as zeros."""
        low, high = max(self.offset, start), min(self.end, start + len(content))
        if low >= high:
            return content
        return content[: low - start] + bytes(high - low) + content[high - start :]

    def proves(self, index: int, content: bytes) -> bool:
        """Whether `content` is block `index` as it was sealed."""
        plain = self.without_itself(content, index * self.block_bytes)
        return hashlib.sha256(plain).digest() == self.digests[index]


def seal_bytes_for(largest_file_bytes: int) -> int:
    """Room to reserve for the seal of a file that will hardly be larger than this."""
    blocks = min(_MAX_BLOCKS, largest_file_bytes // BLOCK_BYTES + 64)
    return _DIGESTS_AT + _DIGEST_BYTES * blocks


def write_seal(path: Path, offset: int, seal_bytes: int, sign: Sign | None = None) -> None:
    """Hash a closed file and write its seal into the `seal_bytes` reserved at `offset`.

    Raises `OSError` if the file cannot be read or written.
    """
    with path.open("r+b") as file:
        size = file.seek(0, 2)
        block = BLOCK_BYTES
        while -(-size // block) > (seal_bytes - _DIGESTS_AT) // _DIGEST_BYTES:
            block *= 2
        file.seek(offset)
        file.write(bytes(seal_bytes))
        digests = b"".join(hashlib.sha256(content).digest() for content in _blocks(file, block))
        head = _HEAD.pack(MAGIC, size, offset, seal_bytes, block, len(digests) // _DIGEST_BYTES)
        root = hashlib.sha256(head + digests).digest()
        key, signature = sign(root) if sign is not None else (bytes(KEY_BYTES), bytes(SIGNATURE_BYTES))
        file.seek(offset)
        file.write(head + root + key + signature + digests)


def _blocks(file: BinaryIO, block_bytes: int) -> Iterator[bytes]:
    file.seek(0)
    while content := file.read(block_bytes):
        yield content


def read_seal(file: BinaryIO) -> Seal | None:
    """The seal of an open file; None if it has none. Raises `BrokenSealError` if it has a damaged one."""
    file.seek(0)
    at = file.read(SEARCHED_BYTES).find(MAGIC)
    if at < 0:
        return None
    file.seek(at)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise _broken()
    _, file_bytes, offset, seal_bytes, block_bytes, count = _HEAD.unpack(head)
    size = file.seek(0, 2)
    room = (seal_bytes - _DIGESTS_AT) // _DIGEST_BYTES
    if offset != at or not 0 < count <= min(room, _MAX_BLOCKS) or offset + seal_bytes > size:
        raise _broken()
    if block_bytes < BLOCK_BYTES or block_bytes.bit_count() != 1 or -(-file_bytes // block_bytes) != count:
        raise _broken()
    file.seek(at)
    content = file.read(seal_bytes)
    root, key = content[_ROOT_AT:_KEY_AT], content[_KEY_AT : _KEY_AT + KEY_BYTES]
    signature = content[_KEY_AT + KEY_BYTES : _DIGESTS_AT]
    end = _DIGESTS_AT + _DIGEST_BYTES * count
    if hashlib.sha256(head + content[_DIGESTS_AT:end]).digest() != root or any(content[end:]):
        raise _broken()
    starts = range(_DIGESTS_AT, end, _DIGEST_BYTES)
    signed = any(key) or any(signature)
    return Seal(
        file_bytes,
        offset,
        seal_bytes,
        block_bytes,
        tuple(content[start : start + _DIGEST_BYTES] for start in starts),
        root,
        key if signed else b"",
        signature if signed else b"",
    )


def _broken() -> BrokenSealError:
    return BrokenSealError(
        "its seal is damaged, so that nothing in it is proven",
        advice="If its journal is still there, `daq-app recover` makes the run anew.",
    )
