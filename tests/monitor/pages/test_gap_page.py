"""The gap page: a diagnosis in a process of its own, watched, stopped, shown."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap

import psutil
import pytest

from daq_app.monitor.data import gap_runner
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.gap_runner import GapRunner
from daq_app.monitor.pages.gap_page import GapPage, gap_in_words
from daq_app.monitor.plots.gap_views import closure_bars, evidence_bars, map_cells
from tests.support.gap.made_diagnosis import diagnosis

LONG_WORK = """
import threading
print('{"done": 0, "total": 1, "text": "long"}', flush=True)
threading.Event().wait()
"""


def made():
    return diagnosis({"viscous.zeta": 0.006}, ("FR1-L1-1", "FR1-L3-1"))


@pytest.fixture
def child(monkeypatch, tmp_path):
    """Replaces the diagnosis by a script that is given OUT and the runs; returns what was started."""
    started = []

    def use(script):
        path = tmp_path / "child.py"
        path.write_text(textwrap.dedent(script), encoding="utf-8")

        def start(module, arguments):
            assert module == "daq_app.gap.job"
            process = subprocess.Popen(
                [sys.executable, str(path), *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            started.append(process)
            return process

        monkeypatch.setattr(gap_runner, "start_guarded", start)
        return started

    return use


@pytest.fixture
def page(qtbot):
    page = GapPage(Background())
    qtbot.addWidget(page)
    page.resize(1240, 640)
    yield page
    page.close_down()


def test_the_page_lists_the_runs_diagnoses_them_and_shows_the_answer(qtbot, page, child, run_file, tmp_path):
    saved = tmp_path / "made.json"
    made().save(saved)
    child(f"""
        import json, shutil, sys
        print("a library prints this")
        print(json.dumps({{"done": 3, "total": 7, "text": "single effects"}}), flush=True)
        shutil.copy({str(saved)!r}, sys.argv[1])
        print(json.dumps({{"result": sys.argv[1]}}), flush=True)
    """)
    page.set_folder(run_file.parent)
    qtbot.waitUntil(lambda: page.runs.count() == 1, timeout=60_000)
    assert page.chosen == [run_file] and "FR1-L1-1" in page.runs.item(0).text()
    heard = []
    page.runner.progress.connect(lambda *words: heard.append(words))
    with qtbot.waitSignal(page.shown, timeout=60_000):
        page.buttons["start"].click()
        assert page.buttons["stop"].isEnabled() and not page.buttons["start"].isEnabled()
    assert heard == [(3, 7, "single effects")]
    assert page._title.text() == "An effect explains the gap"
    assert "viscous" in page._sentence.text()
    assert page._more.text().startswith(
        "In words: viscous damping of 0.60 ± 0.06 % of critical (closes 97 % of"
    )
    assert "9.10 → 1.05" in page._more.text() and "Limit: One level only" in page._more.text()
    assert [bar.name for bar in page.evidence.bars] == ["viscous", "coulomb", "nothing missing"]
    assert not page.grab().toImage().isNull()
    assert page.buttons["start"].isEnabled() and not page.buttons["stop"].isEnabled()
    run_file.with_suffix(".gap.json").unlink()


def test_a_diagnosis_can_be_stopped_and_its_process_is_gone(qtbot, page, child, tmp_path):
    started = child(LONG_WORK)
    with qtbot.waitSignal(page.runner.progress, timeout=60_000):
        page.runner.start([tmp_path / "FR1-L1-1.h5"])
    with qtbot.waitSignal(page.runner.failed, timeout=60_000) as failed:
        page.runner.stop()
    assert failed.args == ["The diagnosis was stopped."]
    assert started[0].poll() is not None and not psutil.pid_exists(started[0].pid)
    assert not page.runner.busy


def test_a_test_that_is_armed_ends_the_diagnosis_and_keeps_the_next_one_off(qtbot, page, child, tmp_path):
    child(LONG_WORK)
    told = []
    page.told.connect(lambda severity, text: told.append(text))
    with qtbot.waitSignal(page.runner.progress, timeout=60_000):
        page.runner.start([tmp_path / "FR1-L1-1.h5"])
    with qtbot.waitSignal(page.runner.failed, timeout=60_000):
        page.set_recording(True)
    assert "a test is being recorded" in told[0]
    page.start()
    assert "waits for its end" in told[-1]
    assert not page.runner.busy


def test_a_refusal_of_the_real_job_is_told_in_words(qtbot, tmp_path):
    runner = GapRunner(Background())
    missing = tmp_path / "FR1-L1-1.h5"
    with qtbot.waitSignal(runner.failed, timeout=120_000) as failed:
        runner.start([missing])
    assert "FR1-L1-1.h5" in failed.args[0]
    assert not missing.with_suffix(".gap.json").exists()
    assert not runner.busy


def test_the_views_read_the_documented_result():
    result = made().to_dict()
    assert map_cells(result)[("lvdt", "swing")] == (9.0, 1.0)
    bars = evidence_bars(result)
    assert [round(bar.lengths[0][0], 3) for bar in bars] == [1.0, 0.305, 0.0]
    assert bars[0].lengths[0][1:] == ("accent", "p 0.98")
    assert [bar.name for bar in closure_bars(result)] == ["L1", "L4"]
    assert closure_bars({**result, "gap": None}) == []


def test_the_page_shows_measured_beside_simulated_rotation(page):
    result = made()
    assert page.traces.legend.text() == "" and page.traces.rotation.isHidden(), "there is no result yet"
    rows = {"measured": [80.0, 0.0, -70.0], "baseline": [80.0, 5.0, -60.0], "augmented": [80.0, 1.0, -69.0]}
    trace = {f"{name}_mrad": values for name, values in rows.items()}
    result.notes["traces"] = [
        {"run": "FR1-L3-1", "shown": "lvdt", "time_s": [0.0, 0.5, 1.0], "rms_mrad": [7.9, 1.0], **trace}
    ]
    page._show(None, json.loads(result.to_json()))
    assert not page.traces.rotation.isHidden() and not page.traces.left.isHidden()
    assert "FR1-L3-1" in page.traces.legend.text() and "7.90 mrad rms" in page.traces.legend.text()
    assert list(page.traces.curves["augmented"].getData()[1]) == rows["augmented"]
    assert list(page.traces.rests["baseline"].getData()[1]) == [0.0, -5.0, -10.0]
    result.notes.clear()
    page._show(None, json.loads(result.to_json()))
    assert "no simulated rotation" in page.traces.legend.text()


def test_a_gap_that_was_none_is_not_called_closed() -> None:
    assert "closed" not in gap_in_words({"before": 0.93, "after": 0.93, "closure": 1.0})
    assert "90 % of it closed" in gap_in_words({"before": 11.0, "after": 2.0, "closure": 0.9})
    assert "nothing of it closed" in gap_in_words({"before": 11.0, "after": 20.0, "closure": -0.9})
