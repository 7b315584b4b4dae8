"""Output never decides over a recording: a full disk behind it, a reader that leaves, any code page."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from daq_app.runfile import open_run, verify

pytestmark = [
    pytest.mark.heavy,
    pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full"),
]


_MAIN = [sys.executable, "-c", "from daq_app.cli import main; main()"]


def _new_rig(path: Path, wires: int) -> Path:
    """A small wall with few sensors, on which a whole test takes little."""
    size = ["--height", "1.1", "--thickness", "0.3", "--length", "0.7"]
    sensors = ["--lvdts", "2", "--wires", str(wires), "--accelerometers", "0", "--tiltmeters", "0"]
    subprocess.run([*_MAIN, "rig", "new", str(path), *size, *sensors], check=True, capture_output=True)
    return path


@pytest.fixture(scope="module")
def small_rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _new_rig(tmp_path_factory.mktemp("rig") / "small.toml", wires=1)


def _run(rig: Path, folder: Path, **streams: Any) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    options = ["--test", "small-L1-1", "--headless", "--speed", "max", "--out", str(folder)]
    streams = {"stderr": subprocess.DEVNULL, **streams}
    return subprocess.Popen([*_MAIN, "run", str(rig), *options], env=environment, **streams)


def _assert_whole(folder: Path) -> None:
    (path,) = folder.glob("*.h5")
    assert verify(path).ok
    with open_run(path) as run:
        assert run.header.test == "small-L1-1"
    assert not list(folder.glob("*.journal"))


def test_a_full_disk_behind_the_output_costs_no_sample(small_rig: Path, tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        assert _run(small_rig, tmp_path, stdout=full).wait() == 0
    _assert_whole(tmp_path)


def test_a_reader_that_leaves_costs_no_sample(small_rig: Path, tmp_path: Path) -> None:
    process = _run(small_rig, tmp_path, stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait() == 0
    _assert_whole(tmp_path)


def test_a_rig_without_wires_is_not_recorded_where_nobody_would_see_the_end(tmp_path: Path) -> None:
    rig, folder = _new_rig(tmp_path / "blind.toml", wires=0), tmp_path / "runs"
    process = _run(rig, folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    _, said = process.communicate()
    assert process.returncode == 2
    assert b"no wire potentiometer" in said
    assert b"F7" in said
    assert not folder.exists() or not list(folder.iterdir())
