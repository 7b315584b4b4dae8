"""``python -m studies.recording.kills --kills 300``: kill −9 at random moments of a recording's whole life.

Each round starts an acquisition process on a simulated device server (marked line: every sample proves its
place), kills it somewhere between arming and the finished run file, and sometimes kills the next one while it
recovers. In other rounds the operator's window, or a process that makes runs or results, is killed first: the
recorder must go on. Afterwards one last process recovers what is left. Counted: runs that can be read and
verify, samples that had been read but are not in the run, and recorders that ended with what was killed
beside them. Prints a table, writes JSON; exit code 1 unless all runs are readable, none lacks more than one
block, and every recorder went on.
"""

from __future__ import annotations

import contextlib
import os
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import psutil
from rich.console import Console

from daq_app.acquisition import AcquisitionClient, SessionFile, read_session_file
from daq_app.acquisition.messages.published import HealthMessage, State, StateMessage
from daq_app.acquisition.process.process import run_and_exit
from daq_app.config import load_rig
from daq_app.runfile import open_run, verify
from studies.recording.marked_recording import RIG, command_line, console, marked_server, write_report
from tests.support.recorder.marked_check import check_marked
from tests.support.recorder.processes import free_the_hardware, quick_context

MOMENTS: Final = (
    *("arming", "rocking", "rocking", "finalising", "making the result"),
    *("recovering", "the window", "a helper"),
)
"""When, or what beside the recorder, is killed in the rounds."""
_LIMIT_S: Final = 240.0


