"""Random orders and faults against a model of what must hold.

``python -m tests.support.recorder.order_storm 200`` runs as many sequences.

Each sequence is a wall that is pulled, held, released or lowered at random, a session that samples it, orders
in any order at any time, disks that fill up or fail for a while, and moments at which the folder is copied as
a kill would leave it. What must hold: no release unrecorded, no sample wrong or missing, no target that
differs from the armed plan, no two contradicting words, nothing that had been called safe lost in a kill.
"""

from __future__ import annotations

import errno
import math
import os
import re
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from daq_app.acquisition.closing.ring_recovery import recover_rings
from daq_app.acquisition.messages.items import RequestRefused
from daq_app.acquisition.messages.published import Command, State, StateMessage
from daq_app.acquisition.pipeline.reader import Patience
from daq_app.acquisition.session.requests import answer
from daq_app.acquisition.session.session import Session, SessionSettings
from daq_app.config import Rig, load_rig, plan_tasks
from daq_app.runfile import Run, open_run, recover
from daq_app.runfile.folder import find_runs
from tests.support.recorder.storm_parts import (
    RATE_HZ,
    BadDisk,
    Listener,
    QuickFinaliser,
    Wall,
    WallDriver,
    random_wall,
)

_ORDERS = ("tare", "check", "pull", "plan", "arm", "arm", "abort", "stop", "marker", "nonsense", "preview")
_FALLING = (800, 1600)
"""Samples after a release in which every wall falls, and has fallen fast enough to be seen."""
_TRIED_AGAIN_S = (1.5, 5.5)
"""A run, and the ring, try a disk again within so many seconds of the clock, 1 and 5, and write."""
_AROUND_RELEASE = (RATE_HZ, 2 * RATE_HZ)
"""Samples before and after a release that must be in a run."""


