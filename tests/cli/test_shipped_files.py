"""Rig files and campaigns that come with the program: found from any folder, copied to be edited."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.config import load_rig


def test_templates_are_copied_whole_and_never_over_a_file(tmp_path: Path, configs: Path) -> None:
    target = tmp_path / "configs"
    first = CliRunner().invoke(build_app(), ["config", "templates", str(target)])
    assert first.exit_code == 0, first.stderr
    assert load_rig(target / "fr1.toml") == load_rig(configs / "fr1.toml")
    assert (target / "campaigns" / "costa.toml").is_file()
    (target / "fr1.toml").write_text("mine", encoding="utf-8")
    (target / "fr2.toml").unlink()
    again = CliRunner().invoke(build_app(), ["config", "templates", str(target)])
    assert again.exit_code == 2
    assert "may have been edited" in again.stderr
    assert (target / "fr1.toml").read_text(encoding="utf-8") == "mine"
    assert not (target / "fr2.toml").exists(), "all or nothing"


def test_the_shipped_campaign_is_known_in_an_empty_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(build_app(), ["campaign", "plan"])
    assert said.exit_code == 0, said.stderr
    assert "FR1-L3-2" in said.stdout


def test_the_version_is_told() -> None:
    said = CliRunner().invoke(build_app(), ["--version"])
    assert (said.exit_code, said.stdout) == (0, "daq-app 0.1.0\n")
