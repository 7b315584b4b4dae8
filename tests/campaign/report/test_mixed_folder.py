"""A folder in which not every file is a whole run of a test: the report says which are not in it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app


@pytest.mark.heavy
def test_the_report_names_lost_tests_and_files_that_are_no_tests(tmp_path: Path, simulated_run: Path) -> None:
    shutil.copy(simulated_run, tmp_path / "FR1-L1-1.h5")
    (tmp_path / "FR1-L1-2.h5").write_bytes(simulated_run.read_bytes()[:3_000_000])
    (tmp_path / "warm-up.h5").write_bytes(b"")
    words = ["campaign", "report", str(tmp_path), "--workers", "1", "--bias-runs", "0"]
    done = CliRunner().invoke(build_app(), words)

    assert done.exit_code == 0, done.output
    said = " ".join(done.stderr.split())
    assert "Lost: FR1-L1-2:" in said and "is cut short or damaged" in said
    assert "Not in the report: warm-up.h5: no release of a named test" in said
    assert "FR1-L1-1.h5" not in said
