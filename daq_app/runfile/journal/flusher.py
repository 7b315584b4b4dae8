"""Threads that flush journals, made before they are needed."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future


class Flusher(threading.Thread):
    """A thread that does one flush after the other, for one journal after the other.

    It begins when it is made. A thread that begins where there is no memory never says that it has begun,
    and whoever starts it waits for ever: no recording may hang on that.
    """

    def __init__(self) -> None:
        super().__init__(name="journal-sync", daemon=True)
        self._jobs: queue.SimpleQueue[tuple[Callable[[], int], Future[int]] | None] = queue.SimpleQueue()
        self._waiting = 0
        self._lock = threading.Lock()
        self.start()

    @property
    def idle(self) -> bool:
        """Whether nothing is being flushed: a disk may hang for ever, and with it who flushes to it."""
        with self._lock:
            return self._waiting == 0

    def run(self) -> None:
        """Until `end`."""
        while (entry := self._jobs.get()) is not None:
            work, done = entry
            try:
                result = work()
            except BaseException as error:
                self._one_less()
                done.set_exception(error)
            else:
                self._one_less()
                done.set_result(result)

    def submit(self, work: Callable[[], int]) -> Future[int]:
        """Do it when its turn comes."""
        done: Future[int] = Future()
        with self._lock:
            self._waiting += 1
        self._jobs.put((work, done))
        return done

    def end(self) -> None:
        """End the thread after what is asked for; safe twice."""
        self._jobs.put(None)

    def _one_less(self) -> None:
        with self._lock:
            self._waiting -= 1


def idle_flusher(known: Flusher) -> Flusher:
    """The one that is known, or a new one where that hangs."""
    if known.idle:
        return known
    known.end()
    return Flusher()
