"""``python -m benchmarks.soak --minutes 60``: test after test while everything around them fails at random.

41 channels at 4000 Hz through the real nidaqmx client on a marked line: every recorded sample proves its
place. Tests are armed and stopped one after the other; meanwhile devices fail, the network is cut, the
recorder is frozen or killed, disks are full or give EIO, and the clock steps (all seeded). After each test
its runs are verified and every sample compared with its mark: each is right, or in the table of gaps with a
fault that explains it; what was acknowledged before a kill is there. Memory and handles of each recorder are
taken between its tests; the first recorder is kept alive over many. Prints a line a test, writes JSON; exit
code 1 if anything is unexplained or grows.
"""

from __future__ import annotations

import errno
import itertools
import os
import random
import re
import signal
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from daq_app.acquisition.messages.published import State
from daq_app.config import load_rig
from daq_app.runfile import Gap, open_run, recover, verify
from daq_app.runfile.folder import JOURNAL_SUFFIX, RUN_SUFFIX, find_journals, find_runs
from sim_hardware.control import SimControl
from studies.recording.injecting import Injected, choose_fault, unexplained_gaps
from studies.recording.marked_recording import RIG, command_line, console, marked_server, write_report
from studies.recording.soak_recorder import LIMIT_S, SoakRecorder
from tests.support.recorder.marked_check import Leap, check_marked
from tests.support.recorder.processes import free_the_hardware
from tests.support.recorder.relay import Relay

_QUIET_S: Final = 5.0
"""After each fault, so that a gap belongs to it."""
_MACHINE_FAULTS: Final = ("network cut", "full disk", "EIO", "clock step", "device", "device")
_KILL_SHARE: Final = 0.25
"""Share of the tests that end with a kill of the recorder."""
_LONG_LIFE_SHARE: Final = 0.4
"""Of the time, in which the first recorder is not killed: what a recorder leaks shows over many tests."""
_LONGEST_BUFFER_S: Final = 120.0
"""That a rig file may ask for."""
_GROWTH_MB: Final = 25.0
"""Largest growth of a recorder's memory from one half of its tests to the other that counts as flat.

Of medians: a test in which samples piled up leaves up to 40 MB more, which later tests use or give back."""
_LEAST_TESTS: Final = 8
"""Of a life whose memory is judged."""
_GROWTH_HANDLES: Final = 8


class CuttableRelay(Relay):
    """The network between recorder and device server, which can be cut for a while."""

    cut_until_s = 0.0

    def let_in(self, plain: Any) -> Any:
        return None if time.monotonic() < self.cut_until_s else plain

    def cut(self, seconds: float) -> None:
        """Break every connection and let none in for so long."""
        self.cut_until_s = time.monotonic() + seconds
        for connection in self._open[1:]:
            try:
                connection.shutdown(2)
            except OSError:
                continue
        del self._open[1:]


@dataclass(slots=True)
class TestOutcome:
    """One test of the soak and what its runs hold."""

    name: str
    faults: list[str] = field(default_factory=list)
    killed: bool = False
    runs: int = 0
    samples: int = 0
    lost: int = 0
    """In tables of gaps."""
    unexplained: int = 0
    """Wrong samples, gaps without a fault, and acknowledged samples that are not there."""
    problems: list[str] = field(default_factory=list)


def _rig_with_room(folder: Path, speed: float) -> Path:
    """The rig with a device buffer of as many seconds of this computer as at real time, or the longest."""
    buffer_s = min(load_rig(RIG).acquisition.buffer_s * speed, _LONGEST_BUFFER_S)
    text = re.sub(r"(?m)^buffer_s = .*$", f"buffer_s = {buffer_s:g}", RIG.read_text(encoding="utf-8"))
    path = folder / RIG.name
    path.write_text(text, encoding="utf-8")
    return path


def _growth(sizes: Sequence[float]) -> float:
    """How much more lies in the later half than in the earlier one."""
    half = len(sizes) // 2
    return statistics.median(sizes[half:]) - statistics.median(sizes[:half])


def _tell_leap(leap: Leap, gaps: Sequence[Gap]) -> str:
    before = next((gap for gap in reversed(gaps) if gap.end <= leap.sample), None)
    gap = f"{before.n_samples} samples ended at {before.end}: {before.reason}" if before else "none"
    return f"the marks leap by {leap.by} samples at {leap.sample}, the gap before it: {gap}"


