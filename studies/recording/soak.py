"""``python -m studies.recording.soak --minutes 30``: a long recording with faults and changing viewers.

41 channels at 4000 Hz through the real nidaqmx client, one run from arming to the end. Terminals are marked
(`sim_hardware.marked_line`), so that every recorded sample proves its place. Faults come at random (seeded),
viewers attach, hang, and are killed. At the end: every sample is the right one or in the table of gaps, every
gap has its fault (or a pause of the whole machine that the recording itself tells of), the memory of the
process is flat, the file verifies. Prints a table, writes JSON; exit code 1 if anything is unexplained.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
from rich.console import Console
from rich.table import Table

from daq_app.acquisition import AcquisitionClient, AcquisitionProcess
from daq_app.acquisition.messages.published import EventMessage, HealthMessage, State, StateMessage
from daq_app.config import load_rig
from daq_app.runfile import open_run, verify
from sim_hardware.control import SimControl
from studies.recording.injecting import Injected, choose_fault, unexplained_gaps
from studies.recording.marked_recording import RIG, command_line, console, marked_server, write_report
from tests.support.recorder.marked_check import check_marked

_QUIET_S: Final = 6.0
"""After each fault, so that what is heard belongs to it."""
_VIEWER: Final = """
import sys
from daq_app.acquisition import AcquisitionClient
with AcquisitionClient(sys.argv[1]) as client:
    while True:
        client.receive(9.0)
