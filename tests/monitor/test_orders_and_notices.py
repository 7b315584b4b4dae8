"""What may be ordered when, and what the window says to whoever ordered it."""

from __future__ import annotations

import shutil

import pytest

from daq_app.acquisition.checks.check_model import ChannelCheck, Finding, SensorCheck, Verdict
from daq_app.acquisition.course.tare import UNZEROED
from daq_app.acquisition.messages.published import CheckMessage, EventMessage, Judgement, Reply, State
from daq_app.campaign.plan import load_campaign
from daq_app.monitor.data.background import Background
from daq_app.monitor.look.state_look import SHAPES, look_of
from daq_app.monitor.widgets.actions import ActionBar
from daq_app.monitor.widgets.notices import NoticeLine


def test_every_state_has_its_own_shape_so_that_colour_is_not_needed():
    assert set(SHAPES) == set(State)
    assert len(set(SHAPES.values())) == len(SHAPES)
    lost = look_of(None, Judgement())
    assert (lost.word, "open it again" in lost.sentence) == ("No link", True)
    assert look_of(State.SAVED, Judgement(word="Not armed", alarm="arm first")).shape == "cross"


@pytest.mark.parametrize(
    ("state", "sampling", "enabled"),
    [
        (State.IDLE, False, {"preview", "next"}),
        (State.PREVIEWING, True, {"arm", "next", "marker", "note"}),
        (State.PREVIEWING, False, {"next"}),
        (State.ARMED, True, {"stop", "abort", "marker", "note"}),
        (State.HOLDING, True, {"stop", "abort", "marker", "note"}),
        (State.ROCKING, True, {"stop", "marker", "note"}),
        (State.AT_REST, True, {"stop", "marker", "note"}),
        (State.SAVING, True, set()),
        (State.SAVED, True, {"arm", "next"}),
        (State.FAILED, False, {"preview", "next"}),
        (None, False, set()),
    ],
)
def test_only_orders_that_make_sense_can_be_given(qtbot, state, sampling, enabled):
    bar = ActionBar()
    qtbot.addWidget(bar)
    bar.refresh(state, sampling=sampling, may_command=True)
    assert {name for name, button in bar.buttons.items() if button.isEnabled()} == enabled
    bar.refresh(state, sampling=sampling, may_command=False)
    assert not any(button.isEnabled() for button in bar.buttons.values())


def test_an_abort_must_be_ordered_twice_within_seconds(qtbot, clock):
    bar = ActionBar(clock)
    qtbot.addWidget(bar)
    bar.refresh(State.ARMED, sampling=True, may_command=True)
    orders, told = [], []
    bar.ordered.connect(orders.append)
    bar.told.connect(lambda _severity, text: told.append(text))
    button = bar.buttons["abort"]
    button.click()
    assert orders == [] and button.text() == "F8 again: abort"
    clock.now += 3.0
    bar.refresh(State.ARMED, sampling=True, may_command=True)
    assert button.text() == "Abort  F8" and "was not pressed again, so nothing was done" in told[-1]
    button.click()
    button.click()
    assert orders == ["abort"] and len(told) == 1


def test_orders_have_keys(qtbot):
    from PySide6.QtCore import Qt

    bar = ActionBar()
    qtbot.addWidget(bar)
    with qtbot.waitActive(bar):
        bar.show()
        bar.activateWindow()
    bar.refresh(State.PREVIEWING, sampling=True, may_command=True)
    with qtbot.waitSignal(bar.ordered) as ordered:
        qtbot.keyClick(bar, Qt.Key.Key_F5)
    assert ordered.args == ["arm"]


def test_arming_without_a_name_is_refused_with_what_to_do(window):
    window.orders.arm()
    assert window.notices.current == ("warning", "Give the test a name before arming.")


def test_the_next_test_is_taken_once_the_runs_are_read_and_its_notes_stay_until_it_is_taken(
    qtbot, window, configs, tmp_path, run_file
):
    """F6 had said that no campaign was open while it was being read; pressed again it lost what was typed."""
    shutil.copy(run_file, tmp_path)
    card = window.prepare.card
    card._notes.setPlainText("rain since noon")
    window.orders.set_campaign(load_campaign(configs / "campaigns" / "costa.toml"), tmp_path)
    window.orders.next_test()
    assert window.notices.current is None
    qtbot.waitUntil(lambda: card.choice.name == "FR1-L1-2", timeout=120_000)
    window.orders.next_test()
    assert (card.choice.name, card.choice.notes) == ("FR1-L1-2", "rain since noon")

    card._name.setText("FR1-L1-1")  # has been taken: its notes are not the next one's
    window.orders.next_test()
    assert (card.choice.name, card.choice.notes) == ("FR1-L1-2", "")


