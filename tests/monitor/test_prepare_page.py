"""Before the test: how far to pull, what the name says, and the sensor check."""

from __future__ import annotations

import math

import pytest

from daq_app.monitor.widgets.pull_gauge import pull_advice
from daq_app.monitor.widgets.test_card import TestCard


@pytest.mark.parametrize(
    ("tilt", "words", "role"),
    [
        (math.nan, "not live", "muted"),
        (0.03003, "Pull 45.2 mrad more", "text"),
        (-0.0745, "On target", "good"),
        (0.090, "ease back", "warning"),
        (0.180, "STOP", "bad"),
    ],
)
def test_the_gauge_tells_what_to_do_on_either_side(tilt, words, role):
    advice = pull_advice(tilt, 0.35 * 0.215, 0.215)
    assert words in advice.words
    assert advice.role == role


def test_the_level_follows_from_the_name_and_notes_do_not_linger(qtbot):
    card = TestCard()
    qtbot.addWidget(card)
    card.propose("FR1-L3-2")
    assert card.choice.target_ratio == 0.35
    card._notes.setPlainText("rain")
    card.propose("FR2-L4-R")
    assert card.choice.name == "FR2-L4-R"
    assert (card.choice.target_ratio, card.choice.notes) == (0.40, "")


def test_the_check_ends_in_a_verdict_with_the_worst_channel_on_top(qtbot, window, stand_in, play, rig):
    play(window.session, window.clock, stand_in, 3.5)
    window.prepare.run_check()
    qtbot.waitUntil(lambda: window.prepare.check is not None, timeout=60_000)
    assert window.prepare.verdict_text == "Go"
    row = rig.channel_ids.index("WP-3")
    for _, readings in window.session._recent:
        readings[row] = 0.0
    window.prepare.check = None
    window.prepare.run_check()
    qtbot.waitUntil(lambda: window.prepare.check is not None, timeout=60_000)
    assert window.prepare.verdict_text == "No-go"
    model = window.prepare.table.check_model
    assert [model.data(model.index(0, c)) for c in (0, 1)] == ["No-go", "WP-3"]
    assert "Stuck" in window.prepare._detail.text()


def test_a_check_without_data_says_so_in_the_window_not_in_a_box(window):
    window.prepare.run_check()
    severity, text = window.notices.current
    assert severity == "warning"
    assert "3 s of data" in text
