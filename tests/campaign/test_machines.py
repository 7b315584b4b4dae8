"""A campaign on the workers of a scheduler: the same files and numbers as on this machine alone."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.runfile import open_run

distributed = pytest.importorskip("distributed")
PLAN = """name = "two"
[levels]
L2 = 0.2
[rigs]
FR1 = "{rig}"
[[sequence]]
specimen = "FR1"
level = "L2"
tests = 2
"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def command(*words: object) -> str:
    answer = CliRunner().invoke(build_app(), [str(word) for word in words])
    assert answer.exit_code == 0, answer.output
    return answer.stdout


@pytest.fixture(scope="module")
def folder(address: str, configs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the commands run: plan.toml, and runs/ simulated by workers who stand elsewhere."""
    place = tmp_path_factory.mktemp("machines")
    (place / "plan.toml").write_text(PLAN.format(rig=configs / "fr1.toml"), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        command("campaign", "simulate", "runs", "--plan", "plan.toml", "--scheduler", address)
    assert len(list(place.glob("runs/*.h5"))) == 2
    return place


@pytest.mark.heavy
def test_a_campaign_is_reported_with_the_same_numbers(
    address: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    report = ("campaign", "report", "runs", "--plan", "plan.toml", "--bias-runs", "2", "--json")
    spread = json.loads(command(*report, "--out", "spread", "--scheduler", address))
    alone = json.loads(command(*report, "--out", "alone", "--workers", "1"))
    assert spread["table_4_1"] == alone["table_4_1"]
    for path in Path("alone").glob("*.csv"):
        assert path.read_bytes() == (Path("spread") / path.name).read_bytes(), path.name


@pytest.mark.heavy
def test_recordings_are_imported_with_the_same_numbers(
    address: str, folder: Path, configs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for run in folder.glob("runs/*.h5"):
        command("export", run, "--format", "npz", "--raw", "--out", "old")
    files = sorted(Path("old").glob("*.npz"))
    for out, spread in (("spread", ["--scheduler", address]), ("alone", ["--workers", "1"])):
        command("import", *files, "--rig", configs / "fr1.toml", "--out", out, *spread)
    for file in files:
        with open_run(Path(f"spread/{file.stem}.h5")) as run, open_run(Path(f"alone/{file.stem}.h5")) as same:
            assert np.array_equal(run.readings(), same.readings())
            assert run.results == same.results and run.results["analysis"]


@pytest.mark.heavy
def test_specimens_of_two_campaigns_are_diagnosed_with_the_same_numbers(
    address: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    later = Path("later")
    later.mkdir()
    for run in Path("runs").glob("*.h5"):
        shutil.copy(run, later)
    only, rejected = sorted(later.glob("*.h5"))
    command("campaign", "verdict", rejected, "bad", "--reason", "a stay was forgotten")
    many = ("gap", "campaigns", "runs", "later", "--causes", "1")
    said = command(*many, "--out", "spread", "--scheduler", address)
    command("gap", "campaigns", "later", "--causes", "1", "--out", "alone", "--workers", "1")
    assert "2 of 2 results written" in said
    assert json.loads(Path("spread/runs-FR1.json").read_text("utf-8"))["seconds"] > 0.0
    spread, alone = (
        json.loads((Path(out) / "later-FR1.json").read_text("utf-8")) for out in ("spread", "alone")
    )
    assert spread.pop("seconds") > 0.0 and alone.pop("seconds") > 0.0
    assert spread == alone
    used = alone["runs"]
    assert used == [only.stem.split("_")[0]], "a rejected test enters no diagnosis"


def test_a_scheduler_that_does_not_answer_is_said(
    configs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("daq_app.machines.ANSWER_S", 0.5)
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN.format(rig=configs / "fr1.toml"), encoding="utf-8")
    words = ["campaign", "simulate", str(tmp_path / "runs"), "--plan", str(plan)]
    answer = CliRunner().invoke(build_app(), [*words, "--scheduler", "tcp://127.0.0.1:9"])
    assert answer.exit_code == 2
    assert "no scheduler answers" in answer.stderr
