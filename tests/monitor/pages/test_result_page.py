"""The result of a test in the window: what its page shows, opens and says."""

from __future__ import annotations

import itertools
import shutil
import sys
from collections import Counter
from dataclasses import replace

import pyqtgraph as pg
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QTableWidgetItem

from daq_app.campaign.result.family_rows import family_rows
from daq_app.campaign.result.figures import result_figure
from daq_app.monitor.data.background import Background
from daq_app.monitor.look.theme import DARK, LIGHT, apply_theme
from daq_app.monitor.pages.result_page import ResultPage


@pytest.fixture
def page(qtbot, run_file):
    page = ResultPage(Background())
    qtbot.addWidget(page)
    page.restyle(LIGHT)
    with qtbot.waitSignal(page.shown, timeout=120_000):
        page.open(run_file)
    page.show()
    return page


def test_eav_and_crt_have_the_same_marks_in_the_window_and_on_paper(page):
    points = page.plots.restitution.plot_item.items
    shown = {item.opts["symbol"] for item in points if isinstance(item, pg.ScatterPlotItem)}
    drawn = {
        line.get_label().split()[0]: line.get_marker()
        for axis in result_figure(page.result.test).axes
        for line in axis.lines
    }
    assert {drawn["EAV"], drawn["CRT"]} == shown == {"o", "s"}
    circle, square = page.plots.legend.text().index("●"), page.plots.legend.text().index("■")
    in_legend = ("EAV", "CRT") if circle < square else ("CRT", "EAV")
    assert [drawn[name] for name in in_legend] == ["o", "s"]


def test_the_tests_on_offer_are_those_of_the_folder_now(qtbot, run_file, tmp_path):
    """Runs come from elsewhere as well: another window, a colleague's copy."""
    page = ResultPage(Background())
    qtbot.addWidget(page)
    shutil.copy(run_file, tmp_path / "first.h5")
    page.list_tests(tmp_path)
    qtbot.waitUntil(lambda: page.chooser.count() == 1, timeout=60_000)
    shutil.copy(run_file, tmp_path / "second.h5")
    page.show()
    qtbot.waitUntil(lambda: page.chooser.count() == 2, timeout=60_000)
    assert page.chooser.currentIndex() == -1 and "Choose" in page.chooser.placeholderText()


@pytest.mark.parametrize("colours", [DARK, LIGHT], ids=["dark", "light"])
def test_the_chosen_test_in_the_list_and_an_empty_tick_can_be_seen(qapp, page, colours):
    """The name that the list opens on was dark on dark; an unticked repetition had no box."""
    apply_theme(qapp, page, colours, 10.0)
    page.chooser.addItem("FR1-L1-1")
    page.chooser.setCurrentIndex(0)
    page.chooser.showPopup()
    qapp.processEvents()
    rows = page.chooser.view()
    picture = rows.viewport().grab(rows.visualRect(rows.model().index(0, 0))).toImage()
    assert contrast(picture) > 4.0
    page.chooser.hidePopup()

    page.table.setRowCount(1)
    unticked = QTableWidgetItem("FR1-L1-2")
    unticked.setCheckState(Qt.CheckState.Unchecked)
    page.table.setItem(0, 0, unticked)
    box = page.table.visualItemRect(unticked)
    box.setWidth(24)
    assert contrast(page.table.viewport().grab(box).toImage()) > 4.0


def contrast(picture):
    """The contrast of a picture's ground with what stands out most on it, as WCAG 2 defines it."""
    where = itertools.product(range(picture.width()), range(picture.height()))
    grey = Counter(luminance(picture.pixelColor(x, y)) for x, y in where)
    ground = grey.most_common(1)[0][0]
    return max((max(one, ground) + 0.05) / (min(one, ground) + 0.05) for one in grey)


def luminance(colour):
    """Relative luminance of sRGB."""
    linear = [
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in (colour.redF(), colour.greenF(), colour.blueF())
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.fixture
def openers(tmp_path, monkeypatch):
    """A folder that alone is searched for the program that opens files."""
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


def _told_of_the_page(qtbot, page):
    with qtbot.waitSignal(page.told, timeout=60_000) as told:
        page.buttons["page"].click()
    return told.args


def test_a_page_that_nothing_here_opens_is_told_with_what_to_do(qtbot, page, openers, monkeypatch):
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: False)
    severity, text = _told_of_the_page(qtbot, page)
    assert severity == "warning" and "Install a browser" in text
    assert text.endswith(str(page.run.with_suffix(".result.html")))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="xdg-open is Linux's")
def test_an_opener_that_finds_no_program_does_not_pass_for_success(qtbot, page, openers):
    """xdg-open starts well, and ends with 3 where no program is known for pages."""
    opener = openers / "xdg-open"
    opener.write_text("#!/bin/sh\nexit 3\n")
    opener.chmod(0o755)
    assert "Install a browser" in _told_of_the_page(qtbot, page)[1]

    shown = openers / "shown"
    opener.write_text(f'#!/bin/sh\necho "$1" > {shown}\n')
    with qtbot.assertNotEmitted(page.told, wait=0):
        page.buttons["page"].click()
        qtbot.waitUntil(lambda: shown.exists() and shown.read_text().endswith("html\n"), timeout=60_000)


def test_the_page_shows_every_family_as_its_saved_page_does(page):
    shown = [
        tuple(page.families.item(row, column).text() for column in range(page.families.columnCount()))
        for row in range(page.families.rowCount())
    ]

    assert shown == family_rows(page.result.test)
    assert [row[0] for row in shown] == ["wires *", "LVDTs", "tiltmeters *", "accelerometers"]
    assert all(row[1] in page.run.with_suffix(".result.html").read_text(encoding="utf-8") for row in shown)


@pytest.mark.parametrize("points", [10, 15])
def test_columns_of_both_tables_are_whole_on_the_smallest_screen(qapp, page, points):
    page.restyle(replace(LIGHT, points=points))
    page.resize(900, 640)
    qapp.processEvents()
    for table in (page.table, page.families):
        header = table.horizontalHeader()
        needed = [
            max(table.sizeHintForColumn(place), header.sectionSizeHint(place))
            for place in range(table.columnCount())
        ]
        assert table.rowCount() and table.viewport().height() >= table.rowHeight(0)
        assert [table.columnWidth(place) >= px for place, px in enumerate(needed)] == [True] * len(needed)


def test_neither_table_needs_a_bar_on_the_smallest_screen(qapp, page):
    """The last column had kept 100 pixels where its heading needs 70."""
    apply_theme(qapp, page, LIGHT, 10.0)
    page.restyle(LIGHT)
    page.resize(1268, 648)
    qapp.processEvents()
    for table in (page.table, page.families):
        assert table.horizontalHeader().length() <= table.viewport().width()


def test_a_second_rejection_leaves_the_reason(qtbot, window, run_file, monkeypatch):
    given = []
    monkeypatch.setattr("daq_app.monitor.window.orders.give_verdict", lambda *verdict: given.append(verdict))
    with qtbot.waitSignal(window.result.shown, timeout=120_000):
        window.result.open(run_file)
    result = window.result.result
    window.result.result = replace(result, test=replace(result.test, good=False, reasons=("too far",)))
    window.result.buttons["bad"].click()
    assert not given and "to be repeated already" in window.notices.current[1]
    window.result.result = result
    window.result.buttons["bad"].click()
    assert given[0][2] == "bad"
