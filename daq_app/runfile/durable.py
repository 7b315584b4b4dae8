"""Making files survive the death of the machine."""

from __future__ import annotations

import contextlib
import itertools
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

if sys.platform == "darwin":
    import fcntl

_NUMBERS: Final = itertools.count()
"""Two files may be written into a folder at a time."""
_REPLACE_WAITS_S: Final = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Waits between attempts to give a file its name, 1.6 s in all; a virus scanner lets go within them
(assumed). Longer waits keep the operator waiting where a person has the file open."""


def create_anew(path: Path, mode: int = 0o644) -> int:
    """A new file, open for reading and writing. What stood there is removed, never written through.

    A name that is known beforehand (``RUN.h5.tmp``) may be a link that leads to another file.
    Raises `OSError`.
    """
    path.unlink(missing_ok=True)
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL
    flags |= getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
    return os.open(path, flags, mode)


def remove(path: Path) -> bool:
    """Remove a file, waiting a little where Windows refuses it; whether it is gone. Never raises `OSError`.

    A virus scanner, or a viewer that reads the file at that moment, lets go soon. What stays is of no harm
    where this is used: it must not turn what has been done into a failure.
    """
    for wait_s in (*_REPLACE_WAITS_S, None):
        try:
            path.unlink(missing_ok=True)
            return True
        except PermissionError:
            if wait_s is not None:
                time.sleep(wait_s)
        except OSError:
            return False
    return False


def write_whole(path: Path, content: bytes | str, *, other_name: bool = False) -> Path:
    """Write a file beside its name, flush it, and give it its name: no reader ever sees a part of it.

    A page that is open in another program on Windows cannot be replaced: with `other_name` it is written
    as ``NAME (2)``. Returns the file's path. Raises `OSError`; what stood under the name is untouched then.
    """
    data = content.encode() if isinstance(content, str) else content
    beside = name_beside(path)
    try:
        with os.fdopen(create_anew(beside), "wb") as file:
            file.write(data)
        return replace_durably(beside, path, other_name=other_name)
    finally:
        remove(beside)


def name_beside(path: Path) -> Path:
    """A hidden name beside `path`, of its suffix; not longer than its own, which may be as long as can be."""
    return path.with_name(f".{os.getpid()}-{next(_NUMBERS)}.part{path.suffix}")


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """An empty file beside `path`, to be written by name; it gets the name when the block ends well.

    Raises `OSError`; what stood under the name is untouched then, and nothing stays beside it.
    """
    beside = name_beside(path)
    try:
        os.close(create_anew(beside))
        yield beside
        replace_durably(beside, path)
    finally:
        remove(beside)


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


def replace_durably(temporary: Path, final: Path, *, other_name: bool = False) -> Path:
    """Give a finished, flushed file its name in one step that survives the death of the machine.

    On Windows a name cannot be given while another program (a viewer, a virus scanner) has the file open
    that bears it. That is waited for; then, with `other_name`, the file is called ``NAME (2)`` and so on.
    Returns the name it has. Raises `OSError`, `PermissionError` where the name stays taken.
    """
    fsync_file(temporary)
    for wait_s in (*_REPLACE_WAITS_S, None):
        try:
            temporary.replace(final)
            break
        except PermissionError:
            if wait_s is not None:
                time.sleep(wait_s)
            elif other_name and final.is_file():
                final = _free_name(final)
                temporary.replace(final)
            else:
                raise
    fsync_folder(final.parent)
    return final


def _free_name(path: Path) -> Path:
    """``report (2).pdf`` for ``report.pdf``, or the first higher number that is free."""
    numbered = (path.with_name(f"{path.stem} ({number}){path.suffix}") for number in itertools.count(2))
    return next(name for name in numbered if not name.exists())