class SoakOfTests:
    """Recorders one after the other; `run` answers the report."""

    def __init__(self, minutes: float, seed: int, speed: float, folder: Path, terminal: Console) -> None:
        self._end_s = time.monotonic() + 60.0 * minutes
        self._long_life_end_s = time.monotonic() + _LONG_LIFE_SHARE * 60.0 * minutes
        self._seed, self._speed, self._terminal = seed, speed, terminal
        self._rng = random.Random(seed)
        self._runs, self._spare = folder / "runs", folder / "spare"
        self._runs.mkdir()
        self._rig_file = _rig_with_room(folder, speed)
        self._rig = load_rig(self._rig_file)
        self._recorder: SoakRecorder | None = None
        self._outcomes: list[TestOutcome] = []
        self._sizes: list[list[tuple[float, int]]] = []

    def run(self) -> dict[str, Any]:
        """Tests until the time is over."""
        began = time.monotonic()
        with marked_server(self._speed) as server, SimControl(server.connection) as control:
            relay = CuttableRelay(int(server.connection.rpartition(":")[2]))
            try:
                while time.monotonic() < self._end_s:
                    self._one_test(control, relay, server.connection)
            except RuntimeError as error:  # what was seen until then is worth its report
                self._outcomes[-1].problems.append(str(error))
            finally:
                if self._recorder is not None:
                    self._retire(kill=False)
                relay.close()
        return self._report(time.monotonic() - began)

    def _one_test(self, control: SimControl, relay: CuttableRelay, connection: str) -> None:
        outcome = TestOutcome(f"SOAK-L3-{len(self._outcomes) + 1}")
        self._outcomes.append(outcome)
        if self._recorder is None:
            free_the_hardware(connection)
            address = f"grpc://127.0.0.1:{relay.port}"
            self._recorder = SoakRecorder(self._rig_file, self._runs, address, self._speed)
        recorder = self._recorder
        recorder.arm(outcome.name)
        faults: list[Injected] = []
        for _ in range(self._rng.randint(1, 4)):
            time.sleep(self._rng.uniform(1.0, 4.0))
            self._break_something(recorder, control, relay, faults)
            time.sleep(_QUIET_S)
        outcome.faults = [fault.kind for fault in faults]
        outcome.killed = self._rng.random() < _KILL_SHARE and time.monotonic() > self._long_life_end_s
        if outcome.killed:
            safe = recorder.safe
            self._retire(kill=True)
            recover(self._runs)
            if self._spare.is_dir():
                recover(self._spare)
        else:
            recorder.client.request("stop", timeout_s=LIMIT_S)
            over = (State.SAVED, State.FAILED, State.PREVIEWING, State.IDLE)
            recorder.wait(lambda: recorder.state is not None and recorder.state.state in over, "saved")
            recorder.wait(lambda: not self._journals(outcome.name), "every journal made into a run")
            safe = 0
            recorder.measure()
        self._judge(outcome, faults, safe)
        self._tell(outcome)

    def _break_something(
        self, recorder: SoakRecorder, control: SimControl, relay: CuttableRelay, faults: list[Injected]
    ) -> None:
        rng = self._rng
        kind = rng.choice(_MACHINE_FAULTS)
        lasts_s = rng.uniform(0.5, 4.0)
        arguments: dict[str, float | str] = {"for_s": lasts_s}
        if kind == "device":
            kind, arguments, lasts_s = choose_fault(rng, self._speed)
        faults.append(Injected(kind, time.monotonic(), arguments, recorder.sample))
        if kind == "network cut":
            relay.cut(lasts_s)
        elif kind in ("full disk", "EIO"):
            refusal = errno.ENOSPC if kind == "full disk" else errno.EIO
            recorder.sabotage(read_only=str(self._runs), refusal=refusal)
        elif kind == "clock step":
            recorder.sabotage(clock_s=rng.choice((-3600.0, -5.0, 5.0, 86_400.0)))
        elif kind == "process stopped":
            assert recorder.process.pid is not None
            os.kill(recorder.process.pid, signal.SIGSTOP)
            time.sleep(lasts_s)
            os.kill(recorder.process.pid, signal.SIGCONT)
            return
        else:
            control.command("fault", kind=kind, **arguments)
        time.sleep(lasts_s)
        recorder.sabotage()

    def _retire(self, *, kill: bool) -> None:
        assert self._recorder is not None
        self._sizes.append(self._recorder.sizes)
        self._recorder.close(kill=kill)
        self._recorder = None

    # -- what was recorded -----------------------------------------------------------------------------

    def _folders(self) -> list[Path]:
        return [folder for folder in (self._runs, self._spare) if folder.is_dir()]

    def _journals(self, test: str) -> list[Path]:
        """Journals of a test that no run was made of yet; one that was recovered lies beside its run."""
        return [
            journal
            for folder in self._folders()
            for journal in find_journals(folder)
            if journal.stem.startswith(f"{test}_") and not journal.with_suffix(RUN_SUFFIX).exists()
        ]

    def _judge(self, outcome: TestOutcome, faults: list[Injected], safe: int) -> None:
        """Check the runs of a test, then delete them: a soak of days needs no disk of days."""
        outcome.problems += [
            f"{journal.name}: no run was made of it" for journal in self._journals(outcome.name)
        ]
        paths = [run for folder in self._folders() for run in find_runs(folder)]
        ends = [
            self._judge_run(path, outcome, faults)
            for path in paths
            if path.stem.startswith(f"{outcome.name}_")
        ]
        if not ends:
            outcome.problems.append("there is no run of it")
        elif max(end for _, end in ends) < safe:
            outcome.unexplained += safe - max(end for _, end in ends)
            outcome.problems.append("acknowledged samples are not there")
        # A test that goes on in another place is one row of runs without a hole.
        ends.sort()
        for (_, end), (first, _) in itertools.pairwise(ends):
            if first > end:
                outcome.unexplained += first - end
                outcome.problems.append(f"{first - end} samples are in no run")

    def _judge_run(self, path: Path, outcome: TestOutcome, faults: list[Injected]) -> tuple[int, int]:
        report = verify(path)
        outcome.problems += report.problems
        marks = check_marked(path, self._rig, None, speed=self._speed)
        with open_run(path) as run:
            asleep = [event.sample for event in run.events if event.data.get("alarm") == "asleep"]
            strange = unexplained_gaps(faults, run.gaps, asleep)
            ends = run.first_sample, run.first_sample + run.n_samples
            leaps = [_tell_leap(leap, run.gaps) for leap in marks.leaps if not leap.explained]
        outcome.problems += leaps
        if strange:
            outcome.problems.append(f"{strange} gaps have no fault")
        outcome.runs += 1
        outcome.samples += marks.n_samples
        outcome.lost += marks.missing
        outcome.unexplained += marks.unexplained + strange + len(leaps)
        if not outcome.problems:
            path.unlink()
            path.with_suffix(JOURNAL_SUFFIX).unlink(missing_ok=True)
        return ends

    def _tell(self, outcome: TestOutcome) -> None:
        left_min = max(0.0, self._end_s - time.monotonic()) / 60.0
        sizes = self._recorder.sizes[-1] if self._recorder is not None and self._recorder.sizes else None
        size = f", {sizes[0]:.0f} MB, {sizes[1]} handles" if sizes else ""
        bad = f"  UNEXPLAINED: {'; '.join(outcome.problems)}" if outcome.problems else ""
        self._terminal.print(
            f"{outcome.name}: {', '.join(outcome.faults)}{', killed' if outcome.killed else ''}: "
            f"{outcome.samples} samples, {outcome.lost} lost{size}; {left_min:.0f} min left{bad}",
            highlight=False, markup=False, soft_wrap=True,
        )  # fmt: skip

    def _report(self, lasted_s: float) -> dict[str, Any]:
        lives = [life for life in self._sizes if len(life) > 2]
        judged = [[size for size, _ in life] for life in lives if len(life) >= _LEAST_TESTS]
        return {
            "minutes": lasted_s / 60.0,
            "seed": self._seed,
            "speed": self._speed,
            "tests": len(self._outcomes),
            "kills": sum(outcome.killed for outcome in self._outcomes),
            "faults": dict(Counter(kind for outcome in self._outcomes for kind in outcome.faults)),
            "samples": sum(outcome.samples for outcome in self._outcomes),
            "lost_samples": sum(outcome.lost for outcome in self._outcomes),
            "unexplained": sum(outcome.unexplained for outcome in self._outcomes),
            "bad": [asdict(outcome) for outcome in self._outcomes if outcome.problems],
            "recorders": len(self._sizes),
            "growth_mb": max((_growth(life) for life in judged), default=0.0),
            "most_tests_of_a_recorder": max((len(life) for life in self._sizes), default=0),
            "memory_mb": max((size for life in self._sizes for size, _ in life), default=0.0),
            "growth_handles": max((life[-1][1] - life[1][1] for life in lives), default=0),
            "sizes": self._sizes,
        }


