"""A campaign on the workers of a scheduler: the same files and numbers as on this machine alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app

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


@pytest.mark.heavy
def test_a_campaign_is_simulated_and_reported_with_the_same_numbers(
    address: str, configs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # the workers stand elsewhere: no path may be relative
    Path("plan.toml").write_text(PLAN.format(rig=configs / "fr1.toml"), encoding="utf-8")
    command("campaign", "simulate", "runs", "--plan", "plan.toml", "--scheduler", address)
    assert len(list(Path("runs").glob("*.h5"))) == 2
    report = ("campaign", "report", "runs", "--plan", "plan.toml", "--bias-runs", "2", "--json")
    spread = json.loads(command(*report, "--out", "spread", "--scheduler", address))
    alone = json.loads(command(*report, "--out", "alone", "--workers", "1"))
    assert spread["table_4_1"] == alone["table_4_1"]
    for path in Path("alone").glob("*.csv"):
        assert path.read_bytes() == (Path("spread") / path.name).read_bytes(), path.name


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
