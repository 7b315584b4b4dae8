"""Every benchmark starts and measures something: `python -m benchmarks NAME --quick`."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]
NAMES = sorted(path.stem.removeprefix("bench_") for path in (REPOSITORY / "benchmarks").glob("bench_*.py"))
HEAVY = frozenset({"acquisition", "campaign", "gap", "jobs", "monitor", "start"})
WINDOW = frozenset({"monitor", "start"})
try:
    import PySide6.QtWidgets  # noqa: F401 - can Qt start here?

    QT_STARTS = True
except ImportError:
    QT_STARTS = False


def _measured(name: str, folder: Path) -> list[dict[str, Any]]:
    figures = folder / "figures.json"
    subprocess.run(
        [sys.executable, "-m", "benchmarks", name, "--quick", "--json", str(figures)],
        check=True,
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
    )
    return list(json.loads(figures.read_text(encoding="utf-8"))["benchmarks"][name]["figures"])


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.heavy] if name in HEAVY else []) for name in NAMES]
)
def test_a_quick_run_measures_every_figure(name: str, tmp_path: Path) -> None:
    if name in WINDOW and not QT_STARTS:
        pytest.skip("Qt cannot start here: tests/monitor says what it needs")
    figures = _measured(name, tmp_path)
    assert figures
    assert [figure["name"] for figure in figures if not math.isfinite(figure["value"])] == []
    assert any(figure["value"] > 0.0 for figure in figures)


def test_figures_of_a_quick_run_do_not_reach_the_kept_ones(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "benchmarks", "bare_loop", "--quick"]
    refused = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    assert "--quick takes a --json of its own" in refused.stderr
