"""A recorder with a disk that fails on order, and what it wrote."""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.messages.items import Arrived, Begin, End, Item
from daq_app.acquisition.messages.published import EventMessage
from daq_app.acquisition.pipeline.recent import Recent
from daq_app.acquisition.pipeline.recorder import Recorder
from daq_app.acquisition.pipeline.ring import Ring
from daq_app.acquisition.pipeline.run_recording import Recorded
from daq_app.runfile import RunHeader, read_journal
from drivers import Block

N_CHANNELS = 4


class Disk:
    """Stands between the journal and the system; fails on command."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.full = False
        self.broken: bool | Path = False
        """All files, or that one."""
        self.flush_breaks: Path | None = None
        self.flush_takes = threading.Event()
        self.flush_takes.set()
        write, fsync = os.write, os.fsync

        def failing_write(fd: int, data: Any) -> int:
            if self.full:
                raise OSError(errno.ENOSPC, "No space left on device")
            if self.broken is True or (self.broken and _is(fd, self.broken)):
                raise OSError(errno.EIO, "Input/output error")
            return write(fd, data)

        def slow_fsync(fd: int) -> None:
            if not self.flush_takes.wait(10.0):
                raise OSError(errno.EIO, "Input/output error")
            if self.flush_breaks is not None and _is(fd, self.flush_breaks):
                raise OSError(errno.EIO, "Input/output error")
            fsync(fd)

        monkeypatch.setattr("os.write", failing_write)
        for name in ("fsync", "fdatasync"):
            if hasattr(os, name):
                monkeypatch.setattr(f"os.{name}", slow_fsync)


def _is(fd: int, path: Path | bool) -> bool:
    return isinstance(path, Path) and path.exists() and os.path.samestat(os.fstat(fd), path.stat())


class Bench:
    """A recorder with everything it says and hands over."""

    def __init__(
        self,
        folder: Path,
        spare: Path | None = None,
        ring: Ring | None = None,
        recent: Recent | None = None,
    ) -> None:
        self.folder = folder
        self.forwarded: list[Item] = []
        self.said: list[EventMessage] = []
        self.handed: list[Recorded] = []
        self.changed = threading.Condition()
        self.recorder = Recorder(
            self._note(self.forwarded),
            self._note(self.said),
            self._note(self.handed),
            [spare] if spare is not None else [],
            ring,
            recent,
        )
        if ring is not None:
            ring.start()
        self.recorder.start()

    def _note(self, where: list[Any]) -> Callable[[Any], None]:
        def note(what: Any) -> None:
            with self.changed:
                where.append(what)
                self.changed.notify_all()

        return note

    def until(self, right: Callable[[], bool], timeout_s: float = 60.0) -> None:
        deadline = time.monotonic() + timeout_s
        with self.changed:
            while not right():
                assert time.monotonic() < deadline, (self.said, self.recorder.status)
                self.changed.wait(0.05)

    def begin(self, name: str = "run", before_samples: int = 0, kept: bool = False) -> Path:
        done: Future[Path] = Future()
        path = self.folder / f"{name}.journal"
        self.recorder.inbox.put(Begin(path, header(name), done, before_samples, kept))
        return done.result(10.0)

    def begin_and_keep(self, blocks: int) -> Path:
        """The journal of a new run whose first blocks the disk has confirmed."""
        journal = self.begin()
        self.blocks(0, blocks)
        self.until(lambda: self.recorder.status.acknowledged_sample == 100 * blocks)
        return journal

    def blocks(self, first: int, count: int) -> None:
        for n in range(first, first + count):
            self.recorder.inbox.put(Arrived(Block(n * 100, readings(n * 100), 0, 0), time.perf_counter()))

    def end(self) -> Recorded:
        self.recorder.inbox.put(End("complete", 0, "done"))
        self.until(lambda: bool(self.handed))
        return self.handed[-1]

    def heard(self, severity: str, words: str) -> bool:
        return any(e.severity == severity and words in e.text for e in self.said)


def header(name: str) -> RunHeader:
    return RunHeader(
        run_id=name,
        channel_ids=tuple(f"C{n}" for n in range(N_CHANNELS)),
        reading_units=("V",) * N_CHANNELS,
        rate_hz=4000.0,
    )


def readings(first: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.arange(first, first + 100.0) + 1000.0 * np.arange(N_CHANNELS)[:, None]


def contents(journal: Path) -> dict[int, float]:
    """Sample → reading of the first channel."""
    found: dict[int, float] = {}
    with read_journal(journal) as opened:
        for first, window in opened.windows(1000):
            for offset, value in enumerate(window[0]):
                if not np.isnan(value):
                    found[first + offset] = value
    return found
