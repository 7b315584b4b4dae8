"""Locks that end with their process, on Windows and elsewhere.

A lock covers one byte far beyond the end of the file, so that on Windows, where locks bar reading,
the file's content stays readable to everyone.  A killed process leaves no lock behind.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

from daq_app.runfile.errors import BusyError, RunFileError

_LOCKED_BYTE = 2**40
_OWNER_BYTES = 200

if sys.platform == "win32":
    import msvcrt

    def _try_lock(fd: int) -> bool:
        os.lseek(fd, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        finally:
            os.lseek(fd, 0, os.SEEK_SET)
        return True

else:
    import fcntl

    def _try_lock(fd: int) -> bool:
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def lock_file(fd: int, what: str) -> None:
    """Take the lock of an open file until it is closed. Raises `BusyError` if another has it."""
    if not _try_lock(fd):
        raise BusyError(
            f"{what} is in use by another process",
            advice="Wait until it is done, or stop that process first.",
        )


@contextmanager
def journal_locked(path: Path) -> Iterator[None]:
    """Hold the lock of an existing journal, as its recorder does while it records.

    Raises `BusyError` if the recorder or another recovery has it, `RunFileError` if it cannot be opened.
    """
    try:
        fd = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0))
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})") from error
    try:
        lock_file(fd, str(path))
        yield
    finally:
        os.close(fd)


class FolderLock:
    """Exclusive right to record into a folder: two recorders never share one.

    The lock file stays behind (empty of meaning once its owner is gone); the lock itself does not.
    """

    def __init__(self, folder: Path) -> None:
        """Take the lock. Raises `BusyError` naming the owner, `RunFileError` if the folder is unusable."""
        self.path = folder / ".recorder.lock"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
            self._fd = os.open(self.path, flags, 0o644)
        except OSError as error:
            raise RunFileError(
                f"{folder}: cannot be written to ({error.strerror})",
                advice="Choose a folder on a writable disk.",
            ) from error
        if not _try_lock(self._fd):
            owner = os.read(self._fd, _OWNER_BYTES).decode("utf-8", "replace")
            os.close(self._fd)
            raise BusyError(
                f"{folder} is in use by another recorder ({owner or 'owner unknown'})",
                advice="Stop that one first, or record into another folder.",
            )
        os.ftruncate(self._fd, 0)
        os.write(self._fd, f"process {os.getpid()} on {socket.gethostname()}"[:_OWNER_BYTES].encode())

    def release(self) -> None:
        """Give the folder back; safe twice."""
        if self._fd >= 0:
            with contextlib.suppress(OSError):
                os.ftruncate(self._fd, 0)
            os.close(self._fd)
            self._fd = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
