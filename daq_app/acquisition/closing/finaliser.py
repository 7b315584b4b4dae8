"""Turns closed journals into run files, in a process of its own, so that reading never waits.

Packing a minute of 41 channels takes a processor for seconds; done in our process it would hold the
interpreter's lock against the reader. The worker is started before it is needed, and kept.
"""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import IO, Final

from daq_app.guarded import end_guarded, start_guarded
from daq_app.short_memory import until_memory
from daq_app.waiting import WorkWatch

_WORKER: Final = "daq_app.acquisition.closing.finalise_worker"
_LEAST_LIMIT_S: Final = 120.0
"""Processor time within which a small job must be done, and time without any work after which its worker
counts as hung, s. A slow machine stretches neither."""
_SLOWEST_BYTES_PER_S: Final = 1e6
_LOOK_EVERY_S: Final = 0.1
_ATTEMPTS: Final = 3
_AGAIN_AFTER_S: Final = 1.0
"""Pause before the next attempt, s: the system may refuse memory or file handles for a while."""
_CLOSING_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class Finished:
    """What became of a job."""

    ok: bool
    text: str
    """For the operator."""
    path: str = ""


class _Word(Enum):
    """What a finaliser is told between jobs."""

    WARM = "warm"
    END = "end"


class Finaliser(threading.Thread):
    """Sends jobs to workers, one after the other; starts a new worker if one dies or does not end.

    Runs of this session and journals of earlier ones have a worker each: whatever an old file does to
    its worker, a new run is saved.
    """

    def __init__(self) -> None:
        super().__init__(name="finaliser", daemon=True)
        self._jobs: queue.SimpleQueue[tuple[dict[str, str], Future[Finished]] | _Word] = queue.SimpleQueue()
        self._worker = _Worker()
        self._recovery = _Recovery()

    def warm(self) -> None:
        """Start the worker of this session's runs, which loads for a second, and return at once."""
        self._jobs.put(_Word.WARM)

    def submit(self, job: dict[str, str], then: Callable[[Finished], None] | None = None) -> Future[Finished]:
        """Do ``{"job": "finalise", "journal": …, "out": …}`` or ``{"job": "recover", "journal": …}``.

        `then` is called on the finaliser's thread. The answer says of failures what to do; it never raises.
        """
        done: Future[Finished] = Future()
        if then is not None:
            done.add_done_callback(lambda future: until_memory(partial(then, future.result())))
        if job["job"] == "recover":
            self._recovery.submit(job, done)
        else:
            self._jobs.put((job, done))
        return done

    def run(self) -> None:
        """Until `close`."""
        while (entry := self._jobs.get()) is not _Word.END:
            if entry is _Word.WARM:
                with contextlib.suppress(OSError, MemoryError):  # the first job tries again
                    self._worker.start()
                continue
            job, done = entry
            done.set_result(until_memory(partial(self._worker.do, job)))
        until_memory(self._worker.end)

    def close(self) -> None:
        """Finish what must be saved (recovery can wait for the next start), then end the workers."""
        self._recovery.close()
        self._jobs.put(_Word.END)
        if self.is_alive():
            self.join()


