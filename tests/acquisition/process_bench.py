"""Acquisition processes on a simulated chassis, for the tests that look at them from outside."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.processes import quick_context
from daq_app.acquisition import AcquisitionClient, read_session_file
from daq_app.acquisition.messages import HealthMessage, Message, State, StateMessage
from daq_app.acquisition.process import run_and_exit
from sim_hardware.control import SimControl

SPEED = 5
"""Slow enough that a busy machine keeps up: at this speed the buffer of 20 s lasts 4 s."""
RESTITUTION = 0.75
RATE_HZ = 4000


def quick_rig(configs: Path, folder: Path) -> Path:
    """FR1 with a wall that comes to rest soon, as a file in `folder`."""
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    for old, new in (
        ("restitution = 0.895", f"restitution = {RESTITUTION}"),
        ("post_rest_s = 2.0", "post_rest_s = 0.5"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = folder / "quick.toml"
    path.write_text(text, encoding="utf-8")
    return path


class Running:
    """An acquisition process and a viewer that may command."""

    def __init__(self, rig: Path, out: Path, *options: str) -> None:
        self.out = out
        arguments = ["--rig", str(rig), "--out", str(out), "--speed", str(SPEED), *options]
        self.process = quick_context().Process(target=run_and_exit, args=(arguments,))
        self.process.start()
        deadline = time.monotonic() + 60
        session = None
        while session is None or session.pid != self.process.pid:
            assert self.process.exitcode is None, f"ended with {self.process.exitcode}"
            assert time.monotonic() < deadline
            self.process.join(0.02)
            session = read_session_file(out)
        self.client = AcquisitionClient(session.address, session.token, timeout_s=60.0)
        self.acknowledged = 0
        self.test_journal = ""

    def wait_for(self, right: Callable[[Message], bool], timeout_s: float = 200.0) -> Message:
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            received = self.client.receive(0.2)
            if received is None:
                assert self.process.exitcode is None, f"ended with {self.process.exitcode}"
                continue
            message = received.message
            if isinstance(message, HealthMessage) and message.recording:
                self.acknowledged = max(self.acknowledged, message.acknowledged_sample)
            if right(message):
                return message
        raise AssertionError("not heard in time")

    def wait_for_state(self, *states: State) -> StateMessage:
        message = self.wait_for(lambda m: isinstance(m, StateMessage) and m.state in states)
        assert isinstance(message, StateMessage)
        return message

    def wait_for_safe(self, sample: int) -> None:
        """Until that sample is on disk."""
        self.wait_for(lambda m: self.acknowledged >= sample)

    def arm(self, test: str) -> None:
        self.wait_for_state(State.PREVIEWING)
        reply = self.client.request("arm", test=test, timeout_s=30.0)
        assert reply.ok, reply.text
        self.test_journal = str(reply.data["journal"])

    def kill(self) -> None:
        self.process.kill()
        self.process.join()
        self.client.close()

    def end(self) -> int:
        self.client.request("shutdown", force=1.0, timeout_s=30.0)
        return self.wait()

    def wait(self) -> int:
        self.process.join(200)
        self.client.close()
        code = self.process.exitcode
        if code is None:
            self.process.kill()
            raise AssertionError("the process does not end")
        return code


def whole_test(running: Running, wall: SimControl, test: str) -> StateMessage:
    running.wait_for_state(State.PREVIEWING)
    zeroed = running.client.request("tare", timeout_s=60.0)
    assert zeroed.ok, zeroed.text
    running.arm(test)
    wall.command("pull", duration_s=1.0)
    held = running.wait_for_state(State.HOLDING)
    # As in a lab: the wall hangs still for a while before it is let go.
    running.wait_for(lambda m: isinstance(m, HealthMessage) and m.sample >= held.sample + 3 * RATE_HZ)
    wall.command("release")
    return running.wait_for_state(State.SAVED, State.FAILED)
