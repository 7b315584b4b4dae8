"""Turns closed journals into run files, in a process of its own, so that reading never waits.

Packing a minute of 41 channels takes a processor for seconds; done in our process it would hold the
interpreter's lock against the reader. The worker is started early and kept, so that it is warm.
"""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from daq_app.guarded import end_guarded, start_guarded

_WORKER = "daq_app.acquisition.closing.finalise_worker"


@dataclass(frozen=True, slots=True)
class Finished:
    """What became of a job."""

    ok: bool
    text: str
    """For the operator."""
    path: str = ""


class Finaliser(threading.Thread):
    """Sends jobs to the worker, one after the other; starts a new worker if one dies."""

    def __init__(self) -> None:
        super().__init__(name="finaliser", daemon=True)
        self._jobs: queue.SimpleQueue[tuple[dict[str, str], Future[Finished]] | None] = queue.SimpleQueue()
        self._worker: subprocess.Popen[str] | None = None
        self._closing = False

    def submit(self, job: dict[str, str], then: Callable[[Finished], None] | None = None) -> Future[Finished]:
        """Do ``{"job": "finalise", "journal": …, "out": …}`` or ``{"job": "recover", "journal": …}``.

        `then` is called on the finaliser's thread. The answer says of failures what to do; it never raises.
        """
        done: Future[Finished] = Future()
        if then is not None:
            done.add_done_callback(lambda future: then(future.result()))
        self._jobs.put((job, done))
        return done

    def run(self) -> None:
        """Until `close`."""
        self._worker = _start()
        while True:
            entry = self._jobs.get()
            if entry is None:
                break
            job, done = entry
            if self._closing and job["job"] in ("recover", "ring"):
                done.set_result(Finished(True, ""))  # the next start does it
            else:
                done.set_result(self._do(job))
        if self._worker is not None:
            end_guarded(self._worker)

    def close(self) -> None:
        """Finish what must be saved (recovery can wait for the next start), then end the worker."""
        self._closing = True
        self._jobs.put(None)
        if self.is_alive():
            self.join()

    def _do(self, job: dict[str, str]) -> Finished:
        for _ in range(2):  # a worker that died (memory short, killed) gets one successor
            if self._worker is None or self._worker.poll() is not None:
                self._worker = _start()
            answer = _exchange(self._worker, job)
            if answer is not None:
                return answer
        return Finished(
            False,
            f"The process that makes run files ended twice. {job['journal']} is untouched: run "
            "`daq-app recover` on its folder",
        )


def _start() -> subprocess.Popen[str]:
    return start_guarded(_WORKER, [], reads_input=True)


def _exchange(worker: subprocess.Popen[str], job: dict[str, str]) -> Finished | None:
    """One job and its answer; None if the worker died over it."""
    assert worker.stdin is not None and worker.stdout is not None
    try:
        worker.stdin.write(json.dumps(job) + "\n")
        worker.stdin.flush()
        line = worker.stdout.readline()
        return Finished(**json.loads(line)) if line else None
    except (OSError, ValueError, TypeError):
        return None