def main() -> int:
    """0 if every sample of every test is explained, and memory and handles are flat."""
    parser = command_line("soak_tests", __doc__, speed=1.0)
    parser.add_argument("--minutes", type=float, default=30.0)
    options = parser.parse_args()
    terminal = console()
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        report = SoakOfTests(options.minutes, options.seed, options.speed, Path(name), terminal).run()
    write_report(options.json, report)
    terminal.print(
        f"{report['minutes']:.1f} min, {report['tests']} tests, {report['kills']} kills, "
        f"{sum(report['faults'].values())} faults, {report['samples']} samples of 41 channels, "
        f"{report['lost_samples']} lost, {report['unexplained']} unexplained in {len(report['bad'])} tests; "
        f"a recorder grew by at most {report['growth_mb']:.1f} MB and {report['growth_handles']} handles, "
        f"the longest life had {report['most_tests_of_a_recorder']} tests, the most memory was "
        f"{report['memory_mb']:.0f} MB; seed {report['seed']}",
        highlight=False, soft_wrap=True,
    )  # fmt: skip
    flat = report["growth_mb"] <= _GROWTH_MB and report["growth_handles"] <= _GROWTH_HANDLES
    return 0 if not report["bad"] and not report["unexplained"] and flat else 1


if __name__ == "__main__":
    sys.exit(main())
