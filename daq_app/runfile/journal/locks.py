"""Locks that end with their process, on Windows and elsewhere.

A lock covers one byte far beyond the end of the file, so that on Windows, where locks bar reading,
the file's content stays readable to everyone.  A killed process leaves no lock behind.

A folder is locked by itself, not only by a file in it: a file can be deleted under its owner, and another
would then lock a new one.  Windows cannot lock a folder, and does not let an open file be deleted.
"""

from __future__ import annotations

import os
import socket
import stat
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


def _own_file(path: Path) -> int:
    """The lock file opened, made if need be. Raises `RunFileError` if its name leads to another file."""
    flags = os.O_RDWR | os.O_CREAT
    for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, name, 0)
    elsewhere = RunFileError(
        f"{path} is a link to another file, which must not be written to",
        advice="Find out who put it there, remove it, and start again.",
    )
    if path.is_symlink():
        raise elsewhere
    fd = os.open(path, flags, 0o644)
    try:
        opened = os.fstat(fd)
        if not stat.S_ISREG(opened.st_mode) or opened.st_nlink > 1 or path.is_symlink():
            raise elsewhere
    except BaseException:
        os.close(fd)
        raise
    return fd


def _locked(fd: int, *, may_be_impossible: bool) -> bool:
    """Whether the lock was got; also where the file system cannot lock this kind of file."""
    try:
        return _try_lock(fd)
    except OSError:
        if not may_be_impossible:
            raise
        return True


class FolderLock:
    """Exclusive right to record into a folder: two recorders never share one.

    The lock file stays behind (it names the last owner); the lock itself does not.
    """

    def __init__(self, folder: Path) -> None:
        """Take the lock. Raises `BusyError` naming the owner, `RunFileError` if the folder is unusable."""
        self.path = folder / ".recorder.lock"
        self._fds: list[int] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._take(folder)
        except OSError as error:
            self.release()
            raise RunFileError(
                f"{folder}: cannot be written to ({error.strerror})",
                advice="Choose a folder on a writable disk.",
            ) from error
        except RunFileError:
            self.release()
            raise

    def _take(self, folder: Path) -> None:
        file = _own_file(self.path)
        self._fds.append(file)
        fds = [file]
        if sys.platform != "win32":
            fds.append(os.open(folder, os.O_RDONLY | os.O_CLOEXEC))
            self._fds.append(fds[1])
        for fd in fds:
            if not _locked(fd, may_be_impossible=fd != file):
                self._fds.remove(file)
                owner = os.read(file, _OWNER_BYTES).decode("utf-8", "replace")
                os.close(file)
                raise BusyError(
                    f"{folder} is in use by another recorder ({owner or 'owner unknown'})",
                    advice="Stop that one first, or record into another folder.",
                )
        os.ftruncate(file, 0)
        os.write(file, f"process {os.getpid()} on {socket.gethostname()}"[:_OWNER_BYTES].encode())

    def release(self) -> None:
        """Give the folder back; safe twice."""
        for fd in self._fds:
            os.close(fd)
        self._fds = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
