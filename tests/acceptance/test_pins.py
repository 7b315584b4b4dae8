"""The two places that pin versions agree, and nothing committed names a registry."""

from __future__ import annotations

import tomllib
from pathlib import Path


def test_constraints_file_and_project_pin_the_same_versions(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))
    lines = (repository / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert project["tool"]["uv"]["constraint-dependencies"] == pins
    assert any(pin.startswith("nidaqmx==1.7.0") for pin in pins)


def test_pyside_stays_below_the_version_that_aborts(repository: Path) -> None:
    lines = (repository / "constraints.txt").read_text(encoding="utf-8").splitlines()
    (pin,) = [line for line in lines if line.startswith("pyside6-essentials==")]
    major, minor = (int(part) for part in pin.split(" ")[0].split("==")[1].split(".")[:2])
    assert (major, minor) < (6, 12)
