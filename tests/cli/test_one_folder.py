"""The folder with the program and its Python: built by its script, moved, used with nothing else at hand."""

from __future__ import annotations

import configparser
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.heavy,
    pytest.mark.skipif(not (os.environ.get("UV") or shutil.which("uv")), reason="needs uv, which builds it"),
    pytest.mark.skipif(sys.platform == "win32", reason="the starters of Windows are other ones, not tried"),
]


def make_folder(*words: str | Path) -> subprocess.CompletedProcess[str]:
    script = Path(__file__).parents[2] / ".ci" / "make_folder.py"
    command = [sys.executable, str(script), *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made at one place and moved to another, whose name has a space."""
    made = tmp_path_factory.mktemp("made") / "recorder"
    done = make_folder(made, "--extras", "sim")
    assert done.returncode == 0, done.stderr
    moved = tmp_path_factory.mktemp("moved") / "the recorder"
    shutil.move(made, moved)
    return moved


def run(program: Path, *words: str, home: Path) -> subprocess.CompletedProcess[str]:
    """In an environment that names no Python and an empty home folder, which is the working folder too."""
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(home), "LANG": "C.UTF-8"}
    return subprocess.run(
        [str(program), *words], cwd=home, env=environment, capture_output=True, text=True, check=False
    )


def test_the_program_runs_from_where_it_was_moved_to(folder: Path, tmp_path: Path) -> None:
    # A file that would stand in for a module if the working folder came first.
    (tmp_path / "typing.py").write_text("raise SystemExit('the wrong typing')\n", encoding="utf-8")
    version = run(folder / "daq-app", "--version", home=tmp_path)
    assert version.returncode == 0 and version.stdout.strip(), version.stderr
    assert run(folder / "daq-app", "config", "templates", "rigs", home=tmp_path).returncode == 0
    checked = run(folder / "daq-app", "config", "check", "rigs/fr1.toml", home=tmp_path)
    assert checked.returncode == 0, checked.stderr
    simulated = run(
        folder / "daq-app", "simulate", "rigs/fr1.toml", "--level", "L1", "--out", "r.h5", home=tmp_path
    )
    assert simulated.returncode == 0, simulated.stderr
    assert run(folder / "daq-app", "verify", "r.h5", home=tmp_path).returncode == 0


def test_the_shortcut_starts_the_program_of_this_folder(folder: Path, tmp_path: Path) -> None:
    added = run(folder / "add-shortcut", home=tmp_path)
    assert added.returncode == 0, added.stderr
    entry = configparser.ConfigParser(interpolation=None)
    entry.read(Path(added.stdout.splitlines()[0]), encoding="utf-8")
    command = Path(entry["Desktop Entry"]["Exec"].strip('"'))
    assert command == folder / "daq-app"
    assert run(command, "--version", home=tmp_path).returncode == 0


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("mine", encoding="utf-8")
    done = make_folder(tmp_path)
    assert done.returncode == 2
    assert "Name another folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
