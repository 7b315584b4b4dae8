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

from daq_app.acquisition.messages.published import EventMessage, State, StateMessage
from daq_app.acquisition.viewers.client import AcquisitionClient, AcquisitionUnreachable
from daq_app.acquisition.viewers.launcher import AcquisitionDied, AcquisitionProcess
from daq_app.cli.errors import EXIT_FAILED, EXIT_HARDWARE, EXIT_INTERRUPTED
from daq_app.cli.record.simulated_hand import SimulatedHand
from daq_app.cli.record.view import RunView
from daq_app.cli.terminal import Console
from daq_app.config import parse_rig
from daq_app.guarded import program
from drivers import DriverError
from drivers.local_library import require_ni_daqmx

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


def _follow(
    process: AcquisitionProcess, client: AcquisitionClient, options: RunOptions, console: Console
) -> RunEnd:
    interrupts = _Interrupts(client)
    previous = signal.signal(signal.SIGINT, interrupts)
    outcome, run, stopping = "", "", False
    hand: SimulatedHand | None = None
    armed: Mapping[str, Any] = {}
    rig = parse_rig(str(client.about["rig_text"]), str(options.rig))
    try:
        with RunView(console, options.test, client.about) as view:
            while process.process.poll() is None:
                received = client.receive(_QUIET_S)
                if interrupts.asked and not stopping:
                    stopping = True
                    view.say("Stopping; what was recorded is kept")
                    _ask_to_stop(client)
                if received is None:
                    continue
                view.take(received.message)
                if view.state is State.ARMED and not armed:
                    armed = client.request("hello").data
                    view.zeroed = bool(armed.get("tare"))
                if hand is None and client.about.get("simulated") and view.state is State.ARMED:
                    connection = str(armed["connection"])
                    hand = SimulatedHand(connection, rig, options.theta0_over_alpha)
                if hand is not None:
                    hand.take(received.message)
                    if hand.trouble:
                        view.say(hand.trouble, "bold red")
                        hand.trouble = ""
                match received.message:
                    case StateMessage(state=State.SAVED, run_path=path) if path:
                        run = path
                    case EventMessage(kind="saved", data=data):
                        outcome, run = str(data.get("outcome", "")), str(data.get("run", "")) or run
    finally:
        signal.signal(signal.SIGINT, previous)
        if hand is not None:
            hand.close()
    code = process.wait()
    if stopping:
        code = EXIT_INTERRUPTED
    elif code == 0 and outcome != "complete":
        code = EXIT_FAILED
    text = process.said if code not in (0, EXIT_INTERRUPTED) else ""
    if code == EXIT_FAILED and not text:
        text = f"The run was {outcome or 'not completed'}: {view.last_text}"
    return RunEnd(code, text, Path(run) if run else None, outcome)


def _ask_to_stop(client: AcquisitionClient) -> None:
    try:
        client.request("shutdown", force=1.0)
    except AcquisitionUnreachable:
        return  # it is ending already
