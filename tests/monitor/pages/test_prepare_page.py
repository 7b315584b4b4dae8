"""Before the test: how far to pull, what the name says, and the sensor check."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.acquisition.checks.check_model import ChannelCheck, Finding, SensorCheck, Verdict
from daq_app.acquisition.messages.published import (
    BlockMessage,
    Call,
    CheckMessage,
    Judgement,
    MotionMessage,
    State,
    StateMessage,
)
from daq_app.monitor.data.session import Published
from daq_app.monitor.widgets.test_card import TestCard
from daq_app.runfile import TestPlan


def hear(window, state=State.ARMED, **words):
    """The window hears a judgement, with the rotation live."""
    message = StateMessage(state=state, judgement=Judgement(**words))
    for heard in (
        message,
        MotionMessage(
            first_sample=0, step=1, rate_hz=4000.0, rotation_rad=[0.01], velocity_rad_s=[0.0], judged_rad=0.01
        ),
    ):
        window.session.feed(Published(heard, window.clock.now))
    block = BlockMessage(first_sample=0, n_samples=4, n_channels=41, rate_hz=4000.0)
    window.session.feed(Published(block, window.clock.now, np.zeros((41, 4), dtype=np.float32)))
    window._after(message)
    window._on_slow()


def test_gauge_and_header_say_what_the_recorder_says(window):
    hear(window, call=Call.PULL, word="Armed", do="Pull the wall.", gauge="Pull 9.1 mrad more", target=0.35)
    assert window.prepare.gauge.words == "Pull 9.1 mrad more"
    assert (window.header.words["state"], window.header.words["sentence"]) == ("Armed", "Pull the wall.")
    assert window.live.motion.target_rad == pytest.approx(0.35 * window.session.alpha_rad)
    hear(window, call=Call.STOP, word="Stop", do="STOP: ease back.", gauge="STOP", alarm="STOP: ease back.")
    assert (window.prepare.gauge.words, window.header.words["state"]) == ("STOP", "Stop")
    window.clock.now += 1.0
    assert window.prepare.gauge.words == "The rotation is not live"


def test_a_click_on_a_level_while_armed_changes_no_target(window):
    plan = TestPlan(test="FR1-L1-1", theta0_over_alpha=0.15, operator="Ada", side="+x", notes="dry")
    message = StateMessage(
        state=State.ARMED, plan=plan, locked=True, armed=True, judgement=Judgement(target=0.15)
    )
    window.session.feed(Published(message, window.clock.now))
    window._after(message)
    card = window.prepare.card
    card._buttons["L4"].click()
    assert (card.choice.name, card.choice.target_ratio) == ("FR1-L1-1", 0.15)
    assert (card.choice.operator, card.choice.side, card.choice.notes) == ("Ada", "+x", "dry")
    assert window.live.motion.target_rad == pytest.approx(0.15 * window.session.alpha_rad)


def test_what_is_being_typed_is_not_overwritten_by_an_older_plan(window):
    window.prepare.card.propose("FR1-L3-1")
    older = StateMessage(state=State.PREVIEWING, plan=TestPlan(test="FR1-L1-1"))
    window._after(older)
    assert window.prepare.card.choice.name == "FR1-L3-1"


def test_the_level_follows_from_the_name_and_notes_do_not_linger(qtbot):
    card = TestCard()
    qtbot.addWidget(card)
    card.propose("FR1-L3-2")
    assert card.choice.target_ratio == 0.35
    card._notes.setPlainText("rain")
    card.propose("FR2-L4-R")
    assert card.choice.name == "FR2-L4-R"
    assert (card.choice.target_ratio, card.choice.notes) == (0.40, "")


def test_the_check_of_the_recorder_is_shown_with_the_worst_channel_on_top(window, rig):
    good = [ChannelCheck(c.id, c.family, (), 0.0, 1.0, 1.0, 0.0) for c in rig.channels]
    window._after(CheckMessage(check=SensorCheck(tuple(good))))
    assert window.prepare.verdict_text == "Go"
    row = rig.channel_ids.index("WP-3")
    bad = Finding("stuck", Verdict.NO_GO, "Stuck.")
    good[row] = ChannelCheck("WP-3", "wire", (bad,), 0.0, 0.0, 1.0, 0.0)
    window._after(CheckMessage(check=SensorCheck(tuple(good))))
    assert window.prepare.verdict_text == "No-go"
    model = window.prepare.table.check_model
    assert [model.data(model.index(0, c)) for c in (0, 1)] == ["No-go", "WP-3"]
    assert "Stuck" in window.prepare._detail.text()
    window._after(CheckMessage(check=None))
    assert window.prepare.verdict_text == "Not checked"
