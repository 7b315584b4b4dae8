"""The window's connection to an acquisition process: two threads, so that the window never waits.

One thread receives and decodes what is published; the window takes it from a queue at its own pace.
The other sends commands one at a time and hands each reply back by a Qt signal.
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, Final

import zmq
from PySide6.QtCore import QObject, Signal

from daq_app.acquisition.messages.published import EstimateMessage, Reply
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from daq_app.acquisition.viewers.curve import ViewerKeys
from daq_app.monitor.data.session import Published

_POLL_S: Final = 0.1
_RETRY_S: Final = 0.5
QUEUE_MESSAGES: Final = 4000
"""Messages kept for a window that does not take them (about a minute); older ones are dropped."""


class Link(QObject):
    """Receives into a queue and sends commands; `close` ends both threads."""

    replied = Signal(str, object)
    """(command name, `Reply`): also for a command that could not be sent, with ``ok=False``."""
    urgent = Signal()
    """Something has come that the operator waits for: r after an impact."""

    def __init__(
        self,
        address: str,
        token: str = "",
        keys: ViewerKeys | None = None,
        parent: QObject | None = None,
        timeout_s: float = 5.0,
    ) -> None:
        """Connect. Raises `AcquisitionUnreachable` if nobody answers within `timeout_s`."""
        super().__init__(parent)
        self.address = address
        self.may_command = bool(token)
        self._watcher = AcquisitionClient(address, keys=keys, timeout_s=timeout_s)
        try:
            self._commander = AcquisitionClient(address, token, keys=keys, topics=(), timeout_s=timeout_s)
        except AcquisitionUnreachable:
            self._watcher.close()
            raise
        self.about: Mapping[str, Any] = self._watcher.about
        self._inbox: deque[Published] = deque(maxlen=QUEUE_MESSAGES)
        self._commands: queue.Queue[tuple[str, dict[str, Any]] | None] = queue.Queue()
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

    def request(self, name: str, arguments: Mapping[str, float | str] | None = None) -> None:
        """Send a command; `replied` tells how it went."""
        self._commands.put((name, dict(arguments or {})))

    def close(self) -> None:
        """End both threads and hang up. Safe twice."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._commands.put(None)
        for thread in self._threads:
            thread.join(timeout=15.0)
        self._watcher.close()
        self._commander.close()

    def _receive(self) -> None:
        while not self._closing.is_set():
            try:
                received = self._watcher.receive(_POLL_S)
            except zmq.ZMQError:
                self._closing.wait(_RETRY_S)  # silence shows as stale
                continue
            if received is not None:
                self._inbox.append(Published(received.message, time.monotonic(), received.readings))
                if isinstance(received.message, EstimateMessage):
                    self.urgent.emit()

    def _command(self) -> None:
        while (task := self._commands.get()) is not None:
            name, arguments = task
            try:
                reply = self._commander.request(name, **arguments)
            except (AcquisitionUnreachable, zmq.ZMQError) as error:
                reply = Reply(ok=False, text=f"{error} A run under way goes on without the window.")
            if not self._closing.is_set():
                self.replied.emit(name, reply)
