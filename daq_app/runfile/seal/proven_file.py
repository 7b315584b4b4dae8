"""A sealed file that hands out proven bytes only."""

from __future__ import annotations

import io
import os
from collections import OrderedDict
from pathlib import Path
from typing import Any, Final

from daq_app.runfile.seal.format import Seal, read_seal

_KEPT_BYTES: Final = 2**23


class ProvenFile(io.RawIOBase):
    """Reads a sealed file block by block; a block whose hash is wrong raises `OSError` and is never seen."""

    def __init__(self, path: Path, seal: Seal) -> None:
        self._seal = seal
        self._file = path.open("rb", buffering=0)
        self._size = self._file.seek(0, os.SEEK_END)
        self._position = 0
        self._kept: OrderedDict[int, bytes] = OrderedDict()
        """The blocks used last."""
        self._n_kept = max(2, _KEPT_BYTES // seal.block_bytes)

    def readinto(self, buffer: Any) -> int:
        """Proven bytes from the present position. Raises `OSError` where the file is damaged."""
        view = memoryview(buffer).cast("B")
        length = max(0, min(len(view), self._size - self._position))
        done = 0
        while done < length:
            index, offset = divmod(self._position + done, self._seal.block_bytes)
            part = self._block(index)[offset : offset + length - done]
            if not part:
                raise OSError("the file is shorter than when it was sealed")
            view[done : done + len(part)] = part
            done += len(part)
        self._position += length
        return length

    def _block(self, index: int) -> bytes:
        kept = self._kept.get(index)
        if kept is not None:
            self._kept.move_to_end(index)
            return kept
        content = self._read(index)
        if index >= len(self._seal.digests) or not self._seal.proves(index, content):
            start = index * self._seal.block_bytes
            raise OSError(f"bytes {start} to {start + len(content)} are not the ones that were sealed")
        self._kept[index] = content
        if len(self._kept) > self._n_kept:
            self._kept.popitem(last=False)
        return content

    def _read(self, index: int) -> bytes:
        self._file.seek(index * self._seal.block_bytes)
        pieces = []
        left = self._seal.block_bytes
        while left and (piece := self._file.read(left)):
            pieces.append(piece)
            left -= len(piece)
        return b"".join(pieces)

    def damaged_ranges(self) -> list[tuple[int, int]]:
        """Byte ranges [start, end) that are not the ones that were sealed; empty for a whole file."""
        ranges: list[tuple[int, int]] = []
        size = self._seal.block_bytes
        for index in range(len(self._seal.digests)):
            if not self._seal.proves(index, self._read(index)):
                start, end = index * size, min((index + 1) * size, self._seal.file_bytes)
                if ranges and ranges[-1][1] == start:
                    start = ranges.pop()[0]
                ranges.append((start, end))
        if self._size > self._seal.file_bytes:
            ranges.append((self._seal.file_bytes, self._size))
        return ranges

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence]
        self._position = base + offset
        return self._position

    def tell(self) -> int:
        return self._position

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()


def seal_of(path: Path) -> Seal | None:
    """The seal of a file; None if it has none. Raises `BrokenSealError` or `OSError`."""
    with path.open("rb") as file:
        return read_seal(file)
