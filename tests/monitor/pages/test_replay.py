"""Replay shows what the run holds: values, extremes, gaps, and exports that can be read back."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from PySide6.QtWidgets import QApplication, QTreeWidgetItemIterator

from daq_app.monitor.data.background import Background
from daq_app.monitor.data.replay_data import ROTATION, VELOCITY, ReplayRun
from daq_app.monitor.pages.campaign_page import CampaignPage
from daq_app.monitor.window.main_window import MainWindow
from daq_app.runfile import RunFileError, open_run
from tests.support.window.stand_in import write_run


@pytest.fixture
def replay(run_file):
    with ReplayRun(run_file) as run:
        yield run


def test_time_counts_from_the_release(replay, stand_in):
    assert replay.span_s[0] == pytest.approx(-stand_in.release_s)
    assert replay.value_at(ROTATION, -0.5) == pytest.approx(1e3 * stand_in.theta0, abs=0.5)
    theta, omega = stand_in.rotation(np.array([stand_in.release_s + 0.8]))
    assert replay.value_at(ROTATION, 0.8) == pytest.approx(1e3 * theta[0], abs=1.0)
    assert replay.value_at(VELOCITY, 0.8) == pytest.approx(omega[0], abs=0.05)
    assert math.isnan(replay.value_at(ROTATION, 1e4))


def test_the_envelope_keeps_every_extreme_at_any_zoom(replay, run_file):
    with open_run(run_file) as run:
        truth = run.si(["AC-1"])[0]
    whole = replay.envelope("AC-1", *replay.span_s, 500)
    assert whole.low.size <= 500
    assert (whole.low.min(), whole.high.max()) == (truth.min(), truth.max())
    close = replay.envelope("AC-1", 0.40, 0.42, 500)
    first = replay.column_of(0.40)
    np.testing.assert_array_equal(close.high, truth[first : first + close.high.size])
    assert replay.envelope("AC-1", 0.40, 0.42, 500) is close


def test_the_csv_holds_every_visible_sample(replay, tmp_path):
    path = tmp_path / "view.csv"
    rows = replay.write_csv(path, [ROTATION, "WP-1"], 0.0, 0.05)
    with path.open(encoding="utf-8") as file:
        table = list(csv.reader(file))
    assert table[0] == ["time_s", "sample", "θ (mrad)", "WP-1 (mm)"]
    assert len(table) - 1 == rows == 201
    assert float(table[1][2]) == pytest.approx(replay.value_at(ROTATION, 0.0), rel=1e-5)
    assert int(table[2][1]) - int(table[1][1]) == 1


def test_a_file_that_is_no_run_is_refused_in_words(tmp_path):
    path = tmp_path / "no.h5"
    path.write_bytes(b"nothing")
    with pytest.raises(RunFileError, match=r"no\.h5"):
        ReplayRun(path)


@pytest.fixture
def page(qtbot, settings, run_file):
    window = MainWindow(None, settings)
    qtbot.addWidget(window)
    window.show()
    window.open_run(run_file)
    qtbot.waitUntil(lambda: window.replay.run is not None, timeout=120_000)
    yield window.replay
    window.replay.run.close()


def test_notes_are_read_where_the_run_is_shown(qtbot, page, stand_in, configs, tmp_path, run_file):
    assert page.notes.isHidden(), "a run without notes has no line for them"
    noted = write_run(stand_in, configs / "fr1.toml", tmp_path, "FR1-L1-2", 2, notes="stay <b>left</b> loose")
    page.open(noted)
    qtbot.waitUntil(lambda: page.run is not None and page.run.path == noted, timeout=120_000)
    assert page.notes.isVisible() and page.notes.text() == "stay <b>left</b> loose"
    page.open(run_file)
    qtbot.waitUntil(lambda: page.run is not None and page.run.path == run_file, timeout=120_000)
    assert page.notes.isHidden()


def test_the_page_shows_picks_and_exports(qtbot, page, tmp_path):
    page.choose([ROTATION, "LV-A01", "LV-B01", "TL-1X"])
    assert len(page.plots._plots) == 3
    page.plots.set_cursor(-1.0)
    values = {item.text(0): item.text(1) for item in page._items()}
    assert values["LV-A01"].endswith("mm") and values["AC-1"] == ""
    assert float(values[ROTATION].split()[0]) == pytest.approx(75.2, abs=1.0)
    page.plots.set_view(0.0, 2.0)
    for kind in ("png", "svg", "csv"):
        page.export(kind, tmp_path / f"view.{kind}")
    assert (tmp_path / "view.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (tmp_path / "view.svg").read_bytes()[:2000]
    assert len((tmp_path / "view.csv").read_text(encoding="utf-8").splitlines()) == 8002
    told = []
    page.told.connect(lambda severity, text: told.append((severity, text)))
    page.export("csv", tmp_path / "missing" / "view.csv")
    assert told[0][0] == "error" and "another folder" in told[0][1]


def test_zoom_steps_and_jumps_by_key(qtbot, page):
    page.plots.set_view(0.0, 4.0)
    page.plots.set_cursor(1.0)
    page._zoom(0.5)
    assert page.plots.view_s == pytest.approx((0.5, 2.5))
    page._step(1)
    assert page.plots.cursor_s == pytest.approx(1.01)
    page.show_whole()
    assert page.plots.view_s == pytest.approx(page.run.span_s)
    page.show_motion()
    assert page.plots.view_s[0] == pytest.approx(-1.0)


def test_a_window_on_a_run_shows_nothing_live(page):
    window = page.window()
    assert window.header.isHidden()
    assert list(window.pages) == ["Campaign", "Result", "Replay", "Gap", "Messages"]


def test_a_rejected_test_is_offered_again_at_once(qtbot, configs, run_file):
    from daq_app.campaign.plan import load_campaign

    page = CampaignPage(Background())
    qtbot.addWidget(page)
    with qtbot.waitSignal(page.scanned, timeout=120_000):
        page.set_campaign(load_campaign(configs / "campaigns" / "costa.toml"), run_file.parent, "FR1")
    assert str(page.proposal.name) == "FR1-L1-2"
    page.table.selectRow(0)
    told = []
    page.told.connect(lambda severity, text: told.append(text))
    page.reject_button.click()
    assert "Say why" in told[0]
    page._reason.setText("a rope touched the wall")
    with qtbot.waitSignal(page.take, timeout=120_000) as taken:
        page.reject_button.click()
        page.take_button.click()  # at once: the verdict is read first
    assert page.proposal.planned.name.number == 1
    assert "rope" in page.proposal.reason
    assert taken.args == [str(page.proposal.name), 0.15] and taken.args[0] != "FR1-L1-2"
    (run_file.parent / "verdicts.json").unlink()


def test_a_rejected_test_leaves_the_diagnosis_at_once(qtbot, page, run_file):
    window = page.window()
    qtbot.waitUntil(lambda: window.gap.chosen == [run_file], timeout=120_000)
    with qtbot.waitSignal(window.result.shown, timeout=120_000):
        window.result.open(run_file)
    window.result.buttons["bad"].click()
    qtbot.waitUntil(lambda: window.gap.runs.item(0).text().endswith("bad"), timeout=120_000)
    assert not window.gap.chosen
    (run_file.parent / "verdicts.json").unlink()


def test_a_wider_page_shows_a_finer_line(qtbot, page):
    def points() -> int:
        return page.plots._curves[ROTATION].getData()[0].size

    page.plots.setFixedSize(300, 500)  # no layout that is still to come makes it another one
    qtbot.waitUntil(lambda: points() < 500, timeout=60_000)
    page.plots.setFixedSize(1400, 500)
    qtbot.waitUntil(lambda: points() > 2000, timeout=60_000)


def test_picking_channels_leaves_the_cursor_and_the_view(page):
    page.plots.set_view(0.0, 3.0)
    page.plots.set_cursor(0.46)
    page.choose([ROTATION, "WP-1"])
    assert page.plots.cursor_s == pytest.approx(0.46)
    assert page.plots.view_s == pytest.approx((0.0, 3.0))


@pytest.mark.parametrize("larger", [0, 4])
def test_every_signal_has_its_whole_name(qtbot, page, larger):
    """With values beside them, in the largest type: "Accelerometers" had ended in dots."""
    window = page.window()
    window.show_page(page)
    for _ in range(larger):
        window.change_type_size(1)
    window.resize(1366, 743)
    tree = page.tree
    tree.expandAll()
    page.choose([ROTATION, VELOCITY, "AC-1", "LV-A01", "WP-1", "TL-1X"])
    page.plots.set_cursor(0.5)
    for _ in range(3):
        QApplication.processEvents()
    cut = []
    walk = QTreeWidgetItemIterator(tree)
    while (item := walk.value()) is not None:
        for column in (0, 1):
            index = tree.indexFromItem(item, column)
            if item.text(column) and tree.sizeHintForIndex(index).width() > tree.visualRect(index).width():
                cut.append(item.text(column))
        walk += 1
    assert cut == []
    assert window.width() == 1366