class _Recovery:
    """Journals of earlier sessions, on a thread of their own; its worker lasts while there are any."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[tuple[dict[str, str], Future[Finished]] | None] = queue.SimpleQueue()
        self._worker = _Worker()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="recovery", daemon=True)
        self._thread.start()

    def submit(self, job: dict[str, str], done: Future[Finished]) -> None:
        self._jobs.put((job, done))

    def _run(self) -> None:
        while (entry := self._jobs.get()) is not None:
            job, done = entry
            # What is not recovered before the session ends waits for the next start.
            do = partial(Finished, True, "") if self._closing else partial(self._worker.do, job)
            done.set_result(until_memory(do))
            if self._jobs.empty():
                until_memory(self._worker.end)

    def close(self) -> None:
        """Let the job that is being done end, but not for long: its journal is untouched all the same."""
        self._closing = True
        self._jobs.put(None)
        self._thread.join(_CLOSING_S)
        self._worker.stop()
        self._thread.join()


class _Reader(threading.Thread):
    """Reads the answers of whichever worker there is.

    Made while there is memory: a thread that begins without any never says that it has begun, and who
    starts it waits for ever.
    """

    def __init__(self) -> None:
        super().__init__(name="answers", daemon=True)
        self._pipes: queue.SimpleQueue[IO[str] | None] = queue.SimpleQueue()
        self._lines: queue.SimpleQueue[tuple[IO[str], str]] = queue.SimpleQueue()
        self.start()

    def run(self) -> None:
        while (pipe := self._pipes.get()) is not None:
            line = ""
            with contextlib.suppress(OSError, ValueError, MemoryError):  # the worker is gone, or was ended
                line = pipe.readline()
            self._lines.put((pipe, line))

    def ask(self, pipe: IO[str]) -> None:
        """Read one line."""
        self._pipes.put(pipe)

    def line(self, pipe: IO[str], timeout_s: float) -> str:
        """The line of `pipe`, empty if it has ended; raises `queue.Empty` where there is none yet."""
        while (line_of_pipe := self._lines.get(timeout=timeout_s))[0] is not pipe:
            pass  # of a worker that was given up
        return line_of_pipe[1]


class _Worker:
    """A process that makes run files, and its successor if it dies or does not end."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._reader = _Reader()
        self._stopped = threading.Event()

    def start(self) -> None:
        """Start the process unless it runs."""
        if self._process is None or self._process.poll() is not None:
            self.end()
            self._process = start_guarded(_WORKER, [], reads_input=True)

    def do(self, job: dict[str, str]) -> Finished:
        """The answer to a job; in words, and with the journal untouched, if there is none."""
        why = "ended too early"
        for attempt in range(_ATTEMPTS):  # a worker that died (memory short, killed) gets a successor
            if attempt:
                self._stopped.wait(_AGAIN_AFTER_S)
            try:
                answer = self._done(job)
            except TimeoutError:  # another would hang as well
                self._kill()
                why = "did not end"
                break
            except (OSError, MemoryError) as error:
                why, answer = f"could not be started ({error or 'no memory'})", None
            if answer is not None:
                return answer
            self._kill()
            if self._stopped.is_set():
                return Finished(True, "")
        return Finished(
            False,
            f"The process that makes run files {why}. {job['journal']} is untouched: close other programs, "
            "then run `daq-app recover` on its folder",
        )

    def _done(self, job: dict[str, str]) -> Finished | None:
        """One job and its answer; None if the worker died over it or is to be stopped.

        Raises `TimeoutError` if it uses more processor time than such a job can take, or none for that long,
        and `OSError` or `MemoryError` if no worker can be started.
        """
        self.start()
        worker = self._process
        assert worker is not None and worker.stdin is not None and worker.stdout is not None
        self._reader.ask(worker.stdout)
        limit_s = _time_limit_s(job)
        try:
            worker.stdin.write(json.dumps(job) + "\n")
            worker.stdin.flush()
            watch = WorkWatch(worker.pid, limit_s)
            while not self._stopped.is_set():
                if watch.worked_s > limit_s or not watch.works():
                    raise TimeoutError
                with contextlib.suppress(queue.Empty):
                    line = self._reader.line(worker.stdout, _LOOK_EVERY_S)
                    return Finished(**json.loads(line)) if line else None
        except TimeoutError:
            raise
        except (OSError, ValueError, TypeError):
            pass
        return None

    def stop(self) -> None:
        """Give up the job that is being done, from another thread."""
        self._stopped.set()

    def _kill(self) -> None:
        if self._process is not None:
            end_guarded(self._process, grace_s=0.0)
            self._process = None

    def end(self) -> None:
        """End the process; safe twice."""
        if self._process is not None:
            end_guarded(self._process)
            self._process = None


def _time_limit_s(job: dict[str, str]) -> float:
    """Far more processor time than a job can take: packing handles some 20 MB of journal a second."""
    try:
        n_bytes = Path(job["journal"]).stat().st_size
    except OSError:
        n_bytes = 0
    return _LEAST_LIMIT_S + n_bytes / _SLOWEST_BYTES_PER_S
