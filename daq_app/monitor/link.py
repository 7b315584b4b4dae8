"""The window's connection to an acquisition process: two threads, so that the window never waits.

One thread receives and decodes what is published; the window takes it from a queue at its own pace.
The other sends commands one at a time and hands each reply back by a Qt signal.
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from PySide6.QtCore import QObject, Signal

from daq_app.acquisition.messages import Reply
from daq_app.monitor.session import Published

_POLL_S: Final = 0.1
_RETRY_S: Final = 0.5
QUEUE_MESSAGES: Final = 4000
"""Messages kept for a window that does not take them (about a minute); older ones are dropped."""


class Client(Protocol):
    """What the window needs of an acquisition client. Each method is called from one thread only."""

    def receive(self, timeout_s: float) -> tuple[BaseModel, NDArray[np.float32] | None] | None:
        """The next published message, or None after `timeout_s`."""
        ...

    def request(self, name: str, arguments: dict[str, float | str]) -> Reply:
        """Send a command and wait for its answer; raises `OSError` or `TimeoutError` when none comes."""
        ...

    def close(self) -> None:
        """Close the sockets; called once both threads have ended."""
        ...


class Link(QObject):
    """Receives into a queue and sends commands; `close` ends both threads."""

    replied = Signal(str, object)
    """(command name, `Reply`): also for a command that could not be sent, with ``ok=False``."""

    def __init__(self, client: Client, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._client = client
        self._inbox: deque[Published] = deque(maxlen=QUEUE_MESSAGES)
        self._commands: queue.Queue[tuple[str, dict[str, float | str]] | None] = queue.Queue()
        self._closing = threading.Event()
        self._threads = (
            threading.Thread(target=self._receive, name="monitor-receiver", daemon=True),
            threading.Thread(target=self._command, name="monitor-commands", daemon=True),
        )
        for thread in self._threads:
            thread.start()

    def take(self) -> list[Published]:
        """Everything received since the last call, in order."""
        taken = []
        while self._inbox:
            taken.append(self._inbox.popleft())
        return taken

    def request(self, name: str, arguments: dict[str, float | str] | None = None) -> None:
        """Send a command; `replied` tells how it went."""
        self._commands.put((name, arguments or {}))

    def close(self) -> None:
        """End both threads and close the client. Safe to call twice."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._commands.put(None)
        for thread in self._threads:
            thread.join(timeout=5.0)
        self._client.close()

    def _receive(self) -> None:
        while not self._closing.is_set():
            try:
                received = self._client.receive(_POLL_S)
            except (OSError, ValueError):
                self._closing.wait(_RETRY_S)  # a torn message or a lost socket: silence shows as stale
                continue
            if received is not None:
                self._inbox.append(Published(received[0], time.monotonic(), received[1]))

    def _command(self) -> None:
        while (task := self._commands.get()) is not None:
            name, arguments = task
            try:
                reply = self._client.request(name, arguments)
            except (OSError, ValueError) as error:
                reply = Reply(
                    ok=False,
                    text=f"The acquisition did not answer '{name}' ({error}). "
                    "Look whether its process runs; a run under way goes on without the window.",
                )
            if not self._closing.is_set():
                self.replied.emit(name, reply)
