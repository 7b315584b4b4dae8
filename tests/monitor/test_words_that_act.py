"""Words that somebody typed are words on the screen: no tags, no letters that nobody sees."""

from __future__ import annotations

import html

import pytest
from hypothesis import HealthCheck, given, settings
from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QApplication, QLabel, QWidget

from daq_app.campaign.names import TestName
from daq_app.campaign.plan import Campaign, Step
from daq_app.campaign.status import CampaignStatus, RecordedTest, TestFacts, TestVerdict
from daq_app.config.shown_text import visible
from daq_app.monitor.data.background import Background
from daq_app.monitor.look.labels import Tile, role_label, tip_text
from daq_app.monitor.pages.campaign_page import CampaignPage
from daq_app.monitor.pages.replay_page import ReplayPage
from daq_app.monitor.pages.result_page import ResultPage
from daq_app.monitor.widgets.campaign_table import HEADINGS, CampaignModel
from tests.support.files.hostile_words import hidden_characters, hostile
from tests.support.window.stand_in import StandIn, write_run

PLAN = Campaign(name="c", levels={"L1": 0.15}, sequence=(Step(specimen="FR1", level="L1", tests=2),))


@pytest.mark.parametrize("make", [CampaignPage, ResultPage])
def test_no_label_of_a_page_takes_words_for_tags(qtbot, make) -> None:
    page = make(Background())
    qtbot.addWidget(page)
    loose = [label for label in page.findChildren(QLabel) if label.textFormat() is Qt.TextFormat.AutoText]
    assert loose == [], [label.text() for label in loose]


@given(hostile())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_label_shows_the_words(qapp: QApplication, text: str) -> None:
    label, tile = role_label(text, "muted"), Tile("Caption")
    tile.show_value(text, text)
    for shown in (label.text(), tile.value, tile.detail):
        assert not hidden_characters(shown)
    assert label.textFormat() is Qt.TextFormat.PlainText


@given(hostile())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_operator_notes_and_reason_in_the_campaign_stay_one_short_line(qapp: QApplication, text: str) -> None:
    facts = TestFacts(0.15, {"CRT": 0.9}, text, (text,))
    test = RecordedTest(TestName.parse("FR1-L1-1"), TestVerdict.BAD, 10**18, None, text, facts)
    model = CampaignModel()
    model.show_status(CampaignStatus(PLAN, [test]), "")
    for column in range(len(HEADINGS)):
        index = model.index(0, column)
        shown = str(model.data(index, Qt.ItemDataRole.DisplayRole))
        assert "\n" not in shown and len(shown) <= 120 and not hidden_characters(shown)
        tip = str(model.data(index, Qt.ItemDataRole.ToolTipRole))
        assert not hidden_characters(tip) and "<script" not in tip and "<img" not in tip


@given(hostile())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_tool_tip_shows_the_words(qapp: QApplication, text: str) -> None:
    """Qt takes a tip for tags where it sees some: what it would draw is the text that was typed."""
    tip = tip_text(text)
    shown = QTextDocument()
    shown.setHtml(tip)
    assert shown.allFormats() and not any(part.isImageFormat() for part in shown.allFormats())
    assert _words(shown.toPlainText()) == _words(visible(text))


def _words(text: str) -> list[str]:
    """The words, for a page folds spaces and ends of lines."""
    return text.replace("\ufffc", " ").split()


def test_every_tip_and_label_of_a_replay_is_words(qtbot, rig, configs, tmp_path) -> None:
    """What an event says comes from a file that anybody may have written."""
    run = write_run(
        StandIn(rig), configs / "fr1.toml", tmp_path, "FR1-L1-1", 1, end_text="<img src=x>\x1b[2J"
    )
    page = ReplayPage(Background())
    qtbot.addWidget(page)
    with qtbot.waitSignal(page.opened, timeout=120_000):
        page.open(run)
    tips = [widget.toolTip() for widget in page.findChildren(QWidget)]
    tips += [page.events.item(row).toolTip() for row in range(page.events.count())]
    assert any("<img" in html.unescape(tip) for tip in tips)
    for tip in tips:
        assert "<img" not in tip and not hidden_characters(tip)
