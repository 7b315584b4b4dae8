"""Work that takes longer than a frame, off the window's thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, QRunnable, QThreadPool, Signal
from shiboken6 import isValid


class _Signals(QObject):
    done = Signal(object)
    failed = Signal(object)


class _Job(QRunnable):
    def __init__(self, work: Callable[[], Any]) -> None:
        super().__init__()
        self.work = work
        self.signals = _Signals()

    def run(self) -> None:
        try:
            result = self.work()
        except Exception as error:
            # Handed to whoever asked, who says it in words; a thread must not die silently.
            self._emit(self.signals.failed, error)
        else:
            self._emit(self.signals.done, result)

    @staticmethod
    def _emit(signal: Any, value: object) -> None:
        try:
            signal.emit(value)
        except RuntimeError:  # the window was closed meanwhile
            return


class Background(QObject):
    """Runs jobs one after the other and answers on the window's thread."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pool = QThreadPool(self)
        self._pool.setMaxThreadCount(1)
        self._jobs: set[_Job] = set()

    def run(
        self, work: Callable[[], Any], done: Callable[[Any], None], failed: Callable[[Exception], None]
    ) -> None:
        """Do `work` in another thread, then call `done(result)` or `failed(error)` in this one.

        Neither is called where one of them is a method of a widget that was closed meanwhile.
        """
        asked = [getattr(callback, "__self__", None) for callback in (done, failed)]
        pages = [page for page in asked if isinstance(page, QObject)]
        job = _Job(work)
        job.setAutoDelete(False)
        self._jobs.add(job)

        def finish(callback: Callable[[Any], None]) -> Callable[[Any], None]:
            def call(value: Any) -> None:
                self._jobs.discard(job)
                if all(isValid(page) for page in pages):
                    callback(value)

            return call

        job.signals.done.connect(finish(done))
        job.signals.failed.connect(finish(failed))
        self._pool.start(job)

    @property
    def busy(self) -> bool:
        """Whether a job is under way or waits."""
        return bool(self._jobs)

    def finish(self, timeout_ms: int = 10_000) -> None:
        """Wait for what is under way."""
        self._pool.waitForDone(timeout_ms)
