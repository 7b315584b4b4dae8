"""A desk that serves in a thread, for tests of what comes and goes over its sockets."""

from __future__ import annotations

import threading
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from daq_app.acquisition.messages.published import Command, HealthMessage, Reply, State, StateMessage
from daq_app.acquisition.viewers.client import AcquisitionClient
from daq_app.acquisition.viewers.desk import Desk

TOKEN = "the right token"
CALM = HealthMessage(
    sample=1,
    acknowledged_sample=1,
    recording=True,
    backlog_samples=0,
    buffer_samples=1,
    gaps=0,
    lost_samples=0,
)
"""What a recorder says of itself that records and has lost nothing."""


class Counter:
    """A desk that serves in a thread and remembers what it was asked."""

    def __init__(self, bind: str = "tcp://127.0.0.1:0", keys: Path | None = None) -> None:
        self.asked: list[Command] = []
        self.ticks = 0
        self.desk = Desk(bind, self._handle, TOKEN, keys)
        self._serving = threading.Thread(target=lambda: self.desk.serve(self._tick, 0.02))
        self._serving.start()

    @property
    def address(self) -> str:
        return self.desk.addresses.commands

    def _tick(self) -> None:
        self.ticks += 1

    def _handle(self, command: Command) -> Reply | Future[Reply]:
        if command.name == "hello":
            return Reply(ok=True, data={"publisher": self.desk.addresses.publisher})
        self.asked.append(command)
        if command.name == "break":
            raise RuntimeError("a fault of ours")
        if command.name == "later":
            later: Future[Reply] = Future()
            threading.Timer(0.05, lambda: later.set_result(Reply(ok=True, text="now"))).start()
            return later
        return Reply(ok=True, text=command.name)

    def close(self) -> None:
        self.desk.stop()
        self._serving.join(10.0)
        assert not self._serving.is_alive(), "the counter must not hang"
        self.desk.close()


def listen_until_heard(client: AcquisitionClient, counter: Counter) -> Any:
    """A subscription takes a moment to arrive: publish until it does."""
    message = StateMessage(state=State.ARMED, text="hear this")
    for _ in range(200):
        counter.desk.publisher.send("state", message)
        received = client.receive(0.05)
        if received is not None:
            return received.message
    raise AssertionError("nothing was heard")
