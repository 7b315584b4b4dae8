"""Making files survive the death of the machine."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

if sys.platform == "darwin":
    import fcntl


def create_anew(path: Path) -> int:
    """A new file, open for reading and writing. What stood there is removed, never written through.

    A name that is known beforehand (``RUN.h5.tmp``) may be a link that leads to another file.
    Raises `OSError`.
    """
    path.unlink(missing_ok=True)
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL
    flags |= getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
    return os.open(path, flags, 0o644)


def write_whole(path: Path, content: bytes | str) -> Path:
    """Write a file beside its name, flush it, and give it its name: no reader ever sees a part of it.

    Raises `OSError`; what stood under the name is untouched then.
    """
    data = content.encode() if isinstance(content, str) else content
    beside = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with os.fdopen(create_anew(beside), "wb") as file:
            file.write(data)
        replace_durably(beside, path)
    finally:
        beside.unlink(missing_ok=True)
    return path


def fsync_data(fd: int) -> None:
    """Flush a file's content and length to the device."""
    if sys.platform == "linux":
        os.fdatasync(fd)
    elif sys.platform == "darwin":
        fcntl.fcntl(fd, fcntl.F_FULLFSYNC)  # fsync there stops at the drive's own cache
    else:
        os.fsync(fd)


def fsync_folder(folder: Path) -> None:
    """Flush a folder's list of names. Windows has no such call and needs none."""
    if sys.platform == "win32":
        return
    fd = os.open(folder, os.O_RDONLY)
    try:
        # Some network file systems refuse to flush a folder; its names are then their affair.
        with contextlib.suppress(OSError):
            os.fsync(fd)
    finally:
        os.close(fd)


def fsync_file(path: Path) -> None:
    """Flush a closed file to the device."""
    fd = os.open(path, os.O_RDWR | getattr(os, "O_BINARY", 0))
    try:
        fsync_data(fd)
    finally:
        os.close(fd)


def replace_durably(temporary: Path, final: Path) -> None:
    """Give a finished, flushed file its name in one step that survives the death of the machine."""
    fsync_file(temporary)
    temporary.replace(final)
    fsync_folder(final.parent)
