"""A whole campaign through the commands: 36 simulated tests, and the report of their 36 run files."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.figure import Figure

_ROOT = Path(__file__).parents[1]


def figures() -> list[Figure]:
    """Once each: start of the program, all cores, every file of the report included."""
    with tempfile.TemporaryDirectory() as name:
        runs = Path(name) / "runs"
        simulated = _seconds("simulate", runs)
        size = sum(path.stat().st_size for path in runs.glob("*.h5")) / 1e6
        reported = _seconds("report", runs)
        count = len(list(runs.glob("*.h5")))
        assert (runs / "report" / "report.pdf").exists()
    cores = f"{os.cpu_count()} cores"
    return [
        Figure("campaign simulate, 36 tests", simulated, "s", note=f"{count} runs, {size:.0f} MB, {cores}"),
        Figure(
            "campaign report of 36 runs",
            reported,
            "s",
            aim=20,
            note=f"analysis with simulated bias, HTML, PDF, CSV, {cores}",
        ),
    ]


def _seconds(command: str, runs: Path) -> float:
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "daq_app.cli", "campaign", command, str(runs)],
        check=True,
        capture_output=True,
        cwd=_ROOT,
    )
    return time.perf_counter() - started
