"""`daq-app run`, `simulate` and `keys` as an operator types them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.cli.record.commands import LEVELS, level_of
from daq_app.runfile import open_run, verify

runner = CliRunner()


def daq_app(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", "from daq_app.cli import main; main()", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )


@pytest.mark.parametrize(
    ("test", "level"),
    [
        ("FR1-L3-2", "L3"),
        ("FR1-L3-R", "L3"),
        ("FR2-L1-1", "L1"),
        ("L4", "L4"),
        ("FR1-L5-1", None),
        ("XL3", None),
    ],
)
def test_the_level_is_in_the_name(test: str, level: str | None) -> None:
    assert level_of(test) == level


@pytest.mark.parametrize(
    ("level", "r", "file", "test"),
    [("L1", 0.82, "run.h5", "FR1-L1-1"), ("L4", 0.95, "FR1-L4-3.h5", "FR1-L4-3")],
)
def test_a_simulated_run_gives_back_its_r(
    configs: Path, tmp_path: Path, level: str, r: float, file: str, test: str
) -> None:
    out = tmp_path / file
    arguments = ["simulate", str(configs / "fr1.toml"), "--level", level, "--r", str(r), "--out", str(out)]
    answer = runner.invoke(build_app(), [*arguments, "--json", "--seed", "5"])
    assert answer.exit_code == 0, answer.output
    document = json.loads(answer.stdout)
    assert verify(out).ok
    assert document["outcome"] == "complete" and document["lost_samples"] == 0
    assert document["truth"]["restitution"] == r
    results = document["results"]
    truth = document["truth"]["theta0_over_alpha"]
    assert results["theta0_over_alpha"] == pytest.approx(truth, rel=0.005)
    tolerance = 0.01 if level == "L1" else 0.003
    for method in ("eav", "crt"):
        assert results["r"][method]["r"] == pytest.approx(r, abs=tolerance)
        assert results["r"][method]["online"] == pytest.approx(r, abs=tolerance)
    again = runner.invoke(build_app(), arguments)
    assert again.exit_code == 2, "a run is never overwritten"
    with open_run(out) as run:
        assert run.header.test == test
        assert [event.kind for event in run.events if event.kind in LEVELS] == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simulate", "{fr1}", "--level", "L9", "--out", "x.h5"], "no level"),
        (["simulate", "{fr1}", "--r", "1.5", "--out", "x.h5"], "1.5"),
        (["simulate", "nowhere.toml", "--out", "x.h5"], "nowhere.toml"),
        (["run", "nowhere.toml", "--test", "FR1-L3-1", "--headless"], "nowhere.toml"),
        (["run", "{fr1}", "--test", "a/b", "--headless", "--connection", "usb"], "no way to the hardware"),
        (["keys", "viewer", "{tmp}", "../x"], "no name"),
    ],
)
def test_bad_input_is_one_paragraph_and_not_code_0(
    configs: Path, tmp_path: Path, arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    filled = [one.format(fr1=configs / "fr1.toml", tmp=tmp_path) for one in arguments]
    answer = runner.invoke(build_app(), filled)
    assert answer.exit_code in (2, 3), answer.output
    assert isinstance(answer.exception, SystemExit), "every failure is told, none is raised"
    assert words in " ".join(answer.output.split())


@pytest.mark.heavy
@pytest.mark.skipif(
    sys.platform == "win32", reason="a process of a test cannot send itself Ctrl-C on Windows"
)
def test_ctrl_c_ends_the_test_and_keeps_what_was_recorded(configs: Path, tmp_path: Path) -> None:
    process = daq_app(
        *("run", str(configs / "fr1.toml"), "--test", "FR1-L3-2", "--headless", "--json"),
        *("--out", str(tmp_path), "--speed", "4"),
    )
    assert process.stderr is not None and process.stdout is not None
    for line in process.stderr:
        if "holding" in line:
            os.kill(process.pid, signal.SIGINT)
            break
    out = process.stdout.read()
    process.stderr.read()
    assert process.wait(60) == 130
    document = json.loads(out)
    assert document["outcome"] == "stopped"
    assert verify(Path(document["run"])).ok


def test_keys_for_a_viewer_and_its_recorder(tmp_path: Path) -> None:
    made = runner.invoke(build_app(), ["keys", "recorder", str(tmp_path / "keys")])
    assert made.exit_code == 0 and (tmp_path / "keys" / "viewers").is_dir()
    made = runner.invoke(build_app(), ["keys", "viewer", str(tmp_path / "mine"), "bench"])
    assert made.exit_code == 0 and (tmp_path / "mine" / "bench.key_secret").exists()
