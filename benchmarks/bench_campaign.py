"""A whole campaign through the commands: 36 simulated tests, and the report of their 36 run files."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.support.byte_code import surroundings
from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.runfile.digest import file_sha256

_ROOT = Path(__file__).parents[1]
_REPORTS = 3
_PLAN = _ROOT / "configs" / "campaigns" / "costa.toml"
_TWO_TESTS = f"""
name = "two tests"
[levels]
L1 = 0.15
[rigs]
FR1 = "{(_ROOT / "configs" / "fr1.toml").as_posix()}"
[[sequence]]
specimen = "FR1"
level = "L1"
tests = 2
"""
_SUMMANDS = 20_000_000


def figures(effort: Effort) -> list[Figure]:
    """Start of the program, all cores, every file of the report included; of the reports the median."""
    reports = effort.of(_REPORTS, 1)
    with tempfile.TemporaryDirectory() as name:
        runs, code = Path(name) / "runs", Path(name) / "code"
        plan = effort.of(_PLAN, Path(name) / "plan.toml")
        if effort.quick:
            plan.write_text(_TWO_TESTS, encoding="utf-8")
        simulated = _seconds("simulate", runs, code, "--plan", str(plan))
        size = sum(path.stat().st_size for path in runs.glob("*.h5")) / 1e6
        report = ("report", runs, code, "--plan", str(plan))
        reported = statistics.median(_seconds(*report) for _ in range(reports))
        anew = statistics.median(_seconds(*report, "--anew") for _ in range(reports))
        read = statistics.median(_read(runs) for _ in range(reports))
        count = len(list(runs.glob("*.h5")))
        assert (runs / "report" / "report.pdf").exists()
    cores = f"{os.cpu_count()} cores"
    return [
        Figure(
            "what all cores do at once",
            _all_cores_over_one(effort.of(_SUMMANDS, 100_000)),
            "× one core",
            note=f"the same arithmetic in one process and in {os.cpu_count()}; virtual cores may share one",
        ),
        Figure(f"campaign simulate, {count} tests", simulated, "s", note=f"{size:.0f} MB, {cores}"),
        Figure(
            f"campaign report of {count} runs",
            reported,
            "s",
            reports,
            aim=4,
            note=f"analyses kept beside the runs, HTML, PDF, CSV, {cores}, byte code there",
        ),
        Figure(
            f"reading {count} runs",
            read,
            "s",
            reports,
            note=f"SHA-256 of every byte, {cores}, files in memory: the floor of a report of kept analyses",
        ),
        Figure(
            f"campaign report of {count} runs, --anew",
            anew,
            "s",
            reports,
            aim=20,
            note=f"analysis with simulated bias as well, {cores}, byte code there",
        ),
    ]


_ARITHMETIC = """
import sys, time
started = time.perf_counter()
sum(i * i for i in range(int(sys.argv[1])))
print(time.perf_counter() - started)
"""


def _all_cores_over_one(summands: int) -> float:
    """How much more work all cores do than one: says what to expect of anything that runs on all."""

    def slowest(processes: int) -> float:
        running = [
            subprocess.Popen(
                [sys.executable, "-c", _ARITHMETIC, str(summands)], stdout=subprocess.PIPE, text=True
            )
            for _ in range(processes)
        ]
        return max(float(process.communicate()[0]) for process in running)

    count = os.cpu_count() or 1
    return count * slowest(1) / slowest(count)


def _read(runs: Path) -> float:
    """Every run's hash, on all cores as the report takes it."""
    started = time.perf_counter()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in pool.map(file_sha256, runs.glob("*.h5")):
            pass
    return time.perf_counter() - started


def _seconds(command: str, runs: Path, code: Path, *options: str) -> float:
    """Whole command, with byte code of every module kept in `code`."""
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "daq_app.cli", "campaign", command, str(runs), *options],
        check=True,
        capture_output=True,
        cwd=_ROOT,
        env=surroundings(code),
    )
    return time.perf_counter() - started
