"""The commands of the page on one's own wall, as they stand there, on walls of other sizes."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from daq_app.runfile import open_run

_OTHER_WALL = {
    "--height 2.4": "--height 1.1",
    "--thickness 0.5": "--thickness 0.3",
    "--length 1.6": "--length 0.7",
}


def _commands(repository: Path) -> list[list[str]]:
    """[commands of the small wall, command of the large one], as on the page."""
    text = (repository / "docs/tutorial/own-wall.md").read_text(encoding="utf-8")
    return [block.strip().splitlines() for block in re.findall(r"```\n(.*?)```", text, flags=re.DOTALL)]


def _run(line: str, folder: Path) -> str:
    program, *arguments = shlex.split(line)
    assert program == "daq-app"
    command = [sys.executable, "-c", "from daq_app.cli import main; main()", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


def _fast(line: str) -> str:
    """The same command with the simulated clock as fast as it goes."""
    return f"{line} --speed max" if line.startswith("daq-app run") else line


@pytest.mark.heavy
def test_a_wall_with_three_sensors_goes_from_nothing_to_a_report_in_less_than_ten_commands(
    repository: Path, tmp_path: Path
) -> None:
    lines = _commands(repository)[0]
    assert len(lines) < 10
    for line in lines:
        for old, new in _OTHER_WALL.items():
            line = line.replace(old, new)
        _run(_fast(line), tmp_path)
    runs = sorted((tmp_path / "runs").glob("*.h5"))
    assert len(runs) == 2
    with open_run(runs[0]) as run:
        assert len(run.header.channel_ids) == 3
    assert (tmp_path / "report" / "report.html").is_file()


@pytest.mark.heavy
def test_a_wall_with_64_sensors_on_modules_of_different_rates_does_the_same(
    repository: Path, tmp_path: Path
) -> None:
    small, (large,), *_ = _commands(repository)
    _run(large, tmp_path)
    for line in small[1:3] + small[4:]:
        said = _run(_fast(line).replace("w1", "w64"), tmp_path)
        if "check" in line:
            assert "4166.67" in said
    (path,) = (tmp_path / "runs").glob("*.h5")
    with open_run(path) as run:
        assert len(run.header.channel_ids) == 64
