"""A program that is installed without an extra says which one is missing, and does everything else."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from daq_app.extras import EXTRA_OF


def _daq_app(missing: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process in which a package is not installed."""
    script = f"import sys; sys.modules[{missing!r}] = None; sys.argv[0] = 'daq-app'\n"
    script += "from daq_app.cli import main; main()"
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, encoding="utf-8", check=False)


@pytest.mark.parametrize(
    ("package", "extra", "arguments"),
    [
        ("numba", "sim", ["gap", "effects"]),
        ("jinja2", "report", ["campaign", "report", "."]),
        ("pypdf", "report", ["campaign", "report", "."]),
        ("PySide6", "window", ["monitor", "--connect", "tcp://127.0.0.1:1"]),
    ],
)
def test_what_is_missing_is_named_with_the_command_that_installs_it(
    package: str, extra: str, arguments: list[str], tmp_path: Path
) -> None:
    done = _daq_app(package, *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"Error: this needs the package {package}")
    assert f"'rocking-test-recorder[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_every_extra_that_is_advised_exists_and_brings_the_package(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for package, extra in EXTRA_OF.items():
        brought = " ".join(project["optional-dependencies"][extra]).lower()
        assert package.lower() in brought
