"""Starts an acquisition process and finds out where it listens."""

from __future__ import annotations

import os
import secrets
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from daq_app.acquisition.messages.options import READY
from daq_app.acquisition.viewers.client import AcquisitionClient
from daq_app.guarded import apart, program
from daq_app.streams import CHILD_ENVIRONMENT
from daq_app.waiting import wait_for_start

_HUNG: Final = "The acquisition process hung while it started: it did nothing for minutes. Start it again."


def _say_nothing(text: str) -> None:
    del text


class AcquisitionDied(Exception):
    """The process ended before it listened; `exit_code` and what it said tell why."""

    def __init__(self, exit_code: int, said: str) -> None:
        self.exit_code = exit_code
        self.said = said
        super().__init__(said or f"The acquisition process ended with exit code {exit_code}")


class AcquisitionProcess:
    """A child that outlives us: if this process ends, the recording goes on until its run is saved.

    The child does not get the terminal's Ctrl-C; `stop` of its client ends a test in good order.
    """

    def __init__(
        self,
        options: Sequence[str],
        environment: Mapping[str, str] | None = None,
        say: Callable[[str], None] = _say_nothing,
    ) -> None:
        """Start it and wait until it listens, as long as it works. Raises `AcquisitionDied`.

        `say` gets what goes on while it starts, in words, from other threads too.
        """
        self._say = say
        self.token = secrets.token_urlsafe(24)
        self.process = subprocess.Popen(
            [program(), "-u", "-m", "daq_app.acquisition", *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            env={**os.environ, **CHILD_ENVIRONMENT, **(environment or {}), "DAQ_APP_TOKEN": self.token},
            **apart(),
        )
        self.address = ""
        self._said: deque[str] = deque(maxlen=50)
        self._ready = threading.Event()
        self._listeners = [
            threading.Thread(target=self._listen_out, daemon=True),
            threading.Thread(target=self._listen_err, daemon=True),
        ]
        for listener in self._listeners:
            listener.start()
        try:
            wait_for_start(self._ready, self.process.pid, say)
        except BaseException:  # Ctrl-C: nothing is recorded yet
            self.kill()
            raise
        if not self.address:
            hung = self.process.poll() is None
            if hung:
                self.process.kill()
            code, said = self.wait(), self.said
            raise AcquisitionDied(code, f"{_HUNG} {said}".strip() if hung else said)

    @property
    def said(self) -> str:
        """The last lines on its standard error."""
        return "\n".join(self._said)

    def client(
        self, topics: tuple[str, ...] = ("state", "motion", "estimate", "health", "event")
    ) -> AcquisitionClient:
        """A viewer with the right to command."""
        return AcquisitionClient(self.address, self.token, topics=topics, timeout_s=30.0)

    def wait(self, timeout_s: float | None = None) -> int:
        """Its exit code. Raises `subprocess.TimeoutExpired`."""
        code = self.process.wait(timeout_s)
        for listener in self._listeners:
            listener.join(5.0)
        return code

    def kill(self) -> None:
        """End it at once, as a crash would."""
        self.process.kill()
        self.process.wait()

    def _listen_out(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith(READY):
                self.address = line.removeprefix(READY).strip()
                self._ready.set()
            else:
                self._say(line.strip())
        self._ready.set()

    def _listen_err(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._said.append(line.rstrip())
