"""`daq-app config` as a person runs it: a process, its output, its exit code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest


def daq_app(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from daq_app.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONIOENCODING": "utf-8", "COLUMNS": "100", **environment},
        timeout=60,
        check=False,
    )


@pytest.fixture
def spoilt(tmp_path: Path, configs: Path) -> Path:
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    path = tmp_path / "spoilt.toml"
    path.write_text(
        text.replace("polarity = -1", "polarty = -1").replace("slot = 4", "slot = 3"), encoding="utf-8"
    )
    return path


def test_check_says_good_and_warns(configs: Path) -> None:
    done = daq_app("config", "check", configs / "fr1.toml", configs / "fr1-iepe.toml")
    assert done.returncode == 0
    assert "fr1.toml: good. 41 channels in 1 task(s) at 4000.00 Hz" in done.stdout
    assert "Warning: " in done.stderr
    assert "4266.67 Hz for all 41 channels" in done.stderr


def test_check_lists_every_problem_without_a_traceback(spoilt: Path, configs: Path) -> None:
    done = daq_app("config", "check", spoilt, configs / "fr2.toml")
    assert done.returncode == 2
    assert "fr2.toml: good" in done.stdout
    assert "Did you mean `polarity`?" in done.stderr
    assert "slot 3 holds two modules" in done.stderr
    assert "Traceback" not in done.stderr


def test_check_as_json(spoilt: Path, configs: Path) -> None:
    done = daq_app("config", "check", "--json", configs / "fr1-pxie.toml", spoilt)
    assert done.returncode == 2
    good, bad = map(json.loads, done.stdout.splitlines())
    assert good["good"] is True
    assert good["rate_hz"] == 4000.0
    assert [len(task["channels"]) for task in good["tasks"]] == [24, 17]
    assert bad["good"] is False
    assert any(problem["key"].endswith("polarty") for problem in bad["problems"])


def test_check_of_what_is_no_rig_file(tmp_path: Path) -> None:
    done = daq_app("config", "check", tmp_path, tmp_path / "none.toml")
    assert done.returncode == 2
    assert "is a folder" in done.stderr
    assert "does not exist" in done.stderr


@pytest.mark.parametrize("width", ["60", "100", "200"])
def test_show_prints_every_sensor_whatever_the_width(configs: Path, width: str) -> None:
    done = daq_app("config", "show", configs / "fr1-pxie.toml", COLUMNS=width)
    assert done.returncode == 0
    for word in ("LV-A01", "WP-5", "AC-8", "TL-2Y", "PXIe-6345", "master", "slave", "192.0"):
        assert word in done.stdout
    assert "…" not in done.stdout.split("Notes")[0]


def test_show_refuses_a_bad_file(spoilt: Path) -> None:
    done = daq_app("config", "show", spoilt)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "Did you mean `polarity`?" in done.stderr


@pytest.mark.parametrize("command", ["check", "show"])
def test_help_has_an_example(command: str) -> None:
    assert "Example: daq-app config" in daq_app("config", command, "--help").stdout
