"""Waiting for a child process: as long as it works, however slow the machine is."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

import psutil

LOOK_EVERY_S: Final = 0.5
IDLE_LIMIT_S: Final = 240.0
"""Time without any work after which a child counts as hung, s. Assumed: longer than a busy disk keeps one
waiting. A machine that is merely slow gives every process some processor time within it."""
_SAY_EVERY_S: Final = 10.0
_LEAST_WORK_S: Final = 0.005


class WorkWatch:
    """Whether a process, or one that it started, still does something: uses processor time."""

    def __init__(self, pid: int, idle_limit_s: float = IDLE_LIMIT_S) -> None:
        self._pid = pid
        self._idle_limit_s = idle_limit_s
        self._last_s = 0.0
        self._since_s = time.monotonic()
        self._begun_s = self._used_s()

    @property
    def worked_s(self) -> float:
        """Processor time that it has used since the watch began."""
        return self._used_s() - self._begun_s

    def works(self) -> bool:
        """False once it has used no processor time for `idle_limit_s`."""
        used_s, now_s = self._used_s(), time.monotonic()
        if abs(used_s - self._last_s) > _LEAST_WORK_S:
            self._last_s, self._since_s = used_s, now_s
        return now_s - self._since_s <= self._idle_limit_s

    def _used_s(self) -> float:
        try:
            process = psutil.Process(self._pid)
            family = [process, *process.children(recursive=True)]
        except psutil.Error:
            return self._last_s
        used_s = 0.0
        for one in family:
            try:
                times = one.cpu_times()
            except psutil.Error:
                continue
            used_s += times.user + times.system
        return used_s


def wait_for_start(ready: threading.Event, pid: int, say: Callable[[str], None]) -> None:
    """Until `ready`, or until the process has hung; `say` gets a line every ten seconds.

    Waits in slices, so that Ctrl-C is heard on Windows too.
    """
    watch = WorkWatch(pid)
    begun_s = said_s = time.monotonic()
    while not ready.wait(LOOK_EVERY_S) and watch.works():
        now_s = time.monotonic()
        if now_s - said_s >= _SAY_EVERY_S:
            said_s = now_s
            say(f"Still starting after {now_s - begun_s:.0f} s ({watch.worked_s:.0f} s of processor time)")
