"""Output never decides over a recording: a full disk behind it, a reader that leaves, any code page."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from daq_app.runfile import open_run, verify

pytestmark = [
    pytest.mark.heavy,
    pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full"),
]


def _run(configs: Path, folder: Path, **streams: object) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", "from daq_app.cli import main; main()", "run", str(configs / "fr1.toml")]
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    options = ["--test", "FR1-L1-1", "--headless", "--speed", "max", "--out", str(folder)]
    return subprocess.Popen([*command, *options], env=environment, stderr=subprocess.DEVNULL, **streams)


def _assert_whole(folder: Path) -> None:
    (path,) = folder.glob("*.h5")
    assert verify(path).ok
    with open_run(path) as run:
        assert run.header.test == "FR1-L1-1"
    assert not list(folder.glob("*.journal"))


def test_a_full_disk_behind_the_output_costs_no_sample(configs: Path, tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        assert _run(configs, tmp_path, stdout=full).wait() == 0
    _assert_whole(tmp_path)


def test_a_reader_that_leaves_costs_no_sample(configs: Path, tmp_path: Path) -> None:
    process = _run(configs, tmp_path, stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait() == 0
    _assert_whole(tmp_path)
