"""Starts an acquisition process for one test and follows it in the terminal to its end."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from daq_app.acquisition.messages.published import EventMessage, Message, State, StateMessage
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from daq_app.acquisition.viewers.launcher import AcquisitionDied, AcquisitionProcess
from daq_app.cli.errors import EXIT_FAILED, EXIT_HARDWARE, EXIT_INTERRUPTED
from daq_app.cli.record.simulated_hand import SimulatedHand
from daq_app.cli.record.view import RunView
from daq_app.cli.terminal import Console
from daq_app.config import parse_rig
from daq_app.guarded import program
from drivers import DriverError
from drivers.ni.local_library import require_ni_daqmx

_QUIET_S = 0.25


@dataclass(frozen=True, slots=True)
class RunOptions:
    """What `daq-app run` was asked for."""

    rig: Path
    test: str
    out: Path
    connection: str | None
    speed: str
    seed: int | None
    theta0_over_alpha: float | None
    notes: str
    release_within_s: float
    spare: Path | None
    backup: Path | None
    window: bool

    def command_line(self) -> list[str]:
        """Options of ``python -m daq_app.acquisition``."""
        line = ["--rig", str(self.rig), "--out", str(self.out), "--test", self.test]
        line += ["--release-within", str(self.release_within_s), "--speed", self.speed]
        optional: dict[str, object | None] = {
            "--connection": self.connection,
            "--seed": self.seed,
            "--theta0-over-alpha": self.theta0_over_alpha,
            "--notes": self.notes or None,
            "--spare": self.spare,
            "--backup": self.backup,
        }
        for name, value in optional.items():
            if value is not None:
                line.append(f"{name}={value}")
        return line


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How the test went."""

    exit_code: int
    text: str
    """For the operator, where it did not end well."""
    run: Path | None
    outcome: str


class _Interrupts:
    """Turns the first Ctrl-C into a stop of the test; a second one leaves (the recording goes on)."""

    def __init__(self, client: AcquisitionClient) -> None:
        self._client = client
        self.asked = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        del number, frame
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


def follow_run(options: RunOptions, console: Console) -> RunEnd:
    """Take the test. Failures are told in the answer, not raised."""
    try:
        if options.connection == "local":
            require_ni_daqmx()  # a process would need seconds to say the same
        process = AcquisitionProcess(options.command_line(), say=console.print)
    except DriverError as error:
        return RunEnd(EXIT_HARDWARE, str(error), None, "")
    except AcquisitionDied as died:
        return RunEnd(died.exit_code or EXIT_HARDWARE, died.said, None, "")
    try:
        with process.client() as client:
            window = _open_window(process) if options.window else None
            try:
                return _follow(process, client, options, console)
            finally:
                if window is not None and window.poll() is None:
                    console.print("The window shows the run; close it when you have seen it.")
    except AcquisitionUnreachable as error:
        code = process.wait(30.0)
        return RunEnd(code or EXIT_HARDWARE, f"{error} {process.said}", None, "")


def _open_window(process: AcquisitionProcess) -> subprocess.Popen[bytes]:
    """The monitor, in a process of its own: whatever happens to it costs no sample."""
    return subprocess.Popen(
        [
            program(),
            "-c",
            "from daq_app.cli import main; main()",
            "monitor",
            "--connect",
            process.address,
        ],
        stdin=subprocess.DEVNULL,
        env={**os.environ, "DAQ_APP_TOKEN": process.token},
    )


class _TestCourse:
    """What a test tells while it goes on: shown, answered by the hand of a simulated wall, its end kept."""

    def __init__(self, client: AcquisitionClient, options: RunOptions, view: RunView) -> None:
        self._client, self._options, self._view = client, options, view
        self._rig = parse_rig(str(client.about["rig_text"]), str(options.rig))
        self._armed: Mapping[str, Any] = {}
        self._hand: SimulatedHand | None = None
        self.outcome, self.run = "", ""

    def take(self, message: Message) -> None:
        self._view.take(message)
        if self._view.state is State.ARMED and not self._armed:
            self._on_armed()
        if self._hand is not None:
            self._hand.take(message)
            if self._hand.trouble:
                self._view.say(self._hand.trouble, "bold red")
                self._hand.trouble = ""
        match message:
            case StateMessage(state=State.SAVED, run_path=path) if path:
                self.run = path
            case EventMessage(kind="saved", data=data):
                self.outcome, self.run = str(data.get("outcome", "")), str(data.get("run", "")) or self.run

    def _on_armed(self) -> None:
        self._armed = self._client.request("hello").data
        self._view.zeroed = bool(self._armed.get("tare"))
        if self._client.about.get("simulated"):
            connection = str(self._armed["connection"])
            self._hand = SimulatedHand(connection, self._rig, self._options.theta0_over_alpha)

    def close(self) -> None:
        if self._hand is not None:
            self._hand.close()


def _follow(
    process: AcquisitionProcess, client: AcquisitionClient, options: RunOptions, console: Console
) -> RunEnd:
    view = RunView(console, options.test, client.about)
    course = _TestCourse(client, options, view)
    interrupts = _Interrupts(client)
    previous = signal.signal(signal.SIGINT, interrupts)
    stopping = False
    try:
        with view:
            while process.process.poll() is None:
                received = client.receive(_QUIET_S)
                if interrupts.asked and not stopping:
                    stopping = True
                    view.say("Stopping; what was recorded is kept")
                    _ask_to_stop(client)
                if received is not None:
                    course.take(received.message)
    finally:
        signal.signal(signal.SIGINT, previous)
        course.close()
    code = process.wait()
    if stopping:
        code = EXIT_INTERRUPTED
    elif code == 0 and course.outcome != "complete":
        code = EXIT_FAILED
    text = process.said if code not in (0, EXIT_INTERRUPTED) else ""
    if code == EXIT_FAILED and not text:
        text = f"The run was {course.outcome or 'not completed'}: {view.last_text}"
    return RunEnd(code, text, Path(course.run) if course.run else None, course.outcome)


def _ask_to_stop(client: AcquisitionClient) -> None:
    try:
        client.request("shutdown", force=1.0)
    except AcquisitionUnreachable:
        return  # it is ending already
