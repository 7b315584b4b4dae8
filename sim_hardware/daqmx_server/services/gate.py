"""Faults of the server itself: it stops answering, or is gone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import psutil

from sim_hardware.daqmx_server.bench.bench import Bench

_POLL_S = 0.01


def kill_this_process() -> None:
    """End at once, with nothing tidied up: what a power cut does."""
    psutil.Process().kill()


class Gate:
    """Every call passes here twice, before its work and before its reply.

    A freeze lasts real seconds, also where the bench's clock moves with the reads. The watching
    thread is what kills a server whose clients are silent.
    """

    def __init__(self, bench: Bench, kill: Callable[[], None] = kill_this_process) -> None:
        self._bench = bench
        self._kill = kill
        self._frozen_since: dict[int, float] = {}
        self._ended = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="server faults", daemon=True)

    def start(self) -> None:
        self._watcher.start()

    def stop(self) -> None:
        self._ended.set()

    def pass_through(self) -> None:
        """Return at once, or when the server has thawed."""
        while self._is_frozen() and not self._ended.is_set():
            time.sleep(_POLL_S)

    def _is_frozen(self) -> bool:
        with self._bench.changed:
            entry = self._bench.faults.active("server_frozen")
            if entry is None:
                return False
            since = self._frozen_since.setdefault(entry.number, time.monotonic())
            if time.monotonic() - since < entry.fault.for_s:
                return True
            self._bench.clear_faults(entry.number)
            return False

    def _watch(self) -> None:
        while not self._ended.wait(_POLL_S):
            with self._bench.changed:
                killed = self._bench.faults.active("server_killed")
            if killed is not None:
                self._kill()
                return