@dataclass(slots=True)
class Killed:
    """One kill and what was left of the run."""

    moment: str
    stem: str
    read_sample: int
    """Last sample that the process had told of as read."""
    safe_sample: int
    """Last sample that the process had told of as on disk."""
    readable: bool = False
    end_sample: int = 0
    problem: str = ""
    went_on: bool = True
    """The recorder, after something beside it was killed."""

    @property
    def lost_blocks(self) -> int:
        return max(0, -(-(self.read_sample - self.end_sample) // 400))


def run_quietly(arguments: list[str]) -> None:
    """The process, without the line that says where it listens."""
    with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        run_and_exit(arguments)


class Life:
    """One acquisition process and what it has told."""

    def __init__(self, folder: Path, connection: str, speed: float) -> None:
        self._folder = folder
        arguments = [
            "--rig",
            str(RIG),
            "--out",
            str(folder),
            "--connection",
            connection,
            "--speed",
            str(speed),
        ]
        self.process = quick_context().Process(target=run_quietly, args=(arguments,))
        self.process.start()
        try:
            self.session = self._started()
        except BaseException:  # Ctrl-C too: nothing may hold the folder when the rounds are judged
            self.process.kill()
            self.process.join()
            raise
        topics = ("health", "state")
        self.client = AcquisitionClient(
            self.session.address, self.session.token, topics=topics, timeout_s=60.0
        )
        self.read = self.safe = 0
        self.state: State | None = None

    def _started(self) -> SessionFile:
        """What the process says of itself once it runs."""
        deadline = time.monotonic() + _LIMIT_S
        while True:
            session = read_session_file(self._folder)
            if session is not None and session.pid == self.process.pid:
                return session
            if self.process.exitcode is not None or time.monotonic() > deadline:
                raise RuntimeError(f"the process did not start: {self.process.exitcode}")
            self.process.join(0.01)

    def listen(self, seconds: float, *until: State) -> None:
        """Keep the newest health and state for so long, or until a state comes."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0 and self.state not in until:
            received = self.client.receive(left)
            match received.message if received is not None else None:
                case HealthMessage() as health if health.recording:
                    self.read, self.safe = health.sample, health.acknowledged_sample
                case StateMessage() as told:
                    self.state = told.state

    def arm(self, test: str) -> Path:
        deadline = time.monotonic() + _LIMIT_S
        while True:
            reply = self.client.request("arm", timeout_s=60.0, test=test)
            if reply.ok:
                return Path(str(reply.data["journal"]))
            if time.monotonic() > deadline:
                raise RuntimeError(reply.text)
            time.sleep(0.02)

    def kill_a_helper(self, rng: random.Random) -> None:
        """One of the processes that make runs, results and verdicts for it, if one is there."""
        with contextlib.suppress(psutil.Error, IndexError):
            rng.choice(psutil.Process(self.process.pid).children(recursive=True)).kill()

    def kill_a_window(self, seconds: float) -> None:
        """A window with all its processes, so long after it was started."""
        command = (*("-m", "daq_app.cli", "monitor", "--connect"), self.session.address)
        window = subprocess.Popen(
            [sys.executable, *command],
            env=os.environ | {"QT_QPA_PLATFORM": "offscreen", "DAQ_APP_TOKEN": self.session.token},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.listen(seconds)
        family = [psutil.Process(window.pid), *psutil.Process(window.pid).children(recursive=True)]
        for process in reversed(family):
            with contextlib.suppress(psutil.Error):
                process.kill()
        window.wait()

    def kill(self) -> None:
        self.process.kill()
        self.process.join()
        self.client.close()


def one_round(number: int, rng: random.Random, folder: Path, connection: str, speed: float) -> Killed:
    """From start to kill."""
    moment = MOMENTS[number % len(MOMENTS)]
    life = Life(folder, connection, speed)
    try:
        if moment == "recovering":  # what the rounds before have left is being made good just now
            life.listen(rng.uniform(0.0, 0.5))
        journal = life.arm(f"KILL-L3-{number}")
        life.listen(rng.uniform(0.0, 0.05) if moment == "arming" else rng.uniform(0.1, 1.5))
        if moment == "the window":
            life.kill_a_window(rng.uniform(0.5, 8.0))
            life.listen(0.5)
        elif moment in ("finalising", "making the result", "a helper"):
            life.client.request("stop", timeout_s=60.0)
            if moment == "making the result":
                life.listen(_LIMIT_S, State.SAVED)
            life.listen(rng.uniform(0.0, 1.0))
            if moment == "a helper":
                life.kill_a_helper(rng)
                life.listen(_LIMIT_S, State.SAVED, State.FAILED)
        went_on = life.process.exitcode is None
    finally:
        life.kill()
    free_the_hardware(connection)
    return Killed(moment, journal.stem, life.read, life.safe, went_on=went_on)


def _judge(kill: Killed, folder: Path) -> None:
    path = folder / f"{kill.stem}.h5"
    if not path.exists():
        # Killed before its first block was read: nothing to make a run of.
        kill.readable = (folder / f"{kill.stem}.journal-recovered").exists() and kill.read_sample == 0
        kill.problem = "" if kill.readable else "no run"
        return
    report = verify(path)
    if not report.ok:
        kill.problem = "; ".join(report.problems)
        return
    with open_run(path) as run:
        kill.end_sample = run.first_sample + run.n_samples
        gaps = len(run.gaps)
    marks = check_marked(path, load_rig(RIG), None)
    kill.readable = marks.ok and gaps == 0
    kill.problem = "" if kill.readable else f"{marks.unexplained} wrong samples, {gaps} gaps"


def run(kills: int, seed: int, speed: float, terminal: Console) -> list[Killed]:
    """All rounds, the last recovery, the judgement."""
    rng = random.Random(seed)
    done: list[Killed] = []
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        folder = Path(name)
        with marked_server(speed) as server:
            with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C: judge what there is
                for number in range(kills):
                    done.append(one_round(number, rng, folder, server.connection, speed))
                    if number % 25 == 24:
                        terminal.print(f"{number + 1} kills", highlight=False)
            last = Life(folder, server.connection, speed)
            deadline = time.monotonic() + _LIMIT_S + 20.0 * kills
            while list(folder.glob("*.journal")) and time.monotonic() < deadline:
                time.sleep(0.1)
            last.client.request("shutdown", timeout_s=60.0, force=1.0)
            last.process.join(60.0)
        for kill in done:
            _judge(kill, folder)
    return done


def _summary(done: list[Killed]) -> dict[str, Any]:
    readable = sum(kill.readable for kill in done)
    worst = max(kill.lost_blocks for kill in done)
    unsafe = sum(kill.end_sample < kill.safe_sample for kill in done)
    bad = [kill for kill in done if not (kill.readable and kill.went_on) or kill.lost_blocks > 1]
    return {
        "kills": len(done),
        "readable": readable,
        "most_blocks_lost": worst,
        "acknowledged_samples_missing": unsafe,
        "recorders_ended": sum(not kill.went_on for kill in done),
        "by_moment": {
            moment: sum(kill.moment == moment for kill in done) for moment in dict.fromkeys(MOMENTS)
        },
        "bad": [asdict(kill) for kill in bad],
    }


def main() -> int:
    """0 if every run is readable and none lacks more than one block."""
    parser = command_line("kills", __doc__, speed=2.0)
    parser.add_argument("--kills", type=int, default=300)
    options = parser.parse_args()
    terminal = console()
    began = time.monotonic()
    found = _summary(run(options.kills, options.seed, options.speed, terminal))
    write_report(options.json, found)
    terminal.print(
        f"{found['readable']} of {found['kills']} readable and right in every sample; at most "
        f"{found['most_blocks_lost']} block lost in each; {found['acknowledged_samples_missing']} lack an "
        f"acknowledged sample; {found['recorders_ended']} recorders ended with what was killed beside them "
        f"({', '.join(f'{m} {n}' for m, n in found['by_moment'].items())}; "
        f"{time.monotonic() - began:.0f} s; seed {options.seed})",
        soft_wrap=True,
    )
    return 0 if not found["bad"] else 1


if __name__ == "__main__":
    sys.exit(main())
