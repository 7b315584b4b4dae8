"""A small simulated campaign through the commands: simulate, status, report; truth stays apart."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from daq_app.cli.app import build_app
from daq_app.runfile import open_run, verify

PLAN = """
schema_version = 1
name = "small"
levels = {{ L1 = 0.15, L3 = 0.35 }}
rigs = {{ FR1 = "{rig}" }}
[[sequence]]
specimen = "FR1"
level = "L3"
tests = 2
[[sequence]]
specimen = "FR1"
level = "L1"
tests = 1
"""


def simulate(plan: Path, runs: Path, *more: str) -> Result:
    command = ["campaign", "simulate", str(runs), "--plan", str(plan), "--r", "FR1=0.88"]
    return CliRunner().invoke(build_app(), [*command, "--impact-scatter", "0.001", "--workers", "1", *more])


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory, configs: Path) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("small")
    plan = folder / "small.toml"
    plan.write_text(PLAN.format(rig=(configs / "fr1.toml").as_posix()), encoding="utf-8")
    runs = folder / "runs"
    done = simulate(plan, runs)
    assert done.exit_code == 0, done.output
    return plan, runs


@pytest.mark.heavy
def test_runs_are_whole_and_do_not_hold_the_truth(campaign: tuple[Path, Path]) -> None:
    _, runs = campaign
    names = sorted(path.name for path in runs.glob("*.h5"))
    assert names == ["FR1-L1-1.h5", "FR1-L3-1.h5", "FR1-L3-2.h5"]
    for name in names:
        assert verify(runs / name).ok
        with open_run(runs / name) as run:
            assert run.header.truth is None
    truth = json.loads((runs / "truth.json").read_text(encoding="utf-8"))
    assert truth["specimens"]["FR1"]["r"] == 0.88
    assert truth["tests"]["FR1-L3-1"]["r"] != truth["tests"]["FR1-L3-2"]["r"]


@pytest.mark.heavy
def test_report_finds_the_true_r_of_each_test(campaign: tuple[Path, Path]) -> None:
    plan, runs = campaign
    command = ["campaign", "report", str(runs), "--plan", str(plan), "--bias-runs", "4", "--workers", "1"]
    done = CliRunner().invoke(build_app(), [*command, "--json"])
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)["table_4_1"]
    assert {row["method"]: row["tests"] for row in rows} == {"CRT": 3, "EAV": 3, "fit": 3}
    true = json.loads((runs / "truth.json").read_text(encoding="utf-8"))["tests"]
    with (runs / "report" / "tests.csv").open(encoding="utf-8") as file:
        found = {row["test"]: row for row in csv.DictReader(file)}
    assert found.keys() == true.keys()
    for test, row in found.items():
        for method in ("CRT", "EAV", "fit"):
            assert float(row[f"r_{method}"]) == pytest.approx(true[test]["r"], abs=0.003)
    assert (runs / "report" / "report.html").stat().st_size > 50_000


@pytest.mark.heavy
def test_simulating_again_goes_on_where_a_killed_one_stopped(campaign: tuple[Path, Path]) -> None:
    plan, runs = campaign
    before = {path.name: path.stat().st_mtime_ns for path in runs.glob("FR1-L3-*.h5")}
    whole = (runs / "FR1-L1-1.h5").read_bytes()
    left = runs / ".simulate-999999999-abc"  # no process has this number
    left.mkdir()
    (runs / "FR1-L1-1.h5").rename(left / "FR1-L1-1.h5")
    (left / "FR1-L3-9.journal").write_bytes(b"half a journal")
    status = CliRunner().invoke(build_app(), ["campaign", "status", str(runs), "--plan", str(plan), "--json"])
    assert json.loads(status.stdout)["counts"] == {"done": 2, "to be repeated": 0, "missing": 1}
    assert json.loads(status.stdout)["extra"] == []
    done = simulate(plan, runs)
    assert done.exit_code == 0, done.output
    assert {path.name: path.stat().st_mtime_ns for path in runs.glob("FR1-L3-*.h5")} == before
    assert not left.exists()
    with open_run(runs / "FR1-L1-1.h5") as again:
        readings = again.readings()
    (runs / "FR1-L1-1.h5").write_bytes(whole)
    with open_run(runs / "FR1-L1-1.h5") as first:
        np.testing.assert_array_equal(readings, first.readings())


@pytest.mark.heavy
def test_another_truth_is_not_mixed_in(campaign: tuple[Path, Path]) -> None:
    plan, runs = campaign
    done = simulate(plan, runs, "--seed", "2")
    assert done.exit_code == 2
    assert "another seed" in done.stderr
    assert json.loads((runs / "truth.json").read_text(encoding="utf-8"))["seed"] == 1


@pytest.mark.parametrize("option", ["FR1=1.2", "FR9=0.9", "FR1", "FR1=abc"])
def test_a_restitution_that_is_none_is_told(tmp_path: Path, configs: Path, option: str) -> None:
    plan = configs / "campaigns" / "costa.toml"
    command = ["campaign", "simulate", str(tmp_path / "x"), "--plan", str(plan), "--r", option]
    done = CliRunner().invoke(build_app(), command)
    assert done.exit_code == 2
    assert "SPECIMEN=R" in done.stderr
    assert not (tmp_path / "x").exists()