@dataclass
class Storm:
    """One sequence: everything that happens is drawn from `rng`."""

    rig: Rig
    rig_text: str
    folder: Path
    rng: np.random.Generator
    log: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    sick_until: int = 0
    """The newest sample that was read while the disk took nothing."""
    well_since_s: float = 0.0
    """When the disk had taken nothing for the last time, on the clock."""

    def run(self) -> list[str]:
        """What did not hold, in words; empty when everything did."""
        wall = random_wall(self.rig, self.rng, int(self.rng.integers(1, 3)))
        driver, listener, disk = WallDriver(wall), Listener(), BadDisk()
        settings = SessionSettings(
            self.rig,
            self.rig_text,
            plan_tasks(self.rig),
            self.folder,
            lambda: driver,  # type: ignore[arg-type, return-value]
            spare_folder=self._spare,
            patience=Patience(read_timeout_s=0.02, silence_limit_s=600.0),
        )
        kills: list[_Kill] = []
        with disk.in_place():
            session = Session(settings, listener, QuickFinaliser())  # type: ignore[arg-type]
            session.start()
            end = wall.readings.shape[1] // 400 * 400
            while driver.allowed < end:
                self._order(session)
                self._break(session, listener, disk)
                driver.allow(min(end, driver.allowed + int(self.rng.integers(1, 10)) * 400))
                listener.until(lambda: session.analyst.voice.sample >= driver.allowed - 400)
                if disk.trouble:
                    self.sick_until, self.well_since_s = driver.allowed, time.monotonic()
                session.tick()
                if self.rng.random() < 0.03 and not disk.trouble:
                    kills.append(self._kill(session, driver.allowed, len(kills)))
            disk.trouble = 0
            self._end(session, listener)
        self._check_runs(wall, [*self._runs_in(self.folder), *self._runs_in(self._spare)])
        self._check_words(listener.states, wall)
        for kill in kills:
            self._check_kill(wall, kill)
        return self.broken

    # -- what happens ----------------------------------------------------------------------------

    def _order(self, session: Session) -> None:
        if self.rng.random() > 0.35:
            return
        name = str(self.rng.choice(_ORDERS))
        arguments: dict[str, float | str] = {}
        if name in ("plan", "arm"):
            level = int(self.rng.integers(1, 5))
            arguments = {"test": f"FR1-L{level}-{int(self.rng.integers(1, 9))}", "overrule": 1.0}
            arguments["theta0_over_alpha"] = {1: 0.15, 2: 0.25, 3: 0.35, 4: 0.40}[level]
        self.log.append(f"{session.recorder.status.sample}: {name} {arguments.get('test', '')}")
        with suppress(RequestRefused):
            answer(session, Command(name=name, arguments=arguments))

    def _break(self, session: Session, listener: Listener, disk: BadDisk) -> None:
        if self.rng.random() < 0.04:
            disk.trouble = int(self.rng.choice([0, errno.ENOSPC, errno.EIO]))
            self.log.append(f"disk: {disk.trouble}")
        elif disk.trouble and self.rng.random() < 0.3:
            disk.trouble = 0
            self.log.append("disk: well")
            if session.recorder.status.recording and self.rng.random() < 0.5:
                # The seconds of the clock in which the recorder tries again: what had waited is safe then.
                listener.until(lambda: self._has_caught_up(session))
                self.well_since_s = -math.inf

    def _has_caught_up(self, session: Session) -> bool:
        status = session.recorder.status
        return not status.recording or status.acknowledged_sample >= self.sick_until - 400

    def _kill(self, session: Session, sample: int, number: int) -> _Kill:
        """The folder as kill −9 would leave it now, what had been called safe, and the newest sample."""
        status = session.recorder.status
        well_s = time.monotonic() - self.well_since_s
        if well_s < _TRIED_AGAIN_S[not status.recording]:
            self.sick_until = sample
        safe = status.acknowledged_sample if status.recording else 0
        copy = self.folder.with_name(f"{self.folder.name}-kill{number}")
        finished = _copy_as_it_stands(self.folder, copy)
        self.log.append(f"{sample}: killed (copy {number}), safe up to {safe}")
        return _Kill(copy, finished, safe, sample, self.sick_until)

    @staticmethod
    def _end(session: Session, listener: Listener) -> None:
        """Stop what is recorded, but let a run that is just begun know its wall first."""
        moved = (State.HOLDING, State.RELEASED, State.ROCKING, State.AT_REST)

        def settled() -> bool:
            session.tick()
            return not session.recording or session.analyst.state in (State.ARMED, *moved)

        listener.until(settled)
        if session.recording:
            session.ask("stop", {})
        session.close()

    # -- what must hold --------------------------------------------------------------------------

    @property
    def _spare(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}-spare")

    @staticmethod
    def _runs_in(folder: Path) -> list[Path]:
        """All runs of a folder; what no disk took as a run file is recovered, as the next start does."""
        if not folder.is_dir():
            return []
        recover(folder)
        return find_runs(folder)

    def _check_runs(self, wall: Wall, paths: list[Path]) -> None:
        spans = []
        for path in paths:
            with open_run(path) as run:
                spans.append((run.first_sample, run.first_sample + run.n_samples))
                self._check_samples(wall, run, path)
        spans.sort()
        for release in wall.releases:
            low, high = release - _AROUND_RELEASE[0], release + _AROUND_RELEASE[1]
            high = min(high, wall.readings.shape[1] // 400 * 400)
            # Stopped by the operator in mid-motion: what came until then is what there is to keep.
            least = release + 1 if self._stopped() else high
            joined = max(0, low)
            for first, end in spans:
                joined = max(joined, end) if first <= joined else joined
            together = any(first < release and end >= least for first, end in spans)
            if not together or joined < least:
                self.broken.append(f"the release at {release} is in no run; runs: {spans}")

    def _stopped(self) -> bool:
        return any(re.search(r": (stop|abort) ", line) for line in self.log)

    def _check_samples(self, wall: Wall, run: Run, path: Path) -> None:
        if run.gaps:
            self.broken.append(f"{path.name}: samples are missing: {run.gaps[:2]}")
        first, end = run.first_sample, run.first_sample + run.n_samples
        if not np.array_equal(run.readings(), wall.readings[:, first:end]):
            self.broken.append(f"{path.name}: readings differ from what was measured")

    def _check_words(self, states: list[StateMessage], wall: Wall) -> None:
        armed_plan, before = None, State.IDLE
        for message in states:
            judgement = message.judgement
            said = f"{judgement.word} {judgement.do} {judgement.gauge} {judgement.alarm}".lower()
            if message.judgement.target != message.plan.theta0_over_alpha:
                self.broken.append(f"target {judgement.target} is not the plan's: {message}")
            if before is State.AT_REST and message.state is State.ARMED:
                armed_plan = None  # one test ended and the next was armed between two messages
            before = message.state
            if message.armed:
                armed_plan = armed_plan or message.plan
                if message.plan != armed_plan:
                    self.broken.append(f"the plan changed while armed: {armed_plan} → {message.plan}")
            else:
                armed_plan = None
                if re.search(r"on target|held still on target", said):
                    self.broken.append(f"told to hold while nobody had armed: {said}")
            if message.state in (State.RELEASED, State.ROCKING) and re.search(r"\b(pull|ease|hold)\b", said):
                self.broken.append(f"told to pull a wall that moves: {said}")
            falls = any(_FALLING[0] <= message.sample - release <= _FALLING[1] for release in wall.releases)
            if falls and "mrad more" in said:
                self.broken.append(f"told to pull a wall that falls: {said}")
            if "stop:" in said and re.search(r"\b(pull|on target)\b", said):
                self.broken.append(f"contradicting words: {said}")

    def _check_kill(self, wall: Wall, kill: _Kill) -> None:
        copy, safe, sample = kill.copy, kill.safe, kill.sample
        recover_rings(copy)
        recover(copy)
        ends = [0]
        spans = []
        for path in (*find_runs(copy), *kill.finished):
            with open_run(path) as run:
                self._check_samples(wall, run, path)
                ends.append(run.first_sample + run.n_samples)
                spans.append((run.first_sample, run.first_sample + run.n_samples))
        if safe > max(ends):
            self.broken.append(f"{copy.name}: safe up to {safe}, recovered up to {max(ends)}")
        # A release that lies a second back had been noticed: the kill must not cost it, if there was a disk
        # that took it, and the clock had gone on long enough for the recorder to try that disk again.
        for release in wall.releases:
            known = kill.sick_until <= release and release + RATE_HZ < sample <= release + 2 * RATE_HZ
            if known and not any(first <= release - 400 and end > release for first, end in spans):
                self.broken.append(
                    f"{copy.name}: killed at {sample}, the release at {release} is lost: {spans}"
                )


@dataclass(frozen=True)
class _Kill:
    """A moment at which the recorder might have been killed, and what was on disk then."""

    copy: Path
    """All but the run files, which the rest of the sequence leaves as they are."""
    finished: tuple[Path, ...]
    safe: int
    """Samples that had been called safe."""
    sample: int
    """The newest one that had been read."""
    sick_until: int
    """The newest one before which the disk had taken nothing for a while."""


def _copy_as_it_stands(folder: Path, copy: Path) -> tuple[Path, ...]:
    """Copy all but the run files as they are at one moment; the run files of that moment.

    A kill leaves one moment. A copy takes several, in which the ring may become the journal of a run and a
    journal a run file, and hold neither: it is made again until no file has come or gone meanwhile.
    """
    while True:
        before = _names(folder)
        with suppress(shutil.Error):  # a file that went meanwhile
            shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("*.h5*"))
        if _names(folder) == before:
            return tuple(find_runs(folder))
        shutil.rmtree(copy)


