"""The README's first command, word for word (without the installation in front of it)."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from daq_app.runfile import open_run, verify


def readme_command(repository: Path, marker: str) -> list[str]:
    """Words of the command below ``<!-- marker -->``, from the program's name on."""
    text = (repository / "README.md").read_text(encoding="utf-8")
    match = re.search(rf"<!-- {marker} -->\s*```\n(?P<line>.+)\n```", text)
    assert match, f"README.md has no command marked {marker}"
    return shlex.split(match["line"].split("uv run ")[1])


def daq_app(*arguments: str, cwd: Path, timeout_s: float = 500.0) -> subprocess.CompletedProcess[str]:
    """Run the installed console script as a user does."""
    script = Path(sys.executable).with_name("daq-app")
    return subprocess.run(
        [str(script), *arguments], cwd=cwd, capture_output=True, text=True, timeout=timeout_s, check=False
    )


@pytest.mark.heavy
def test_first_command_records_a_whole_test_and_prints_r(repository: Path, tmp_path: Path) -> None:
    program, *arguments = readme_command(repository, "run")
    assert program == "daq-app"
    arguments[arguments.index("--out") + 1] = str(tmp_path / "runs")
    done = daq_app(*arguments, "--json", cwd=repository)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    (path,) = (tmp_path / "runs").glob("*.h5")
    assert verify(path).ok
    with open_run(path) as run:
        assert run.header.test == "FR1-L3-2"
        assert len(run.channel_ids) == 41
        assert run.gaps == ()
        assert run.rate_hz == 4000.0
        rig = run.rig
    assert rig is not None
    true_r = rig.simulation.restitution
    assert result["lost_samples"] == 0
    for estimate in result["results"]["r"].values():
        assert estimate["r"] == pytest.approx(true_r, abs=0.003)
        assert estimate["online"] == pytest.approx(true_r, abs=0.003)


def test_second_command_is_the_one_that_runs_these_tests(repository: Path) -> None:
    suite = ["pytest", "-n", "3", "--dist", "worksteal", "-m", "not heavy"]
    assert readme_command(repository, "tests") == suite
    assert "${command/not heavy/heavy}" in (repository / ".ci" / "run").read_text(encoding="utf-8")
