"""Acquisition processes on a simulated chassis, for the tests that look at them from outside."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from daq_app.acquisition import AcquisitionClient, AcquisitionUnreachable, read_session_file
from daq_app.acquisition.messages.published import EventMessage, HealthMessage, Message, State, StateMessage
from daq_app.acquisition.process.process import run_and_exit
from sim_hardware.control import SimControl, SimControlError
from tests.support.recorder.processes import quick_context

SPEED = 5
"""Slow enough that a busy machine keeps up: at this speed the buffer of 20 s lasts 4 s."""
RESTITUTION = 0.75
RATE_HZ = 4000
_OVER = (State.SAVING, State.SAVED, State.FAILED)


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
        arguments = ["--rig", str(rig), "--out", str(out), "--speed", str(SPEED), "--no-results", *options]
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
        self.over: StateMessage | None = None
        """How the recording of the test that was armed last has ended; None while it goes on."""
        self._test = ""
        self._options = options
        self._health: HealthMessage | None = None
        self._said: deque[str] = deque(maxlen=15)

    def wait_for(
        self, right: Callable[[Message], bool], timeout_s: float = 200.0, what: str = "the message"
    ) -> Message:
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            received = self.client.receive(0.2)
            if received is None:
                assert self.process.exitcode is None, f"ended with {self.process.exitcode}"
                continue
            self._note(received.message)
            if right(received.message):
                return received.message
        raise AssertionError(f"{what} was not heard within {timeout_s:g} s. {self.report()}")

    def _note(self, message: Message) -> None:
        if isinstance(message, HealthMessage):
            self._health = message
            if message.recording:
                self.acknowledged = max(self.acknowledged, message.acknowledged_sample)
        elif isinstance(message, StateMessage):
            said = f"{message.state.value} ({message.text})"
            if not self._said or self._said[-1] != said:
                self._said.append(said)
            if self._test and message.test == self._test and message.state in _OVER:
                self.over = message
        elif isinstance(message, EventMessage):
            self._said.append(f"{message.kind}@{message.sample}: {message.text}")

    def report(self) -> str:
        """What an engineer asks first when something is not heard: who lives, and what was said last."""
        lines = [f"Acquisition: exit code {self.process.exitcode}; acknowledged {self.acknowledged}"]
        try:
            about = self.client.request("hello", timeout_s=5.0).data
            lines.append(f"it answers: {about['state']}")
        except AcquisitionUnreachable as error:
            lines.append(f"it does not answer: {error}")
        lines.append(f"last health: {self._health}")
        if "--connection" in self._options:
            try:
                with SimControl(self._options[self._options.index("--connection") + 1], 5.0) as control:
                    lines.append(f"device server: {control.command('bench')} {control.command('faults')}")
            except SimControlError as error:
                lines.append(f"device server: {error}")
        return "\n  ".join([*lines, "said last:", *self._said])

    def wait_for_state(self, *states: State) -> StateMessage:
        message = self.wait_for(
            lambda m: isinstance(m, StateMessage) and m.state in states, what=f"the state {states}"
        )
        assert isinstance(message, StateMessage)
        return message

    def wait_for_safe_or_over(self, sample: int) -> None:
        """Until that sample is on disk, or the recording has ended by itself because the wall rests."""
        self.wait_for(
            lambda m: self.acknowledged >= sample or self.over is not None, what=f"sample {sample} on disk"
        )
        rests = self.over is None or self.over.state is State.SAVED or "come to rest" in self.over.text
        assert rests, f"the run ended before sample {sample}. {self.report()}"

    def wait_for_safe(self, sample: int) -> None:
        """Until that sample is on disk."""
        self.wait_for_safe_or_over(sample)
        assert self.acknowledged >= sample, f"the run ended before sample {sample}. {self.report()}"

    def arm(self, test: str) -> None:
        self.wait_for_state(State.PREVIEWING)
        reply = self.client.request("arm", test=test, timeout_s=30.0)
        assert reply.ok, reply.text
        self._test, self.over = test, None
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