def test_a_no_go_must_be_overruled_on_purpose_and_in_time(qtbot, window, monkeypatch):
    bad = Finding("stuck", Verdict.NO_GO, "Stuck.")
    check = SensorCheck((ChannelCheck("WP-3", "wire", (bad,), 0.0, 0.0, 1.0, 0.0),))
    window._after(CheckMessage(check=check))
    window.prepare.card.propose("FR1-L3-1")
    asked = []
    monkeypatch.setattr(
        window.orders, "request", lambda name, arguments=None: asked.append((name, arguments))
    )
    window.orders.arm()
    assert (asked[-1][1]["test"], asked[-1][1]["overrule"]) == ("FR1-L3-1", 0.0)
    window._on_reply("arm", Reply(ok=False, text="Not armed: the sensor check says no-go."))
    assert window.notices.current[1].startswith("Not armed")
    window.orders.arm()
    assert asked[-1][1]["overrule"] == 1.0
    window._on_reply("arm", Reply(ok=False, text="Not armed: the sensor check says no-go."))
    window.orders._overrule_timer.setInterval(1)
    window.orders._overrule_timer.start()
    qtbot.waitUntil(lambda: not window.orders._overrule_timer.isActive())
    assert any("was not pressed again" in told.text for told in window.notices.log)
    window.orders.arm()
    assert asked[-1][1]["overrule"] == 0.0, "what has run out must be asked for again"


@pytest.mark.parametrize(
    ("kind", "data"),
    [("alarm", {"alarm": "silence"}), ("travel", {}), ("overload", {}), ("check", {})],
)
def test_a_warning_leaves_when_its_trouble_is_over_and_stays_in_the_log(window, kind, data):
    begins = EventMessage(kind=kind, sample=1, text="no samples", severity="error", data=data)
    window._after(begins)
    assert window.notices.current == ("error", "no samples")
    window._after(begins.model_copy(update={"text": "samples again", "severity": "info"}))
    assert ("error", "no samples") not in window.notices._queue
    told = next(told for told in window.notices.log if told.text == "no samples")
    assert told.over is not None and told.over >= told.at


def test_a_doubted_channel_is_settled_by_a_check_that_finds_it_good(window):
    """Its plug was mended: no event says so, the next check does."""
    for name in ("LV-A04", "LV-A05"):
        doubt = {"channel": name, "doubt": "stuck"}
        text = f"{name} does not change any more"
        window._after(EventMessage(kind="channel", sample=1, text=text, severity="warning", data=doubt))
    bad = Finding("stuck", Verdict.NO_GO, "Stuck")
    channels = tuple(
        ChannelCheck(name, "lvdt", findings, 0.0, 1e-5, 1e-5, 0.0)
        for name, findings in (("LV-A04", ()), ("LV-A05", (bad,)))
    )
    window._after(CheckMessage(check=SensorCheck(channels)))
    assert [text[:6] for _, text in window.notices._queue] == ["LV-A05"]


def test_a_refusal_leaves_once_the_order_is_obeyed(window, monkeypatch):
    """ "Not armed" beside "Armed" would be one word too many."""
    monkeypatch.setattr(window.orders, "request", lambda name, more=None: None)
    window.session.set_zeroed(False)
    window.prepare.card.propose("FR1-L3-1", 0.35)
    window.orders.arm()
    window._on_reply("arm", Reply(ok=False, text="Not armed: the sensor check says no-go."))
    window.orders._on_overrule_over()
    assert window.notices.current[1].startswith("Not armed: F5 was not pressed again")
    window._on_reply("arm", Reply(ok=True, text="Armed and recording"))
    assert not [text for _, text in window.notices._queue if text.startswith("Not armed")]
    assert window.notices.current == ("warning", UNZEROED)
    window._on_reply("tare", Reply(ok=True, text="The zero has been taken", data={"tare": {"WP-1": 0.1}}))
    assert window.notices.current[0] == "info"


def test_a_note_is_typed_in_a_line_not_in_a_box(qtbot, window, monkeypatch):
    from PySide6.QtCore import Qt

    asked = []
    monkeypatch.setattr(window.orders, "request", lambda name, more=None: asked.append((name, more)))
    window.actions_bar.refresh(State.ROCKING, sampling=True, may_command=True)
    window.actions_bar.buttons["note"].click()
    assert not window.note_entry.isHidden()
    qtbot.keyClicks(window.note_entry.line, "stone fell at B")
    qtbot.keyClick(window.note_entry.line, Qt.Key.Key_Escape)
    assert window.note_entry.isHidden() and asked == []
    window.actions_bar.buttons["note"].click()
    qtbot.keyClick(window.note_entry.line, Qt.Key.Key_Return)
    assert asked == [("note", {"text": "stone fell at B"})]
    assert window.note_entry.isHidden() and window.note_entry.line.text() == ""


def test_errors_stay_in_front_until_they_are_read(qtbot):
    line = NoticeLine()
    qtbot.addWidget(line)
    line.tell("info", "zero taken")
    line.tell("error", "the disk is full")
    line.tell("error", "the disk is full")
    line.tell("info", "marker written")
    assert line.current == ("error", "the disk is full")
    line.dismiss()
    assert line.current == ("info", "marker written")
    line.dismiss()
    assert line.current is None
    assert line.isHidden()


def test_events_that_matter_are_told_and_routine_ones_are_not(window):
    window._after(EventMessage(kind="impact", sample=1, text="impact 3"))
    window._after(EventMessage(kind="rocking", sample=1, text="rocking"))
    assert window.notices.current is None
    window._after(EventMessage(kind="gap", sample=1, text="400 samples lost", severity="error"))
    assert window.notices.current == ("error", "400 samples lost")


def test_a_background_failure_is_handed_back_not_swallowed(qtbot):
    background = Background()
    failures = []

    def fail():
        raise ValueError("no")

    background.run(fail, lambda _: None, failures.append)
    qtbot.waitUntil(lambda: bool(failures), timeout=60_000)
    assert isinstance(failures[0], ValueError)
    assert not background.busy
