"""One file, one set of numbers: from the command, the campaign's report, the window's data and Python."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot
from typer.testing import CliRunner

from daq_app.acquisition.closing.derive import derive
from daq_app.campaign.recorded import recorded_test
from daq_app.campaign.report.collect import collect
from daq_app.campaign.result.result import make_result
from daq_app.campaign.status import TestVerdict
from daq_app.campaign.summaries.of_run import read_and_summarise
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.cli.app import build_app
from daq_app.config import load_rig, plan_tasks
from daq_app.config.wording import plus_minus
from daq_app.monitor.data.background import Background
from daq_app.monitor.pages.result_page import ResultPage
from daq_app.rocking import AnalysisOptions, TestRecord, analyse_record
from daq_app.runfile import JournalWriter, RunHeader, finalise, open_run, plan_to_dict, read_journal
from daq_app.runfile.exporters import export_run
from sim_hardware.direct import synthesise_test

_TEST = "FR1-L3-2"


def write_run(folder: Path, configs: Path, *, tared: bool) -> Path:
    """A simulated test as a run file with its journal beside it, with a tare or without."""
    text = (configs / "fr1.toml").read_text(encoding="utf-8")
    rig = load_rig(configs / "fr1.toml")
    short = {"upright_s": 1.0, "pull_s": 1.0, "hold_s": 3.0}
    rig = rig.model_copy(update={"simulation": rig.simulation.model_copy(update=short)})
    plan = plan_tasks(rig)
    test = synthesise_test(rig, plan, 0.35, 5)
    upright = test.readings[:, : test.upright_samples].mean(axis=1)
    zeros = {c.id: float(mean - c.offset) for c, mean in zip(rig.channels, upright, strict=True)}
    header = RunHeader(
        run_id="demo",
        test=_TEST,
        rig_name=rig.name,
        rig_text=text,
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=test.rate_hz,
        plan=plan_to_dict(plan),
        tare=zeros if tared else {},
        start_utc_ns=1_790_000_000_000_000_000,
    )
    with JournalWriter(folder / "demo.journal", header) as journal:
        journal.append_block(0, np.ascontiguousarray(test.readings))
    with read_journal(folder / "demo.journal") as contents:
        derived, trouble = derive(contents)
    assert not trouble
    return finalise(folder / "demo.journal", folder / f"{_TEST}.h5", derived)


def command(*arguments: object) -> dict[str, Any]:
    result = CliRunner().invoke(build_app(), ["analyse", *map(str, arguments), "--json"])
    answer: dict[str, Any] = json.loads(result.stdout)
    return answer


@pytest.mark.parametrize("tared", [True, False])
def test_every_door_gives_the_same_r_to_the_last_digit(tmp_path: Path, configs: Path, tared: bool) -> None:
    run = write_run(tmp_path, configs, tared=tared)
    by_command = command(run)
    with open_run(run) as opened:
        assert opened.rig is not None
        by_python = analyse_record(TestRecord.from_run(opened, opened.rig))
        in_window = opened.results["analysis"]
    (summary,) = collect(tmp_path, workers=1).tests
    for method in ("eav", "crt"):
        r = by_python.estimates[method].r
        assert r == by_command["estimates"][method]["r"] == in_window["estimates"][method]["r"]
        assert r == summary.methods[method.upper()].r
        assert summary.methods[method.upper()].bias == by_command["bias"][method]["mean"]
    assert by_python.theta0_rad == by_command["theta0_rad"] == in_window["theta0_rad"]
    assert by_python.zero == by_command["zero"] == in_window["zero"]
    assert by_python.zero == ("tare" if tared else "rest")


def test_the_windows_result_page_shows_the_r_of_the_command(
    qtbot: QtBot, tmp_path: Path, configs: Path
) -> None:
    run = write_run(tmp_path, configs, tared=False)
    make_result(run)
    page = ResultPage(Background())
    qtbot.addWidget(page)
    with qtbot.waitSignal(page.shown, timeout=60_000):
        page.open(run)
    by_command = command(run)
    assert page.result is not None
    for method in ("eav", "crt"):
        estimate = by_command["estimates"][method]
        assert page.result.test.methods[method.upper()].r == estimate["r"]
        value, detail = (label.text() for label in page.tiles[method.upper()].findChildren(QLabel)[1:3])
        assert value == f"{estimate['r']:.3f}"
        assert detail.startswith(plus_minus(estimate["standard_error"]))


def test_the_zero_of_a_run_without_a_tare_can_be_chosen(tmp_path: Path, configs: Path) -> None:
    run = write_run(tmp_path, configs, tared=False)
    assert command(run)["zero"] == command(run, "--zero-at-rest")["zero"] == "rest"
    assert command(run, "--keep-zero")["zero"] == "certificates"


def imported(folder: Path, configs: Path, *, unplugged: tuple[str, ...] = ()) -> Path:
    """The same test as another program would give it, imported; channels that begin so show nothing."""
    source = folder / "source"
    source.mkdir()
    exported = export_run(write_run(source, configs, tared=False), folder / "demo.npz", "npz")
    if unplugged:
        with np.load(exported) as content:
            values = dict(content)
        rows = [k for k, name in enumerate(values["names"]) if str(name).startswith(unplugged)]
        values["data"][rows] *= 0.0
        np.savez(exported, **values)
    (folder / "map.toml").write_text(f'[run]\ntest = "{_TEST}"\n', encoding="utf-8")
    (folder / "runs").mkdir()
    options = [
        "--rig",
        configs / "fr1.toml",
        "--map",
        folder / "map.toml",
        "--out",
        folder / "runs",
        "--json",
    ]
    answer = CliRunner().invoke(build_app(), ["import", str(exported), *map(str, options)])
    assert answer.exit_code == 0, answer.output
    return folder / "runs" / f"{_TEST}.h5"


def test_an_imported_run_is_judged_and_has_one_r(tmp_path: Path, configs: Path) -> None:
    run = imported(tmp_path, configs)
    with open_run(run) as opened:
        stored = opened.results
    answer = read_and_summarise(run, {}, AnalysisOptions(bias_runs=0, fit=False))
    test, summary = answer.test, answer.made
    assert stored["quality"]["verdict"] == "good"
    assert test is not None and test.verdict is TestVerdict.GOOD
    assert isinstance(summary, TestSummary)
    by_command = command(run, "--bias-runs", 0)
    assert summary.trust == stored["analysis"]["verdict"]["trust"]
    for method in ("eav", "crt"):
        r = stored["analysis"]["estimates"][method]["r"]
        assert r == by_command["estimates"][method]["r"] == summary.methods[method.upper()].r


def test_an_imported_run_without_its_wires_has_the_r_of_its_lvdts_and_says_so(
    tmp_path: Path, configs: Path
) -> None:
    run = imported(tmp_path, configs, unplugged=("WP",))
    with open_run(run) as opened:
        analysis = opened.results["analysis"]
    assert analysis["verdict"]["trust"] == "remarks"
    assert analysis["verdict"]["used"] == ["LVDTs"]
    assert any("wires something else" in reason for reason in analysis["verdict"]["reasons"])
    assert analysis["verdict"]["r"] == pytest.approx(0.895, abs=0.002)


def test_an_imported_run_that_shows_no_release_is_bad(tmp_path: Path, configs: Path) -> None:
    run = imported(tmp_path, configs, unplugged=("WP", "LV"))
    test = recorded_test(run, {})
    assert test is not None and test.verdict is TestVerdict.BAD
    assert "no release" in test.reason
