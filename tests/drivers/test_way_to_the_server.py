"""The way to the device server: slow to open, silent, garbled or not there."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from typing import Any

import grpc
import nidaqmx
import pytest
from nidaqmx import errors as ni_errors

from drivers import Driver, DriverError, open_driver
from drivers.ni.stream import TaskStream
from tests.support.recorder.relay import Relay

SLOW_S = 0.4
"""Names, TCP and TLS over a distance, or a computer with too much to do."""


class SlowDoor(Relay):
    """A connection waits before its first byte is passed on."""

    slow_s = 0.0

    def let_in(self, plain: socket.socket) -> socket.socket | None:
        return None if self.closing.wait(self.slow_s) else plain  # waiting is the fault itself


@pytest.fixture
def lab(laboratory: Callable[..., Any]) -> Any:
    return laboratory()


@pytest.fixture
def door(lab: Any) -> Iterator[SlowDoor]:
    made = SlowDoor(lab.server.port)
    yield made
    made.close()


def started(connection: str, lab: Any) -> Driver:
    driver = open_driver(connection)
    driver.open(lab.plan)
    driver.start()
    return driver


def test_a_connection_that_opens_slowly_is_waited_for(lab: Any, door: SlowDoor) -> None:
    """Each recovery makes a new connection: were each given up after 0.1 s, none would ever succeed."""
    driver = started(f"grpc://127.0.0.1:{door.port}", lab)
    before = driver.read(1.0)
    door.slow_s = SLOW_S
    assert driver.recover() == "", "the first attempt succeeds, and no sample is lost"
    after = driver.read(1.0)
    assert after.first_sample == before.first_sample + before.n_samples
    driver.close()


def test_hardware_behind_a_slow_connection_opens(lab: Any, door: SlowDoor) -> None:
    door.slow_s = SLOW_S
    driver = started(f"grpc://127.0.0.1:{door.port}", lab)
    assert driver.read(1.0).first_sample == 0
    driver.close()


def test_no_call_between_two_reads_may_wait_for_half_a_buffer(
    lab: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reply that never comes must be given up while the device still holds what was sampled meanwhile."""
    driver: Any = started(lab.connection, lab)
    allowed_s: list[float] = []
    position = TaskStream.device_position

    def looked_at(stream: TaskStream) -> int:
        allowed_s.append(driver._connection._deadline.seconds)
        return position(stream)

    monkeypatch.setattr(TaskStream, "device_position", looked_at)
    driver.read(1.0)
    assert allowed_s and max(allowed_s) <= 0.15 * lab.rig.acquisition.buffer_s
    driver.close()


@pytest.mark.parametrize("times", [1, 9])
def test_one_damaged_reply_while_recovering_does_not_clear_tasks_that_still_run(
    lab: Any, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    driver = started(lab.connection, lab)
    before = driver.read(1.0)
    lab.let_time_pass(5.0)  # in the device's buffer: lost if the tasks are started again
    asked = nidaqmx.Task.is_task_done
    damaged = iter(range(times))

    def is_task_done(task: nidaqmx.Task) -> bool:
        if next(damaged, None) is not None:
            raise ni_errors.RpcError(grpc.StatusCode.INTERNAL, "Exception deserializing response!")
        return bool(asked(task))

    monkeypatch.setattr(nidaqmx.Task, "is_task_done", is_task_done)
    with pytest.raises(DriverError, match="could not be understood") as caught:
        driver.recover()
    assert caught.value.recoverable
    remark = driver.recover()
    if times == 1:
        assert remark == ""
        assert driver.read(1.0).first_sample == before.first_sample + before.n_samples
    else:
        assert "started again" in remark, "a server that never gives a sensible answer has lost the tasks"
    driver.close()


def test_no_server_at_all(lab: Any) -> None:
    lab.stop()
    driver = open_driver(lab.connection)
    with pytest.raises(DriverError) as caught:
        driver.open(lab.plan)
    assert "cannot be reached" in str(caught.value)
    driver.close()
