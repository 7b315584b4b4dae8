"""An acquisition process with a saboteur in it: the machine under it fails when a test says so.

The test sends what is to be broken; a thread here hears it and makes the system calls of this process behave
accordingly. Everything above the system calls is the product as it ships.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import threading
import time
from collections import namedtuple
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from daq_app.acquisition.process.process import run_and_exit

Usage = namedtuple("Usage", "total used free")


class Saboteur:
    """What is broken now; see `NAMES`."""

    NAMES = (*("read_only", "refusal", "flush_s", "free_bytes", "clock_s", "memory_bytes", "no_memory"),)
    """`read_only`: the folder whose files cannot be written; `refusal`: the error it gives, EROFS if none."""

    def __init__(self, orders: Connection) -> None:
        self._orders = orders
        self._now: dict[str, Any] = {}
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        with contextlib.suppress(EOFError, OSError):  # the test has ended
            while True:
                self._now = self._orders.recv()

    def get(self, name: str) -> Any:
        return self._now.get(name)

    def is_hit(self, fd_or_path: Any) -> bool:
        """Whether a file lies in the folder that became read-only."""
        folder = self.get("read_only")
        if not folder:
            return False
        try:
            path = (
                Path(f"/proc/self/fd/{fd_or_path}").readlink() if isinstance(fd_or_path, int) else fd_or_path
            )
        except OSError:
            return False
        return str(path).startswith(folder + os.sep)

    def _refusal(self, *path: str) -> OSError:
        number = int(self.get("refusal") or errno.EROFS)
        return OSError(number, os.strerror(number), *path)

    def install(self) -> None:
        """Stand between Python and the system."""
        self._on_disk()
        self._on_clock_and_memory()

    def _on_disk(self) -> None:
        write, opened, usage = os.write, os.open, shutil.disk_usage

        def sabotaged_write(fd: int, data: Any) -> int:
            if self.is_hit(fd):
                raise self._refusal()
            return write(fd, data)

        def sabotaged_open(path: Any, flags: int, *more: Any, **named: Any) -> int:
            if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT) and self.is_hit(path):
                raise self._refusal(str(path))
            return opened(path, flags, *more, **named)

        def slow(flush: Any) -> Any:
            def flushed(fd: int) -> None:
                if self.get("flush_s"):
                    time.sleep(float(self.get("flush_s")))
                flush(fd)

            return flushed

        def sabotaged_usage(path: Any) -> Any:
            free = self.get("free_bytes")
            return usage(path) if free is None else Usage(10**12, 10**12 - int(free), int(free))

        os.write, os.open, shutil.disk_usage = sabotaged_write, sabotaged_open, sabotaged_usage
        os.fsync = slow(os.fsync)
        if hasattr(os, "fdatasync"):
            os.fdatasync = slow(os.fdatasync)

    def _on_clock_and_memory(self) -> None:
        import psutil

        from daq_app.acquisition.session import machine_watch
        from daq_app.runfile.journal import writer as journal

        seconds, nanoseconds, memory, pack = (
            time.time,
            time.time_ns,
            psutil.virtual_memory,
            journal.pack_frame,
        )

        def sabotaged_memory() -> Any:
            left = self.get("memory_bytes")
            return memory() if left is None else memory()._replace(available=int(left))

        def sabotaged_pack(*arguments: Any, **named: Any) -> bytes:
            if self.get("no_memory"):
                raise MemoryError
            return pack(*arguments, **named)

        def sabotaged_time() -> float:
            return seconds() + float(self.get("clock_s") or 0.0)

        # Only what this product asks for the time: gRPC compares Python's clock with the system's own.
        time.time_ns = lambda: nanoseconds() + int(1e9 * float(self.get("clock_s") or 0.0))
        machine_watch.MachineWatch.__init__.__defaults__ = (
            time.monotonic,
            sabotaged_time,
            machine_watch.available_memory,
        )
        psutil.virtual_memory = sabotaged_memory
        journal.pack_frame = sabotaged_pack


def run_sabotaged(arguments: list[str], orders: Connection) -> None:
    """The whole process: `daq_app.acquisition`, with the saboteur installed first."""
    Saboteur(orders).install()
    run_and_exit(arguments)


def view_for_ever(address: str) -> None:
    """A viewer of its own process, to be killed."""
    from daq_app.acquisition import AcquisitionClient

    with AcquisitionClient(address) as client:
        while True:
            client.receive(9.0)
