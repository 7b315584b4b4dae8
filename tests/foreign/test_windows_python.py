"""A Windows Python under Wine runs a probe that needs the standard library alone, and a whole first test.

Where it is wanted: see docs/how-to/windows.md. WINDOWS_PYTHON names a python.exe, WINE the Wine that runs it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from daq_app.runfile import open_run, verify

PYTHON = os.environ.get("WINDOWS_PYTHON", "")
WINE = os.environ.get("WINE") or shutil.which("wine64") or "/usr/lib/wine/wine64"


@pytest.mark.skipif(not (PYTHON and Path(WINE).exists()), reason="no Windows Python under Wine here")
def test_files_held_open_and_guarded_children_on_windows(repository: Path, tmp_path: Path) -> None:
    arguments = [str(repository / "tests/foreign/windows_probe.py"), str(repository), str(tmp_path)]
    windows = [f"Z:{argument}".replace("/", "\\") for argument in arguments]
    done = subprocess.run(
        [WINE, PYTHON, *windows],
        input=b"",  # a pipe: the null device of Linux is no file to a Windows Python
        capture_output=True,
        env={**os.environ, "WINEDEBUG": "-all"},
        check=True,
    )
    assert json.loads(done.stdout) == {
        "other": "report (2).pdf",
        "refused": True,
        "child": ["False", "utf-8", "θ"],
        "ended": 0,
    }


def _windows(*arguments: str, folder: Path) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [WINE, PYTHON, *arguments],
        cwd=folder,
        input=b"",
        capture_output=True,
        env={**os.environ, "WINEDEBUG": "-all"},
        check=False,
    )


@pytest.mark.heavy
@pytest.mark.skipif(not (PYTHON and Path(WINE).exists()), reason="no Windows Python under Wine here")
def test_a_stranger_s_first_test_on_windows(tmp_path: Path) -> None:
    """The installed program: a simulated device, a test in real time, its analysis and the report."""
    if _windows("-c", "import daq_app, numba, h5py", folder=tmp_path).returncode:
        pytest.skip("the Windows Python does not load this program: see docs/how-to/windows.md")
    done = _windows("-m", "daq_app.cli", "demo", "--headless", "--tests", "1", folder=tmp_path)
    told = done.stdout.decode()
    assert done.returncode == 0, told + done.stderr.decode()
    assert "complete" in told and "Report: rocking-demo\\report\\report.html" in told
    (run,) = (tmp_path / "rocking-demo" / "runs").glob("*.h5")
    report = verify(run)
    assert report.ok, report.problems
    with open_run(run) as opened:
        assert opened.derived is not None
        assert opened.derived.results["quality"]["verdict"] == "good"
