"""Starts an acquisition process and finds out where it listens."""

from __future__ import annotations

import os
import secrets
import subprocess
import threading
from collections import deque
from collections.abc import Mapping, Sequence

from daq_app.acquisition.messages.options import READY
from daq_app.acquisition.viewers.client import AcquisitionClient
from daq_app.guarded import apart, program
from daq_app.streams import CHILD_ENVIRONMENT

_START_LIMIT_S = 240.0
"""Loading everything and starting the simulated server, on a machine that is busy."""


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

    def __init__(self, options: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
        """Start it and wait until it listens. Raises `AcquisitionDied`."""
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
        self._ready.wait(_START_LIMIT_S)
        if not self.address:
            if self.process.poll() is None:
                self.process.kill()
            raise AcquisitionDied(self.wait(), self.said)

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
        self._ready.set()

    def _listen_err(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._said.append(line.rstrip())
