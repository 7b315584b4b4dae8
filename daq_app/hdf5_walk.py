"""``python -m daq_app.hdf5_walk``: touches everything in HDF5 files that reading a run would touch.

Damaged or forged HDF5 can make the library loop for ever, crash, or take all memory.  So a file of unknown
soundness is walked through here first, in a process that may be killed: one path a line (JSON) on standard
input, one answer a line.  The process ends when its standard input closes, that is, with its parent.
Stands apart from the run files so that it starts without the rest of the program.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import h5py

_MAX_OBJECTS: Final = 20_000
_SMALL_BYTES: Final = 2**22
_MAX_TEXT_ROWS: Final = 1_000_000
_TEXT_ROWS: Final = 1000


def walk(path: str) -> None:
    """Touch links, types, attributes, indexes of chunks, texts and small datasets of a file.

    Damage that the library reports is no danger: whoever reads the file hears of it too.  Raises
    `MemoryError` where memory does not suffice, and `AbsurdError` for absurdly many objects or texts.
    """
    seen: set[object] = set()
    with _harmless(), h5py.File(path, "r", locking="best-effort") as file:
        waiting: list[Any] = [file]
        while waiting:
            thing = waiting.pop()
            with _harmless():
                address = h5py.h5o.get_info(thing.id).addr
                if address in seen:
                    continue
                seen.add(address)
            if len(seen) > _MAX_OBJECTS:
                raise AbsurdError("it holds absurdly many objects")
            _touch_attributes(thing)
            if isinstance(thing, h5py.Dataset):
                _touch_dataset(thing)
            elif isinstance(thing, h5py.Group):
                waiting += _children(thing)


class AbsurdError(Exception):
    """More of something than any file of ours holds."""


@contextlib.contextmanager
def _harmless() -> Iterator[None]:
    """Let errors of the library pass, but for lack of memory."""
    try:
        yield
    except (AbsurdError, MemoryError):
        raise
    except Exception as error:
        if "memory" in str(error) or "alloc" in str(error):
            raise MemoryError(str(error)) from error


def _touch_attributes(thing: Any) -> None:
    names: list[str] = []
    with _harmless():
        names = list(thing.attrs)
    for name in names:
        with _harmless():
            _ = thing.attrs[name]


def _children(group: h5py.Group) -> list[Any]:
    """What lies in the group itself; links to elsewhere are not followed."""
    names: list[str] = []
    with _harmless():
        names = list(group)
    children = []
    for name in names:
        with _harmless():
            if isinstance(group.get(name, getlink=True), h5py.HardLink):
                children.append(group[name])
    return children


def _touch_dataset(dataset: h5py.Dataset) -> None:
    with _harmless():
        creation = dataset.id.get_create_plist()
        kind = creation.get_layout()
        if kind == h5py.h5d.VIRTUAL or creation.get_external_count() or dataset.shape is None:
            return
        if kind == h5py.h5d.CHUNKED:
            dataset.id.chunk_iter(lambda chunk: None)
    with _harmless():
        is_text = h5py.check_string_dtype(dataset.dtype) is not None
        if dataset.dtype.kind == "O" and not is_text:
            return  # references and ragged arrays: no reader of ours looks into them
        if is_text and dataset.size > _MAX_TEXT_ROWS:
            raise AbsurdError("it holds absurdly many texts")
        if is_text and dataset.shape != ():
            for start in range(0, dataset.size, _TEXT_ROWS):
                with _harmless():
                    _ = dataset[start : start + _TEXT_ROWS]
        elif dataset.size * dataset.dtype.itemsize <= _SMALL_BYTES:
            _ = dataset[()]


def _limit_memory(n_bytes: int) -> None:
    """Let allocations beyond fail, where the system has such a limit; the parent looks everywhere."""
    if sys.platform != "linux":
        return
    import resource

    with contextlib.suppress(OSError, ValueError):
        # The libraries that are loaded already (threads of their own, buffers) are no fault of a file.
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
        limit = pages * resource.getpagesize() + n_bytes
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def main() -> None:
    """Serve until the parent goes."""
    _limit_memory(int(sys.argv[1]))
    for line in sys.stdin:
        answer = ""
        try:
            walk(json.loads(line))
        except MemoryError:
            answer = "reading it takes too much memory"
        except AbsurdError as error:
            answer = str(error)
        print(json.dumps(answer), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
