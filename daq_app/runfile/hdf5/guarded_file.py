"""A file under the HDF5 library that never fails in its face.

If a write fails while HDF5 closes a file (disk full, device gone), the library crashes the whole process
(seen with h5py 3.16 and HDF5 2.0 under a file size limit: segmentation fault).  So HDF5 writes through this
object: after the first failure it keeps in memory what HDF5 still wants to write, says yes to everything, and
the caller raises the failure once HDF5 has let go.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from daq_app.runfile.durable import create_anew


class GuardedFile(io.RawIOBase):
    """A new file, replacing one that is there. `failure` is the first error of a write, or None."""

    def __init__(self, path: Path) -> None:
        self._fd = create_anew(path)
        self._position = 0
        self._size = 0
        self._kept: list[tuple[int, bytes]] = []
        """Writes that did not reach the disk, in order."""
        self.failure: OSError | None = None

    def write(self, data: Any) -> int:
        """Take all bytes, whatever becomes of them."""
        view = memoryview(data).cast("B")
        if self.failure is None:
            try:
                self._write_all(view)
            except OSError as error:
                self.failure = error
        if self.failure is not None:
            self._kept.append((self._position, bytes(view)))
        self._position += len(view)
        self._size = max(self._size, self._position)
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """What was written, on disk or kept."""
        view = memoryview(buffer).cast("B")
        length = max(0, min(len(view), self._size - self._position))
        view[:length] = bytes(length)
        os.lseek(self._fd, self._position, os.SEEK_SET)
        done = 0
        while done < length and (part := os.read(self._fd, length - done)):
            view[done : done + len(part)] = part
            done += len(part)
        for offset, data in self._kept:
            low, high = max(offset, self._position), min(offset + len(data), self._position + length)
            if low < high:
                view[low - self._position : high - self._position] = data[low - offset : high - offset]
        self._position += length
        return length

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence]
        self._position = base + offset
        return self._position

    def tell(self) -> int:
        return self._position

    def truncate(self, size: int | None = None) -> int:
        """Set the length; a failure is kept like that of a write."""
        self._size = self._position if size is None else size
        if self.failure is None:
            try:
                os.ftruncate(self._fd, self._size)
            except OSError as error:
                self.failure = error
        return self._size

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def close(self) -> None:
        if not self.closed:
            os.close(self._fd)
        super().close()

    def raise_failure(self) -> None:
        """Raise the failure of an earlier write, if there was one. Call it from time to time."""
        if self.failure is not None:
            raise self.failure

    def _write_all(self, view: memoryview) -> None:
        os.lseek(self._fd, self._position, os.SEEK_SET)
        done = 0
        while done < len(view):
            done += os.write(self._fd, view[done:])


@contextmanager
def guarded_hdf5(path: Path, **options: Any) -> Iterator[tuple[h5py.File, GuardedFile]]:
    """A new HDF5 file whose writes cannot crash the process. Raises `OSError` of the first failed write."""
    with GuardedFile(path) as guarded:
        with h5py.File(guarded, "w", **options) as file:
            yield file, guarded
        guarded.raise_failure()
