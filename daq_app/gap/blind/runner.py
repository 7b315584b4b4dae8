"""Diagnose all cases of a check, each in a process of its own that has only the case's files.

The process gets a fresh folder with the run files and the rig file under a neutral name: no seal, no
label, no other case, and a working directory in it. What it says is kept with the hash of the seal, so
that a finished case is not done twice and a result never speaks of other data.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import psutil

from daq_app.gap.blind.layout import CASE_PREFIX, RESULTS, SEAL_FILE
from daq_app.gap.blind.seal import check_files, file_sha256, read_seal

_WORDS_KEPT: Final = 4000


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


def result_path(folder: Path, case: str) -> Path:
    return folder / RESULTS / f"{case}.json"


def pending(folder: Path, diagnoser: str) -> list[Path]:
    """Cases without a result of this diagnoser for exactly this data."""
    todo = []
    for case in case_folders(folder):
        known = read_outcome(folder, case.name)
        current = file_sha256(case / SEAL_FILE)
        if known is None or (known.diagnoser, known.seal_sha256) != (diagnoser, current):
            todo.append(case)
    return todo


def read_outcome(folder: Path, case: str) -> Outcome | None:
    """The kept outcome of a case; None if there is none or it was cut off while being written."""
    try:
        return Outcome(**json.loads(result_path(folder, case).read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError, TypeError):
        return None


def run_pending(folder: Path, diagnoser: str, workers: int, timeout_s: float) -> Iterator[Outcome]:
    """Diagnose what is pending, `workers` at a time; yields outcomes as they are saved."""
    with ThreadPoolExecutor(max(1, workers)) as pool:
        jobs = [
            pool.submit(diagnose_apart, case, diagnoser, timeout_s) for case in pending(folder, diagnoser)
        ]
        try:
            for job in as_completed(jobs):
                outcome = job.result()
                save_outcome(folder, outcome)
                yield outcome
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def save_outcome(folder: Path, outcome: Outcome) -> None:
    """Keep an outcome; a name appears only with its whole content."""
    path = result_path(folder, outcome.case)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(asdict(outcome), ensure_ascii=False), encoding="utf-8")
    temporary.replace(path)


def diagnose_apart(case: Path, diagnoser: str, timeout_s: float) -> Outcome:
    """One case in a process of its own. Raises `SealBroken` if its files are not the sealed ones."""
    check_files(case, read_seal(case))
    started = time.perf_counter()
    result: dict[str, Any] | None = None
    with tempfile.TemporaryDirectory(prefix="blind-") as place:
        bare = Path(place) / "case"
        bare.mkdir()
        for path in case.iterdir():
            if path.is_file() and path.name != SEAL_FILE:
                shutil.copyfile(path, bare / path.name)
        out = Path(place) / "out.json"
        command = [sys.executable, "-m", "daq_app.gap.blind.child", diagnoser, str(bare), str(out)]
        failure = _run(command, place, timeout_s)
        if not failure:
            result, failure = _read_result(out)
    seconds = time.perf_counter() - started
    return Outcome(case.name, diagnoser, file_sha256(case / SEAL_FILE), seconds, result, failure)


def _run(command: list[str], place: str, timeout_s: float) -> str:
    """Run to the end; empty, or why it failed. What the process started itself ends with it."""
    words = Path(place) / "words.txt"
    with words.open("w", encoding="utf-8") as stderr:
        process = psutil.Popen(
            command, cwd=place, env=_environment(), stdout=subprocess.DEVNULL, stderr=stderr
        )
        try:
            code = process.wait(timeout_s)
        except psutil.TimeoutExpired:
            return f"stopped after {timeout_s:g} s"
        finally:
            _end_tree(process)
    told = words.read_text(encoding="utf-8", errors="replace")[-_WORDS_KEPT:].strip()
    return "" if code == 0 else f"ended with {code}: {told}"


def _end_tree(process: psutil.Popen) -> None:
    """End a process and all that it started."""
    try:
        family = [*process.children(recursive=True), process]
    except psutil.NoSuchProcess:
        return
    for member in family:
        with contextlib.suppress(psutil.NoSuchProcess):
            member.kill()
    psutil.wait_procs(family, timeout=10)


def _read_result(out: Path) -> tuple[dict[str, Any] | None, str]:
    try:
        result = json.loads(out.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        return None, f"no result: {error}"
    return (result, "") if isinstance(result, dict) else (None, "the result is no JSON object")


def _environment() -> dict[str, str]:
    """One thread for each process (the cases fill the cores), the import path of this one."""
    environment = dict(os.environ)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        environment[name] = "1"
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    return environment
