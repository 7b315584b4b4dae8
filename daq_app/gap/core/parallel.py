"""Fits on all cores: interruptible, with progress, and the same answers as on one core."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any, TypeVar

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import Run
from daq_app.gap.core.fit import Fit, Score, fit, glance, on_top, promised, searches_from
from daq_app.gap.core.held_out import HeldOutRun, score
from daq_app.gap.core.model import Model
from daq_app.gap.core.problem import Columns
from daq_app.gap.core.search import Search
from daq_app.workers import worker_context, worker_surroundings

T = TypeVar("T")


class Interrupted(Exception):
    """The caller asked to stop; what was finished until then is lost on purpose."""


@dataclass(frozen=True, slots=True)
class FitTask:
    """Fit one hypothesis."""

    effects: tuple[Effect, ...]
    known: dict[tuple[str, int | None], float]
    sigmas: dict[str, float]
    polish: bool = True
    multistart: bool = True
    columns: Columns = field(default_factory=dict)
    """Columns of the Jacobian beyond those without any effect."""

    def run(self, model: Model, runs: Sequence[Run], frozen: Columns | None = None) -> Fit:
        known = {**(frozen or {}), **self.columns}
        return fit(model, runs, self.effects, self.known, self.sigmas, self.multistart, known, self.polish)


@dataclass(frozen=True, slots=True)
class GlanceTask:
    """See what one hypothesis is worth before it is fitted."""

    effects: tuple[Effect, ...]
    known: dict[tuple[str, int | None], float]
    sigmas: dict[str, float]
    columns: Columns = field(default_factory=dict)
    """Columns of the Jacobian beyond those without any effect."""
    hint: dict[tuple[str, int | None], float] | None = None
    """Unit coordinates to start from besides zero, in place of the effects' own starts."""

    def run(self, model: Model, runs: Sequence[Run], frozen: Columns | None = None) -> Fit:
        return glance(self.searches(model, runs, {**(frozen or {}), **self.columns}))

    def searches(self, model: Model, runs: Sequence[Run], columns: Columns) -> list[Search]:
        """From every start that is looked at."""
        return searches_from(model, runs, self.effects, self.known, self.sigmas, columns, self.hint)


@dataclass(frozen=True, slots=True)
class PromiseTask:
    """What some further effects promise, each by one linear step from the same fit."""

    glances: tuple[GlanceTask, ...]
    columns: Columns
    """All columns of that fit, sent once for all of them."""

    def run(self, model: Model, runs: Sequence[Run], frozen: Columns | None = None) -> list[float]:
        columns = {**(frozen or {}), **self.columns}
        return [promised(seen.searches(model, runs, columns)) for seen in self.glances]


@dataclass(frozen=True, slots=True)
class OnTopTask:
    """What a form gains on top of a fit, whose columns are known."""

    form: GlanceTask
    columns: Columns

    def run(self, model: Model, runs: Sequence[Run], frozen: Columns | None = None) -> Score:
        first, *_ = self.form.searches(model, runs, {**(frozen or {}), **self.columns})
        return on_top(first, self.form.effects[-1].name)


@dataclass(frozen=True, slots=True)
class ScoreTask:
    """Predict every run from the others under one hypothesis."""

    effects: tuple[Effect, ...]
    whole: Fit
    by: str

    def run(self, model: Model, runs: Sequence[Run], frozen: Columns | None = None) -> list[HeldOutRun]:
        return score(model, runs, self.effects, self.whole, self.by)


Task = FitTask | GlanceTask | PromiseTask | OnTopTask | ScoreTask
_STATE: dict[str, Any] = {}
"""In a worker process: the model and runs, sent once instead of with every task."""


def _prepare(model: Model, runs: Sequence[Run], frozen: Columns | None) -> None:
    _STATE["model"], _STATE["runs"], _STATE["frozen"] = model, runs, frozen


def _work(task: Task) -> Any:
    return task.run(_STATE["model"], _STATE["runs"], _STATE["frozen"])


class Workers:
    """A pool for one model and its runs; with ``count=1`` everything runs in this process.

    Use as a context manager. Worker processes are forked from one that is kept for it (`warm_up` has the
    model imported there), or spawned where there is none: both are safe beside a window.
    """

    def __init__(
        self,
        model: Model,
        runs: Sequence[Run],
        count: int = 1,
        progress: Callable[[int, int, str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        self._model, self._runs, self._count = model, tuple(runs), max(count, 1)
        self._progress = progress or (lambda done, total, text: None)
        self._cancelled = cancelled or (lambda: False)
        self._pool: ProcessPoolExecutor | None = None
        self.frozen: Columns | None = None
        """Columns of the Jacobian without any effect; set before the first tasks on several cores."""

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)

    def run(self, tasks: Iterable[Task], text: str) -> list[Any]:
        """Results in the order of the tasks. Raises `Interrupted` soon after `cancelled` says so."""
        listed = list(tasks)
        if self._count == 1 or len(listed) < 2:
            return self._in_process(listed, text)
        if self._pool is None:
            with worker_surroundings():
                self._pool = ProcessPoolExecutor(
                    self._count,
                    mp_context=worker_context(),
                    initializer=_prepare,
                    initargs=(self._model, self._runs, self.frozen),
                )
                futures = [self._pool.submit(_work, task) for task in listed]
        else:
            futures = [self._pool.submit(_work, task) for task in listed]
        self._await(futures, text)
        return [future.result() for future in futures]

    def _in_process(self, tasks: Sequence[Task], text: str) -> list[Any]:
        results = []
        for done, task in enumerate(tasks):
            self._check()
            self._progress(done, len(tasks), text)
            results.append(task.run(self._model, self._runs, self.frozen))
        self._progress(len(tasks), len(tasks), text)
        return results

    def _await(self, futures: Sequence[Future[Any]], text: str) -> None:
        pending = set(futures)
        while pending:
            self._progress(len(futures) - len(pending), len(futures), text)
            try:
                self._check()
            except Interrupted:
                for future in pending:
                    future.cancel()
                raise
            _, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
        self._progress(len(futures), len(futures), text)

    def _check(self) -> None:
        if self._cancelled():
            raise Interrupted("the diagnosis was stopped")
