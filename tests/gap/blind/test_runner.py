"""The runner: processes without labels, resumption, failures; and the commands from end to end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from daq_app.cli.app import build_app
from daq_app.gap.blind.layout import run_files
from daq_app.gap.blind.running.runner import case_folders, pending, read_outcome, run_pending
from daq_app.gap.blind.seal import SealBroken, open_label, seal_case
from daq_app.runfile import open_run

DIAGNOSERS = '''
import os, sys, threading
from pathlib import Path

def guess(case):
    first = {"effects": ["viscous"], "family": "dissipation", "probability": 0.9}
    return {"decision": "effect", "which": [first]}

def look_around(case):
    """Everything within reach that could tell: files of the case, above it, arguments, environment."""
    here = sorted(p.name for p in case.iterdir())
    above = sorted(str(p.relative_to(case.parent)) for p in case.parent.rglob("*"))
    told = " ".join(sys.argv) + " ".join(f"{k}={v}" for k, v in os.environ.items())
    return {"here": here, "above": above, "told": told, "cwd": os.getcwd()}

def breaks(case):
    raise ValueError("no idea")

def hangs(case):
    threading.Event().wait()
'''


@pytest.fixture
def check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three tiny sealed cases, and a module of diagnosers on the import path."""
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "blind_test_diagnosers.py").write_text(DIAGNOSERS, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path / "code"))
    folder = tmp_path / "check"
    for number in range(3):
        case = folder / f"case_{number + 1:04d}"
        case.mkdir(parents=True)
        (case / "rig.toml").write_text(f"# {number}", encoding="utf-8")
        seal_case(case, {"effects": []}, tmp_path / "secret-labels" / f"{case.name}.json")
    return folder


def run(folder: Path, name: str, timeout_s: float = 120.0) -> dict[str, str]:
    found = run_pending(folder, f"blind_test_diagnosers:{name}", 2, timeout_s)
    return {outcome.case: outcome.failure for outcome in found}


def test_a_diagnosis_sees_the_case_and_nothing_else(check: Path) -> None:
    run(check, "look_around")
    outcome = read_outcome(check, "case_0002")
    assert outcome is not None and outcome.result is not None
    seen = outcome.result
    assert seen["here"] == ["rig.toml"]
    assert not any("seal" in name or "label" in name or "case_0" in name for name in seen["above"])
    assert "secret-labels" not in seen["told"] and str(check) not in seen["told"]
    assert not Path(seen["cwd"]).is_relative_to(check.parent / "check")


def test_what_is_done_is_not_done_again(check: Path) -> None:
    assert len(run(check, "guess")) == 3
    assert run(check, "guess") == {}
    (check / "results" / "case_0002.json").write_text('{"case": "ca', encoding="utf-8")  # cut off by a kill
    assert set(run(check, "guess")) == {"case_0002"}
    assert len(pending(check, "another:diagnoser")) == 3


def test_results_of_a_name_are_kept_apart(check: Path) -> None:
    run(check, "guess")
    assert len(list(run_pending(check, "blind_test_diagnosers:guess", 2, 120.0, "apart"))) == 3
    assert read_outcome(check, "case_0001", "apart") is not None
    assert not pending(check, "blind_test_diagnosers:guess")


def test_an_interrupted_run_keeps_what_it_has(check: Path) -> None:
    running = run_pending(check, "blind_test_diagnosers:guess", 1, 120.0)
    first = next(running)
    running.close()
    assert read_outcome(check, first.case) == first
    left = {case.name for case in pending(check, "blind_test_diagnosers:guess")}
    assert first.case not in left and left


def test_failures_are_kept_in_words(check: Path) -> None:
    told = run(check, "breaks")
    assert len(told) == 3 and all("no idea" in words for words in told.values())
    assert set(run(check, "hangs", timeout_s=6.0).values()) == {"stopped after 6 s"}


