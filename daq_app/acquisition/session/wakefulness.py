"""Keeps the machine from falling asleep while a test is armed, where the platform allows it."""

from __future__ import annotations

import threading
from contextlib import ExitStack

from wakepy import keep


class Wakefulness:
    """`hold` while recording, `allow_sleep` afterwards; both may be repeated and never raise.

    The platform is asked on a thread of its own: a desktop that does not answer must delay nothing.
    """

    def __init__(self) -> None:
        self._wanted = threading.Event()
        self._change = threading.Event()
        self._ended = False
        self.active = False
        """Whether the platform has agreed to stay awake."""
        self._thread = threading.Thread(target=self._work, name="wakefulness", daemon=True)
        self._thread.start()

    def hold(self) -> None:
        """Stay awake from now on."""
        if not self._wanted.is_set():
            self._wanted.set()
            self._change.set()

    def allow_sleep(self) -> None:
        """The machine may sleep again."""
        if self._wanted.is_set():
            self._wanted.clear()
            self._change.set()

    def close(self) -> None:
        """End; the machine may sleep again."""
        self._ended = True
        self.allow_sleep()
        self._change.set()

    def _work(self) -> None:
        with ExitStack() as held:
            while not self._ended:
                self._change.wait()
                self._change.clear()
                if self._wanted.is_set() and not self.active:
                    # A server room or a container has nobody to ask: recording goes on all the same.
                    mode = held.enter_context(keep.running(on_fail="pass"))
                    self.active = bool(mode.active)
                elif not self._wanted.is_set():
                    held.close()
                    self.active = False
