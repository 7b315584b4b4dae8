"""Fits on all cores: interruptible, with progress, and the same answers as on one core."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from typing import Any

from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.problem import Columns
from daq_app.gap.core.fitting.tasks import Task
from daq_app.workers import worker_context, worker_surroundings


class Interrupted(Exception):
    """The caller asked to stop; what was finished until then is lost on purpose."""


_STATE: dict[str, Any] = {}
"""In a worker process: the experiment, sent once instead of with every task."""


def _prepare(experiment: Experiment) -> None:
    _STATE["experiment"] = experiment
    # The collector looks through nothing that is there now, which stays: that would take 5 % of the fits.
    gc.freeze()


def _ready() -> None:
    """Do nothing: the pool starts a process to run this in."""


def _work(task: Task, frozen: Columns) -> Any:
    return task.run(_STATE["experiment"], frozen)


class Workers:
    """A pool for one experiment; with ``count=1`` everything runs in this process.

    Use as a context manager. Worker processes are forked from one that is kept for it (`warm_up` has the
    model imported there), or spawned where there is none: both are safe beside a window.
    """

    def __init__(
        self,
        experiment: Experiment,
        count: int = 1,
        progress: Callable[[int, int, str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        self._experiment, self._count = experiment, max(count, 1)
        self._progress = progress or (lambda done, total, text: None)
        self._cancelled = cancelled or (lambda: False)
        self._pool: ProcessPoolExecutor | None = None
        self.frozen: Columns = {}
        """Columns of the Jacobian without any effect, once they are known."""

    def __enter__(self) -> Workers:
        if self._count > 1:
            with worker_surroundings():
                self._pool = ProcessPoolExecutor(
                    self._count,
                    mp_context=worker_context(),
                    initializer=_prepare,
                    initargs=(self._experiment,),
                )
                # The processes start while this one fits the runs without any effect.
                for _ in range(self._count):
                    self._pool.submit(_ready)
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)

    def run(self, tasks: Iterable[Task], text: str) -> list[Any]:
        """Results in the order of the tasks. Raises `Interrupted` soon after `cancelled` says so."""
        listed = list(tasks)
        if self._pool is None or len(listed) < 2:
            return self._in_process(listed, text)
        futures = [self._pool.submit(_work, task, self.frozen) for task in listed]
        self._await(futures, text)
        return [future.result() for future in futures]

    def _in_process(self, tasks: Sequence[Task], text: str) -> list[Any]:
        results = []
        for done, task in enumerate(tasks):
            self._check()
            self._progress(done, len(tasks), text)
            results.append(task.run(self._experiment, self.frozen))
        self._progress(len(tasks), len(tasks), text)
        return results

    def _await(self, futures: Sequence[Future[Any]], text: str) -> None:
        pending = set(futures)
        while pending:
            self._progress(len(futures) - len(pending), len(futures), text)
            self._check()
            _, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
        self._progress(len(futures), len(futures), text)

    def _check(self) -> None:
        if self._cancelled():
            raise Interrupted("the diagnosis was stopped")