def test_changed_data_are_not_diagnosed(check: Path) -> None:
    (check / "case_0001" / "rig.toml").write_text("other", encoding="utf-8")
    with pytest.raises(SealBroken, match=r"rig\.toml was changed"):
        run(check, "guess")


@pytest.mark.heavy
def test_a_scheduler_spreads_the_cases(check: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `scale` is not installed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        arguments = ["gap", "blind", "run", str(check), "--scheduler", cluster.scheduler_address]
        done = CliRunner().invoke(build_app(), [*arguments, "--diagnoser", "blind_test_diagnosers:guess"])
    assert done.exit_code == 0, done.output
    assert "3 diagnosed now" in done.output
    assert all(read_outcome(check, case.name) for case in case_folders(check))


def test_bad_arguments_are_told_in_words(check: Path, tmp_path: Path, configs: Path) -> None:
    app, cli = build_app(), CliRunner()
    unknown = cli.invoke(app, ["gap", "blind", "run", str(check), "--diagnoser", "nowhere:nothing"])
    assert unknown.exit_code == 2 and "is no diagnoser" in unknown.output
    empty = cli.invoke(app, ["gap", "blind", "run", str(tmp_path / "none"), "--diagnoser", "os:getcwd"])
    assert empty.exit_code == 2 and "no sealed cases" in empty.output
    inside = ["gap", "blind", "make", "--out", str(tmp_path), "--labels", str(tmp_path / "labels")]
    refused = cli.invoke(app, [*inside, "--rig", str(configs / "fr1.toml")])
    assert refused.exit_code == 2 and "must not lie within" in refused.output


def test_make_run_score(tmp_path: Path, configs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "blind_test_diagnosers.py").write_text(DIAGNOSERS, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    app, cli, out = build_app(), CliRunner(), tmp_path / "check"
    make = ["gap", "blind", "make", "--cases", "1", "--seed", "3", "--out", str(out), "--runs", "1"]
    made = cli.invoke(app, [*make, "--workers", "1", "--rig", str(configs / "fr1.toml")])
    assert made.exit_code == 0, made.output
    case = out / "case_0001"
    label = open_label(case, tmp_path / "check-labels" / "case_0001.json")
    (path,) = run_files(case)
    with open_run(path) as run_file:
        # The file tells what any run tells, and nothing of what was hidden.
        assert run_file.header.truth is None and run_file.header.notes == "" and not run_file.events
        assert len(run_file.channel_ids) == 41 and run_file.rate_hz == 4000.0
        assert label["runs"][0]["rest_s"] < run_file.n_samples / 4000.0
        tilt = run_file.si(["TL-1X"], 6000, 8000)
        assert tilt.mean() == pytest.approx(label["runs"][0]["theta0"], rel=0.03)
        assert np.isfinite(run_file.readings()).all()
    before = path.read_bytes()
    assert cli.invoke(app, [*make, "--workers", "1", "--rig", str(configs / "fr1.toml")]).exit_code == 0
    assert path.read_bytes() == before  # a sealed case is left alone

    done = cli.invoke(app, ["gap", "blind", "run", str(out), "--diagnoser", "blind_test_diagnosers:guess"])
    assert done.exit_code == 0, done.output
    page, numbers = tmp_path / "score.html", tmp_path / "score.json"
    scored = cli.invoke(app, ["gap", "blind", "score", str(out), "--html", str(page), "--json", str(numbers)])
    assert scored.exit_code == 1, scored.output  # a guess misses targets
    assert "Blind check: 1 cases" in scored.output and page.exists()
    assert json.loads(numbers.read_text(encoding="utf-8"))["cases"][0]["case"] == "case_0001"
    kept = tmp_path / "check-labels" / "case_0001.json"
    kept.write_text(kept.read_text(encoding="utf-8").replace("theta0", "theta1"), encoding="utf-8")
    broken = cli.invoke(app, ["gap", "blind", "score", str(out)])
    assert broken.exit_code == 1 and "not the one that was sealed" in broken.output
