"""The recorder of a soak: an acquisition process that can be sabotaged, and what it says of itself."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import psutil

from daq_app.acquisition import AcquisitionClient, read_session_file
from daq_app.acquisition.messages.published import HealthMessage, Message, StateMessage
from tests.support.recorder.processes import quick_context
from tests.support.recorder.saboteur import run_sabotaged

LIMIT_S: Final = 1200.0
"""Longest wait for anything: far more than a loaded machine needs to make a run of ten minutes."""


class SoakRecorder:
    """One sabotaged acquisition process with an ear on it."""

    def __init__(self, rig: Path, folder: Path, connection: str, speed: float) -> None:
        heard, self._orders = quick_context().Pipe(duplex=False)
        arguments = [
            *("--rig", str(rig), "--out", str(folder), "--spare", str(folder.with_name("spare"))),
            *("--connection", connection, "--speed", str(speed), "--no-results", "--release-within", "36000"),
        ]
        self.process = quick_context().Process(target=run_sabotaged, args=(arguments, heard))
        self.process.start()
        heard.close()
        deadline = time.monotonic() + LIMIT_S
        session = None
        while session is None or session.pid != self.process.pid:
            if self.process.exitcode is not None or time.monotonic() > deadline:
                raise RuntimeError(f"the recorder did not start: {self.process.exitcode}")
            self.process.join(0.05)
            session = read_session_file(folder)
        self.client = AcquisitionClient(session.address, session.token, topics=(), timeout_s=LIMIT_S)
        self.sample = self.safe = 0
        self.state: StateMessage | None = None
        self.sizes: list[tuple[float, int]] = []
        """(memory in MB, handles) between tests."""
        self._over = threading.Event()
        self._ear = threading.Thread(target=self._listen, args=(session.address,), daemon=True)
        self._ear.start()

    def _listen(self, address: str) -> None:
        with AcquisitionClient(address, topics=("state", "health"), timeout_s=LIMIT_S) as client:
            while not self._over.is_set():
                received = client.receive(0.2)
                if received is not None:
                    self._take(received.message)

    def _take(self, message: Message) -> None:
        if isinstance(message, StateMessage):
            self.state = message
        elif isinstance(message, HealthMessage):
            self.sample = message.sample
            if message.recording:
                self.safe = message.acknowledged_sample

    def sabotage(self, **what: object) -> None:
        self._orders.send(what)

    def wait(self, right: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + LIMIT_S
        while not right():
            if self.process.exitcode is not None:
                raise RuntimeError(f"{what}: the recorder ended ({self.process.exitcode}); last {self.state}")
            if time.monotonic() > deadline:
                raise RuntimeError(f"{what}: not within {LIMIT_S:g} s; last {self.state}")
            time.sleep(0.05)

    def arm(self, test: str) -> None:
        deadline = time.monotonic() + LIMIT_S
        self.client.request("preview", timeout_s=LIMIT_S)
        while not (reply := self.client.request("arm", timeout_s=LIMIT_S, test=test)).ok:
            if time.monotonic() > deadline:
                raise RuntimeError(reply.text)
            time.sleep(0.5)
            self.client.request("preview", timeout_s=LIMIT_S)
        self.safe = 0

    def measure(self) -> None:
        process = psutil.Process(self.process.pid)
        handles = process.num_handles() if sys.platform == "win32" else process.num_fds()
        self.sizes.append((process.memory_info().rss / 2**20, handles))

    def close(self, *, kill: bool) -> None:
        if kill:
            self.process.kill()
        elif self.process.exitcode is None:
            self.client.request("shutdown", timeout_s=LIMIT_S, force=1.0)
        self.process.join(LIMIT_S)
        self._over.set()
        self._ear.join()
        self.client.close()
