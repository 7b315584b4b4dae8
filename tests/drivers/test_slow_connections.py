"""A way to the device server that is slow to open: the driver must find it again all the same."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivers import open_driver
from drivers.stream import TaskStream

SLOW_S = 0.4
"""Names, TCP and TLS over a distance, or a computer with too much to do."""


class SlowDoor:
    """Passes on what is said; a connection waits before its first byte is."""

    def __init__(self, port: int) -> None:
        self._behind = port
        self.slow_s = 0.0
        self._closing = threading.Event()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = f"grpc://127.0.0.1:{self._listening.getsockname()[1]}"
        self._open: list[socket.socket] = [self._listening]
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while True:
                front, _ = self._listening.accept()
                self._open.append(front)
                threading.Thread(target=self._open_slowly, args=(front,), daemon=True).start()

    def _open_slowly(self, front: socket.socket) -> None:
        if self._closing.wait(self.slow_s):  # this is the fault itself
            return
        back = socket.create_connection(("127.0.0.1", self._behind))
        self._open.append(back)
        threading.Thread(target=self._pass_on, args=(back, front), daemon=True).start()
        self._pass_on(front, back)

    @staticmethod
    def _pass_on(source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                target.sendall(data)
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._closing.set()
        for each in self._open:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        self._thread.join()


@pytest.fixture
def lab(laboratory: Callable[..., Any]) -> Any:
    return laboratory()


@pytest.fixture
def door(lab: Any) -> Iterator[SlowDoor]:
    made = SlowDoor(lab.server.port)
    yield made
    made.close()


def test_a_connection_that_opens_slowly_is_waited_for(lab: Any, door: SlowDoor) -> None:
    """Each recovery makes a new connection: were each given up after 0.1 s, none would ever succeed."""
    driver = open_driver(door.address)
    driver.open(lab.plan)
    driver.start()
    before = driver.read(1.0)
    door.slow_s = SLOW_S
    assert driver.recover() == "", "the first attempt succeeds, and no sample is lost"
    after = driver.read(1.0)
    assert after.first_sample == before.first_sample + before.n_samples
    driver.close()


def test_hardware_behind_a_slow_connection_opens(lab: Any, door: SlowDoor) -> None:
    door.slow_s = SLOW_S
    driver = open_driver(door.address)
    driver.open(lab.plan)
    driver.start()
    assert driver.read(1.0).first_sample == 0
    driver.close()


def test_no_call_between_two_reads_may_wait_for_half_a_buffer(
    lab: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reply that never comes must be given up while the device still holds what was sampled meanwhile."""
    driver: Any = open_driver(lab.connection)
    driver.open(lab.plan)
    driver.start()
    allowed_s: list[float] = []
    position = TaskStream.device_position

    def looked_at(stream: TaskStream) -> int:
        allowed_s.append(driver._connection._deadline.seconds)
        return position(stream)

    monkeypatch.setattr(TaskStream, "device_position", looked_at)
    driver.read(1.0)
    assert allowed_s and max(allowed_s) <= 0.15 * lab.rig.acquisition.buffer_s
    driver.close()
