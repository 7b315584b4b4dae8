"""A test day with nothing configured, in an empty folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from daq_app import extras
from daq_app.cli import main
from daq_app.runfile import open_run


@pytest.mark.heavy
def test_a_test_day_plays_in_an_empty_folder_goes_on_and_ends_with_a_report(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from daq_app.cli import main; main()", "demo"]
    for tests in ("2", "1"):
        options = ["day", "--headless", "--tests", tests, "--speed", "max"]
        done = subprocess.run(
            [*command, *options], cwd=tmp_path, capture_output=True, encoding="utf-8", check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    runs = sorted((tmp_path / "day" / "runs").glob("*.h5"))
    taken = []
    for path in runs:
        with open_run(path) as run:
            taken.append(run.header.test)
    assert taken == ["FR1-L1-1", "FR1-L1-2", "FR1-L1-3"]
    assert (tmp_path / "day" / "report" / "report.html").is_file()
    assert "3 kept beside their runs" in done.stdout
    assert "daq-app view" in done.stdout


@pytest.mark.parametrize(("package", "extra"), [("numba", "sim"), ("PySide6", "window")])
def test_a_day_that_lacks_a_package_says_so_before_it_begins(
    package: str,
    extra: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == package else object())
    monkeypatch.setattr(sys, "argv", ["daq-app", "demo", str(tmp_path / "day")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = " ".join("".join(capsys.readouterr()).split())
    assert f"needs the package {package}" in said and f"rocking-test-recorder[{extra}]" in said
    assert not (tmp_path / "day").exists()
