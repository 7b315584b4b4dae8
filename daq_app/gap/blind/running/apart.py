"""A process that diagnoses cases one after another and is given nothing but their files."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, Any, Final, Self

import psutil

from daq_app.gap.blind.layout import SEAL_FILE

_WORDS_KEPT: Final = 4000
_CASES_EACH: Final = 50
"""Cases after which a process is replaced: whatever it has piled up goes with it."""


class Apart:
    """Diagnoses in a process of its own, which is started when needed and again after a failure.

    Use as a context manager, from one thread.
    """

    def __init__(self, diagnoser: str) -> None:
        self._diagnoser = diagnoser
        self._process: psutil.Popen | None = None
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._home = tempfile.TemporaryDirectory(prefix="blind-")
        self._done = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()
        self._home.cleanup()

    def diagnose(self, case: Path, timeout_s: float) -> tuple[dict[str, Any] | None, str]:
        """(result, why there is none) of one case, which it sees in a fresh folder of a neutral name."""
        with tempfile.TemporaryDirectory(prefix="blind-") as place:
            bare, out = Path(place) / "case", Path(place) / "out.json"
            bare.mkdir()
            for path in case.iterdir():
                if path.is_file() and path.name != SEAL_FILE:
                    shutil.copyfile(path, bare / path.name)
            failure = self._ask(bare, out, timeout_s)
            return (None, failure) if failure else _read_result(out)

    def _ask(self, case: Path, out: Path, timeout_s: float) -> str:
        process = self._running()
        assert process.stdin is not None
        try:
            process.stdin.write(json.dumps({"case": str(case), "out": str(out)}) + "\n")
            process.stdin.flush()
            answer = self._answers.get(timeout=timeout_s)
        except queue.Empty:
            self._end()
            return f"stopped after {timeout_s:g} s"
        except OSError:
            answer = ""
        if not answer:
            return self._broken()
        self._done += 1
        failure: str = json.loads(answer)["failure"]
        return failure

    def _broken(self) -> str:
        """Why the process ended by itself."""
        assert self._process is not None
        code = self._process.wait()
        told = self._words.read_text(encoding="utf-8", errors="replace")[-_WORDS_KEPT:].strip()
        self._end()
        return f"ended with {code}: {told}"

    @property
    def _words(self) -> Path:
        return Path(self._home.name) / "words.txt"

    def _running(self) -> psutil.Popen:
        if self._process is not None and self._done >= _CASES_EACH:
            self._end()
        if self._process is None:
            with self._words.open("w", encoding="utf-8") as stderr:
                self._process = psutil.Popen(
                    [sys.executable, "-m", "daq_app.gap.blind.running.child", self._diagnoser],
                    cwd=self._home.name,
                    env=_environment(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=stderr,
                    text=True,
                    encoding="utf-8",
                )
            self._answers, self._done = queue.SimpleQueue(), 0
            threading.Thread(target=_listen, args=(self._process.stdout, self._answers), daemon=True).start()
        return self._process

    def _end(self) -> None:
        """End the process and all that it started."""
        process, self._process = self._process, None
        if process is None:
            return
        family = [process]
        with contextlib.suppress(psutil.NoSuchProcess):
            family = [*process.children(recursive=True), process]
        for member in family:
            with contextlib.suppress(psutil.NoSuchProcess):
                member.kill()
        psutil.wait_procs(family, timeout=10)
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()


def _listen(pipe: IO[str], answers: queue.SimpleQueue[str]) -> None:
    """Pass lines on until the pipe ends, then an empty one."""
    with contextlib.suppress(OSError, ValueError):
        for line in pipe:
            answers.put(line)
    answers.put("")


def _read_result(out: Path) -> tuple[dict[str, Any] | None, str]:
    try:
        result = json.loads(out.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        return None, f"no result: {error}"
    return (result, "") if isinstance(result, dict) else (None, "the result is no JSON object")


def _environment() -> dict[str, str]:
    """One thread for each process (the cases fill the cores), the import path of this one."""
    environment = dict(os.environ)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        environment[name] = "1"
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    return environment
