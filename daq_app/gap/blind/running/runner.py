"""Diagnose all cases of a check, in processes that have only the files of the case at hand.

For each case a process gets a fresh folder with the run files and the rig file under a neutral name: no
seal, no label, no other case, and a working directory in it. What it says is kept with the hash of the
seal, so that a finished case is not done twice and a result never speaks of other data.
"""

from __future__ import annotations

import contextlib
import json
import queue
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from daq_app.gap.blind.layout import CASE_PREFIX, RESULTS, SEAL_FILE
from daq_app.gap.blind.running.apart import Apart
from daq_app.gap.blind.seal import check_files, read_seal
from daq_app.machines import RETRIES, scheduler_client
from daq_app.runfile.digest import file_sha256
from daq_app.runfile.durable import write_whole


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one diagnosis."""

    case: str
    diagnoser: str
    seal_sha256: str
    seconds: float
    result: dict[str, Any] | None
    """The diagnosis, or None where there was none."""
    failure: str = ""


def case_folders(folder: Path) -> list[Path]:
    """Sealed cases of a check, in their order."""
    return sorted(p.parent for p in folder.glob(f"{CASE_PREFIX}*/{SEAL_FILE}"))


def result_path(folder: Path, case: str, kept: str = RESULTS) -> Path:
    """Where the outcome of a case is kept: each way to diagnose has a folder `kept` of its own."""
    return folder / kept / f"{case}.json"


def pending(folder: Path, diagnoser: str, kept: str = RESULTS) -> list[Path]:
    """Cases without a result of this diagnoser for exactly this data."""
    todo = []
    for case in case_folders(folder):
        known = read_outcome(folder, case.name, kept)
        current = file_sha256(case / SEAL_FILE)
        if known is None or (known.diagnoser, known.seal_sha256) != (diagnoser, current):
            todo.append(case)
    return todo


def read_outcome(folder: Path, case: str, kept: str = RESULTS) -> Outcome | None:
    """The kept outcome of a case; None if there is none or it was cut off while being written."""
    try:
        return Outcome(**json.loads(result_path(folder, case, kept).read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError, TypeError):
        return None


def run_pending(
    folder: Path, diagnoser: str, workers: int, timeout_s: float, kept: str = RESULTS
) -> Iterator[Outcome]:
    """Diagnose what is pending, by `workers` processes; yields outcomes as they are saved."""
    todo = pending(folder, diagnoser, kept)
    free: queue.SimpleQueue[Apart] = queue.SimpleQueue()

    def diagnose(case: Path) -> Outcome:
        apart = free.get()
        try:
            return diagnose_apart(case, diagnoser, timeout_s, apart)
        finally:
            free.put(apart)

    with contextlib.ExitStack() as stack:
        for _ in range(max(1, min(workers, len(todo)))):
            free.put(stack.enter_context(Apart(diagnoser)))
        pool = stack.enter_context(ThreadPoolExecutor(max(1, workers)))
        jobs = [pool.submit(diagnose, case) for case in todo]
        try:
            for job in as_completed(jobs):
                outcome = job.result()
                save_outcome(folder, outcome, kept)
                yield outcome
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def save_outcome(folder: Path, outcome: Outcome, kept: str = RESULTS) -> None:
    """Keep an outcome; a name appears only with its whole content."""
    path = result_path(folder, outcome.case, kept)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(asdict(outcome), ensure_ascii=False))


def diagnose_apart(case: Path, diagnoser: str, timeout_s: float, apart: Apart | None = None) -> Outcome:
    """One case by a process of its own, or by `apart`, which goes on to the next one.

    Raises `SealBroken` if its files are not the sealed ones.
    """
    check_files(case, read_seal(case))
    with contextlib.ExitStack() as stack:
        process = apart or stack.enter_context(Apart(diagnoser))
        started = time.perf_counter()
        result, failure = process.diagnose(case, timeout_s)
        seconds = time.perf_counter() - started
    return Outcome(case.name, diagnoser, file_sha256(case / SEAL_FILE), seconds, result, failure)


def run_on_scheduler(
    folder: Path, diagnoser: str, address: str, timeout_s: float, kept: str = RESULTS
) -> Iterator[Outcome]:
    """As `run_pending`, on the workers of the scheduler at `address` (``tcp://HOST:PORT``).

    Every worker must see the folder under the same path and have this program installed. Outcomes
    come back to this process, which alone writes them. Raises `SchedulerMissing`.
    """
    with scheduler_client(address) as client:
        from distributed import as_completed

        cases = [case.resolve() for case in pending(folder, diagnoser, kept)]
        jobs = client.map(
            diagnose_apart, cases, diagnoser=diagnoser, timeout_s=timeout_s, pure=False, retries=RETRIES
        )
        for job in as_completed(jobs):
            outcome: Outcome = job.result()
            save_outcome(folder, outcome, kept)
            yield outcome
