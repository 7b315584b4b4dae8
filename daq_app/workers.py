"""Work on all cores: one process per core, progress, and a clean stop."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import get_all_start_methods, get_context
from multiprocessing.context import BaseContext
from typing import Final, TypeVar

from daq_app.machines import run_on_machines

Workers = int | str | None
"""Processes of this machine (None: one per core), or the address of a dask scheduler."""
_Job = TypeVar("_Job")
_Answer = TypeVar("_Answer")

_FORK_SERVER: Final = "forkserver" in get_all_start_methods()
_SURROUNDINGS: Final = {
    # A process per core with a thread per core each is slow.
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    # The GNU C library gives large arrays back to the system when they are freed, and each new one is
    # filled with zeros page by page: a tenth of an analysis. Kept, one serves the next. Elsewhere unknown.
    "MALLOC_MMAP_THRESHOLD_": str(2**28),
    "MALLOC_TRIM_THRESHOLD_": str(2**28),
}


def run_all(
    work: Callable[[_Job], _Answer],
    jobs: Sequence[_Job],
    workers: Workers = None,
    done: Callable[[int, _Job], None] | None = None,
) -> list[_Answer]:
    """`work(job)` of every job, in the order of the jobs; `work` and the jobs must be picklable.

    `done` is called with (number of jobs done, the job just done). The first exception of a job ends
    it all and is raised; so does Ctrl-C, as soon as the jobs at work have ended.
    With the address of a scheduler (daq_app.machines) its workers do the jobs, whose paths must be absolute.
    """
    if not jobs:
        return []
    if isinstance(workers, str):
        return run_on_machines(work, jobs, workers, done)
    answers: dict[int, _Answer] = {}
    with process_pool(min(workers or os.cpu_count() or 1, len(jobs))) as pool:
        places = {pool.submit(work, job): index for index, job in enumerate(jobs)}
        waiting = set(places)
        while waiting:
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in finished:
                index = places[future]
                answers[index] = future.result()
                if done:
                    done(len(answers), jobs[index])
    return [answers[index] for index in range(len(jobs))]


@contextmanager
def process_pool(workers: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool whose jobs have one thread each; whatever ends it, no job that waits is begun."""
    with worker_surroundings():
        surroundings = {name: os.environ[name] for name in _SURROUNDINGS}
    pool = ProcessPoolExecutor(
        workers, mp_context=worker_context(), initializer=_begin, initargs=(surroundings,)
    )
    try:
        with worker_surroundings():
            yield pool
    except BaseException:
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def warm_up(*modules: str) -> None:
    """Begin to import `modules` for the workers of later pools, and go on at once.

    Where the platform forks its workers from a process kept for it: elsewhere each imports for itself.
    """
    if _FORK_SERVER:
        from multiprocessing import forkserver

        forkserver.set_forkserver_preload(list(modules))
        with worker_surroundings():
            forkserver.ensure_running()


def worker_context() -> BaseContext:
    """Never forked from this process, which may hold threads (a window, a reader) that a fork would break."""
    return get_context("forkserver" if _FORK_SERVER else "spawn")


def _begin(surroundings: dict[str, str]) -> None:
    """Make this process a worker, before it imports what its jobs need.

    The fork server keeps the environment of its own start, which another part of the program may have caused.
    Ctrl-C reaches every process of the terminal: the parent decides, the workers do not die noisily.
    """
    os.environ.update(surroundings)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def worker_surroundings() -> Iterator[None]:
    """Workers inherit these when they start, where the user has not set them otherwise."""
    before = {name: os.environ.get(name) for name in _SURROUNDINGS}
    for name, value in before.items():
        os.environ[name] = value or _SURROUNDINGS[name]
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
