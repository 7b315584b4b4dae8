"""Making files survive the death of the machine."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

if sys.platform == "darwin":
    import fcntl


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
