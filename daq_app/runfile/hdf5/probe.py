"""Lets a child process open a file of unknown soundness first, with limits of time and memory."""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import threading
import time
from functools import lru_cache
from pathlib import Path
from typing import Final

import psutil

from daq_app.guarded import end_guarded, start_guarded
from daq_app.runfile.errors import RunFileError

_WORKER: Final = "daq_app.hdf5_walk"
CPU_LIMIT_S: Final = 3.0
"""Processor time for one file. A sound run takes 0.1 s; a loop in the HDF5 library never ends."""
_WALL_LIMIT_S: Final = 60.0
"""For a disk that does not answer, or a machine that is far too busy."""
MEMORY_LIMIT_BYTES: Final = 280 * 2**20
_LOOK_EVERY_S: Final = 0.02
_ADVICE: Final = "It was left alone. If its journal is still there, `daq-app recover` makes the run anew."


def require_harmless(path: Path) -> None:
    """Return if reading `path` by the HDF5 library ends, in bounded memory. Raises `RunFileError` if not."""
    _prober().prove(path)


@lru_cache(maxsize=1)
def _prober() -> Prober:
    """One child for all files: it takes half a second to start."""
    return Prober(CPU_LIMIT_S)


class Prober:
    """A child that opens one file after the other; killed and started anew where a file stops it."""

    def __init__(self, cpu_limit_s: float = CPU_LIMIT_S, memory_limit: int = MEMORY_LIMIT_BYTES) -> None:
        self._cpu_limit_s = cpu_limit_s
        self._memory_limit = memory_limit
        self._child: subprocess.Popen[str] | None = None
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._turn = threading.Lock()
        self._given_up: dict[tuple[str, int, int], str] = {}
        """What was wrong with a file of this name, size and time of change: it is not waited for twice."""

    def prove(self, path: Path) -> None:
        """See `require_harmless`."""
        state = path.stat()
        file = (str(path.absolute()), state.st_size, state.st_mtime_ns)
        with self._turn:
            trouble = self._given_up.get(file) or self._ask(path)
            if trouble:
                self._given_up[file] = trouble
        if trouble:
            raise RunFileError(f"{path} is damaged: {trouble}", advice=_ADVICE)

    def close(self) -> None:
        """End the child; the next file starts another."""
        if self._child is not None:
            end_guarded(self._child, grace_s=0.0)
            self._child = None

    def _ask(self, path: Path) -> str:
        child = self._running()
        assert child.stdin is not None
        try:
            child.stdin.write(json.dumps(str(path.absolute())) + "\n")
            child.stdin.flush()
        except OSError:
            self.close()
            return "the process that opens it cannot be reached"
        trouble, answered = self._await(child)
        if not answered:
            self.close()
        return trouble

    def _running(self) -> subprocess.Popen[str]:
        if self._child is None or self._child.poll() is not None:
            self.close()
            self._child = start_guarded(_WORKER, [str(self._memory_limit)], reads_input=True, quiet=True)
            self._answers = queue.SimpleQueue()
            threading.Thread(target=_listen, args=(self._child, self._answers), daemon=True).start()
        return self._child

    def _await(self, child: subprocess.Popen[str]) -> tuple[str, bool]:
        """(what is wrong with the file, whether the child can go on)."""
        watched = psutil.Process(child.pid)
        begun_s = time.monotonic()
        cpu_s: float | None = None
        while True:
            with contextlib.suppress(queue.Empty):
                line = self._answers.get(timeout=_LOOK_EVERY_S)
                if not line:
                    return "reading it crashes the HDF5 library", False
                return str(json.loads(line)), True
            with contextlib.suppress(psutil.Error):
                times = watched.cpu_times()
                used_s = times.user + times.system
                cpu_s = used_s if cpu_s is None else cpu_s
                if used_s - cpu_s > self._cpu_limit_s:
                    return (
                        f"reading it does not end (stopped after {self._cpu_limit_s:g} s of processor)",
                        False,
                    )
                if watched.memory_info().rss > self._memory_limit:
                    return f"reading it takes more than {self._memory_limit / 2**20:.0f} MB of memory", False
            if time.monotonic() - begun_s > _WALL_LIMIT_S:
                return f"reading it does not end (stopped after {_WALL_LIMIT_S:g} s)", False


def _listen(child: subprocess.Popen[str], answers: queue.SimpleQueue[str]) -> None:
    assert child.stdout is not None
    with contextlib.suppress(OSError, ValueError):
        for line in child.stdout:
            answers.put(line)
    answers.put("")