"""


class Soak:
    """One recording; `run` does it all and answers the report."""

    def __init__(self, minutes: float, seed: int, speed: float, folder: Path, console: Console) -> None:
        self._minutes, self._seed, self._speed, self._folder = minutes, seed, speed, folder
        self._console = console
        self._rng = random.Random(seed)
        self._rig = load_rig(RIG)
        self._faults: list[Injected] = []
        self._events: list[EventMessage] = []
        self._memory: list[tuple[float, float]] = []
        self._viewers = 0
        self._ended = threading.Event()
        self._state: StateMessage | None = None
        self._health: HealthMessage | None = None
        self._begun_s = 0.0

    def run(self) -> dict[str, Any]:
        """Record, break, watch, stop, check."""
        with marked_server(self._speed) as server, SimControl(server.connection) as control:
            limit_s = str(60.0 * self._minutes * self._speed + 3600.0)
            process = AcquisitionProcess(
                [
                    *("--rig", str(RIG), "--out", str(self._folder), "--connection", server.connection),
                    *("--speed", str(self._speed), "--release-within", limit_s),
                ]
            )
            with process.client(("state", "health", "event")) as client:
                listener = threading.Thread(target=self._listen, args=(client,))
                listener.start()
                self._wait_for(State.PREVIEWING)
                reply = client.request("arm", timeout_s=60.0, test="SOAK-L3-1")
                if not reply.ok:
                    raise RuntimeError(reply.text)
                self._begun_s = time.monotonic()
                visitors = threading.Thread(target=self._visit, args=(process.address,))
                visitors.start()
                self._break_things(control, process.process.pid)
                visitors.join()
                recorded_s = time.monotonic() - self._begun_s
                client.request("stop", timeout_s=60.0)
                saved = self._wait_for(State.SAVED, State.FAILED, limit_s=1800.0)
                with AcquisitionClient(process.address, process.token, topics=()) as last:
                    last.request("shutdown", timeout_s=60.0, force=1.0)
                self._ended.set()
                listener.join()
            process.wait(120.0)
        return self._report(Path(saved.run_path), recorded_s)

    # -- while it runs ---------------------------------------------------------------------------------

    def _listen(self, client: AcquisitionClient) -> None:
        while not self._ended.is_set():
            received = client.receive(0.5)
            match received.message if received is not None else None:
                case EventMessage() as event:
                    self._events.append(event)
                    if self._faults and event.kind not in ("armed", "note"):
                        fault = self._faults[-1]
                        fault.heard.append((time.monotonic() - fault.at_s, event.severity, event.text))
                case StateMessage() as state:
                    self._state = state
                case HealthMessage() as health:
                    self._health = health

    def _wait_for(self, *states: State, limit_s: float = 240.0) -> StateMessage:
        deadline = time.monotonic() + limit_s
        while time.monotonic() < deadline:
            if self._state is not None and self._state.state in states:
                return self._state
            time.sleep(0.05)
        raise RuntimeError(f"not {states} within {limit_s:g} s; last: {self._state}")

    def _break_things(self, control: SimControl, pid: int) -> None:
        end_s = self._begun_s + 60.0 * self._minutes
        watched = psutil.Process(pid)
        next_s = time.monotonic() + 5.0
        last_s = 0.0
        while time.monotonic() < end_s:
            time.sleep(0.1)
            now = time.monotonic()
            if now - last_s > 2.0:
                last_s = now
                self._memory.append((now - self._begun_s, watched.memory_info().rss / 2**20))
            if now >= next_s and end_s - now > 40.0:
                lasts_s = self._break_something(control, pid)
                next_s = time.monotonic() + lasts_s + _QUIET_S + self._rng.uniform(0.0, 15.0)

    def _break_something(self, control: SimControl, pid: int) -> float:
        """Choose and inject; how long it lasts in seconds of ours."""
        kind, arguments, ours_s = choose_fault(self._rng, self._speed)
        at = self._health.sample if self._health is not None else 0
        fault = Injected(kind, time.monotonic(), arguments, at)
        self._faults.append(fault)
        if kind == "process stopped":
            os.kill(pid, signal.SIGSTOP)
            time.sleep(ours_s)
            os.kill(pid, signal.SIGCONT)
            arguments["for_s"] = ours_s
            return 0.0
        control.command("fault", kind=kind, **arguments)
        return ours_s

    def _visit(self, address: str) -> None:
        """Viewers: polite ones, ones that never read, ones that are killed."""
        rng = random.Random(self._seed + 1)
        end_s = self._begun_s + 60.0 * self._minutes
        while time.monotonic() < end_s - 10.0:
            self._viewers += 1
            stays_s = rng.uniform(2.0, 15.0)
            kind = rng.choice(("polite", "silent", "killed"))
            if kind == "killed":
                viewer = subprocess.Popen([sys.executable, "-c", _VIEWER, address])
                time.sleep(stays_s)
                viewer.kill()
                viewer.wait()
                continue
            try:
                with AcquisitionClient(address) as client:
                    until = time.monotonic() + stays_s
                    while time.monotonic() < until:
                        if kind == "polite":
                            client.receive(0.2)
                        else:
                            time.sleep(0.2)
            except Exception as error:  # the process is being stopped just now
                self._console.print(f"[dim]viewer: {error}[/]")
            time.sleep(rng.uniform(0.0, 10.0))

    # -- afterwards ------------------------------------------------------------------------------------

    def _report(self, path: Path, recorded_s: float) -> dict[str, Any]:
        self._console.print(f"recorded {recorded_s / 60:.1f} min; checking every sample of {path.name} …")
        verified = verify(path)
        marks = check_marked(path, self._rig, speed=self._speed)
        with open_run(path) as run:
            gaps = list(run.gaps)
            asleep = [event.sample for event in run.events if event.data.get("alarm") == "asleep"]
            verdict = run.derived.results.get("quality") if run.derived is not None else None
        times, sizes = np.array(self._memory).T
        late = times > min(120.0, 0.3 * times[-1])
        slope = float(np.polyfit(times[late], sizes[late], 1)[0]) * 3600.0 if late.sum() > 10 else 0.0
        health = self._health
        return {
            "minutes": recorded_s / 60.0,
            "seed": self._seed,
            "speed": self._speed,
            "channels": len(self._rig.channels),
            "samples": marks.n_samples,
            "gaps": len(gaps),
            "lost_samples": marks.missing,
            "unexplained_samples": marks.unexplained,
            "leaps": [asdict(leap) for leap in marks.leaps],
            "unexplained_gaps": unexplained_gaps(self._faults, gaps, asleep),
            "explained": marks.ok and unexplained_gaps(self._faults, gaps, asleep) == 0,
            "standstills": len(asleep),
            "verified": verified.ok,
            "problems": list(verified.problems),
            "verdict": (verdict or {}).get("verdict"),
            "lost_in_health": health.lost_samples if health is not None else None,
            "viewers": self._viewers,
            "faults": [asdict(fault) for fault in self._faults],
            "memory_mb": {
                "first": float(sizes[late][0]),
                "last": float(sizes[-1]),
                "most": float(sizes.max()),
            },
            "memory_mb_per_hour": slope,
            "memory_series_s_mb": [(round(at, 1), round(size, 1)) for at, size in self._memory],
            "gap_table": [asdict(gap) for gap in gaps],
        }


def _table(report: dict[str, Any]) -> Table:
    table = Table(title="Faults of the soak")
    for name in ("fault", "times", "first heard after, median", "most", "what was said first"):
        table.add_column(name)
    kinds = sorted({fault["kind"] for fault in report["faults"]})
    for kind in kinds:
        of_kind = [fault for fault in report["faults"] if fault["kind"] == kind]
        firsts = [fault["heard"][0] for fault in of_kind if fault["heard"]]
        delays = [heard[0] for heard in firsts]
        said = firsts[0][2][:70] if firsts else "nothing: nothing was lost"
        median = f"{np.median(delays):.2f} s" if delays else "–"
        table.add_row(kind, str(len(of_kind)), median, f"{max(delays):.2f} s" if delays else "–", said)
    return table


def _summary(report: dict[str, Any]) -> list[str]:
    memory = report["memory_mb"]
    return [
        f"{report['minutes']:.1f} min of {report['channels']} channels, {report['samples']} samples each, "
        f"{len(report['faults'])} faults, {report['viewers']} viewers, seed {report['seed']}",
        f"{report['lost_samples']} samples lost in {report['gaps']} gaps; unexplained: "
        f"{report['unexplained_samples']} samples, {report['unexplained_gaps']} gaps; "
        f"{report['standstills']} standstills of the machine",
        f"memory of the process {memory['first']:.0f} → {memory['last']:.0f} MB "
        f"({report['memory_mb_per_hour']:+.1f} MB/h), at most {memory['most']:.0f} MB",
        f"verified: {report['verified']}, every sample explained: {report['explained']}, "
        f"verdict of the run: {report['verdict']}",
    ]


def main() -> int:
    """0 if every sample is explained, the file verified, and the memory flat."""
    parser = command_line("soak", __doc__, speed=1.0)
    parser.add_argument("--minutes", type=float, default=30.0)
    options = parser.parse_args()
    terminal = console()
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        report = Soak(options.minutes, options.seed, options.speed, Path(name), terminal).run()
    write_report(options.json, report)
    terminal.print(_table(report))
    for line in _summary(report):
        terminal.print(line, soft_wrap=True)
    terminal.print(f"written to {options.json}")
    return 0 if report["explained"] and report["verified"] else 1


if __name__ == "__main__":
    sys.exit(main())