def _names(folder: Path) -> set[Path]:
    # Unlike `rglob` it takes a folder that goes while it looks for an empty one.
    return {Path(parent, name) for parent, folders, files in os.walk(folder) for name in (*folders, *files)}


def storm_once(rig_file: Path, folder: Path, seed: int) -> tuple[list[str], list[str]]:
    """(what did not hold, what happened) of the sequence of a seed."""
    rig = load_rig(rig_file)
    quick = rig.acquisition.model_copy(update={"post_rest_s": 0.5, "max_duration_s": 20.0})
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    text = rig_file.read_text(encoding="utf-8")
    storm = Storm(rig.model_copy(update={"acquisition": quick}), text, folder, rng)
    return storm.run(), storm.log


def main(argv: list[str]) -> int:
    """Run so many sequences; 1 if something did not hold."""
    count, start = int(argv[0]) if argv else 200, int(argv[1]) if len(argv) > 1 else 0
    bad = 0
    began = time.monotonic()
    for seed in range(start, start + count):
        with tempfile.TemporaryDirectory() as place:
            broken, log = storm_once(Path("configs/fr1.toml"), Path(place) / "runs", seed)
        if "-v" in argv:
            print(f"{seed}: {len(log)} orders and faults, {time.monotonic() - began:.0f} s", flush=True)
        if broken:
            bad += 1
            print(f"sequence {seed}:", *broken[:4], *log, sep="\n  ", flush=True)
    print(f"{count} sequences in {time.monotonic() - began:.0f} s, {bad} of them broke a rule")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
