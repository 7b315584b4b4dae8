"""A whole campaign through the commands: 36 simulated tests, and the report of their 36 run files."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.support.byte_code import surroundings
from benchmarks.support.figure import Figure

_ROOT = Path(__file__).parents[1]
_REPORTS = 3


def figures() -> list[Figure]:
    """Start of the program, all cores, every file of the report included; of the reports the median."""
    with tempfile.TemporaryDirectory() as name:
        runs, code = Path(name) / "runs", Path(name) / "code"
        simulated = _seconds("simulate", runs, code)
        size = sum(path.stat().st_size for path in runs.glob("*.h5")) / 1e6
        reported = statistics.median(_seconds("report", runs, code) for _ in range(_REPORTS))
        anew = statistics.median(_seconds("report", runs, code, "--anew") for _ in range(_REPORTS))
        count = len(list(runs.glob("*.h5")))
        assert (runs / "report" / "report.pdf").exists()
    cores = f"{os.cpu_count()} cores"
    return [
        Figure(
            "what all cores do at once",
            _all_cores_over_one(),
            "× one core",
            note=f"the same arithmetic in one process and in {os.cpu_count()}; virtual cores may share one",
        ),
        Figure("campaign simulate, 36 tests", simulated, "s", note=f"{count} runs, {size:.0f} MB, {cores}"),
        Figure(
            "campaign report of 36 runs",
            reported,
            "s",
            _REPORTS,
            aim=4,
            note=f"analyses kept beside the runs, HTML, PDF, CSV, {cores}, byte code there",
        ),
        Figure(
            "campaign report of 36 runs, --anew",
            anew,
            "s",
            _REPORTS,
            aim=20,
            note=f"analysis with simulated bias as well, {cores}, byte code there",
        ),
    ]


_ARITHMETIC = """
import time
started = time.perf_counter()
sum(i * i for i in range(20_000_000))
print(time.perf_counter() - started)
"""


def _all_cores_over_one() -> float:
    """How much more work all cores do than one: says what to expect of anything that runs on all."""

    def slowest(processes: int) -> float:
        running = [
            subprocess.Popen([sys.executable, "-c", _ARITHMETIC], stdout=subprocess.PIPE, text=True)
            for _ in range(processes)
        ]
        return max(float(process.communicate()[0]) for process in running)

    count = os.cpu_count() or 1
    return count * slowest(1) / slowest(count)


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
