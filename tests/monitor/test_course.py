"""The picture of the test's course and what is heard with it: all words are there, whole, and true."""

from __future__ import annotations

import pytest

from daq_app.acquisition.messages.published import (
    Call,
    EventMessage,
    HealthMessage,
    Judgement,
    State,
    StateMessage,
)
from daq_app.monitor.course.course_view import CourseView
from daq_app.monitor.course.cues import Cue, CueWatch
from daq_app.monitor.course.gauge_words import target_words
from daq_app.monitor.course.sounds import PATTERNS_MS, Sounds
from daq_app.monitor.data.session import Published
from daq_app.monitor.pages.messages_page import MessagesPage
from daq_app.monitor.widgets.notices import NoticeLine
from daq_app.runfile import TestPlan
from tests.support.window.quiet_link import QuietLink

HOLD = Judgement(
    call=Call.HOLD,
    word="Holding",
    do="On target: hold still, 2 s more.",
    tone="good",
    gauge="On target: hold",
    target=0.35,
    low=0.3325,
    high=0.3675,
    held_s=1.2,
    hold_s=3.0,
)


@pytest.fixture
def live_window(qtbot, settings, configs, clock):
    from daq_app.monitor.window.main_window import MainWindow

    window = MainWindow(QuietLink(configs / "fr1.toml"), settings)
    qtbot.addWidget(window)
    window._frame_timer.stop()
    window._slow_timer.stop()
    window.session.clock = clock
    return window


def say(session, clock, state, judgement) -> None:
    session.feed(Published(StateMessage(state=state, judgement=judgement), clock.now))


def health(sample: int) -> HealthMessage:
    """Everything read before `sample` is on disk but the last hundred samples."""
    counts = dict.fromkeys(("backlog_samples", "buffer_samples", "gaps", "lost_samples"), 0)
    return HealthMessage(sample=sample, acknowledged_sample=sample - 100, recording=True, **counts)


@pytest.mark.parametrize(("width", "height"), [(1200, 600), (700, 420), (1920, 1080)])
@pytest.mark.parametrize("moving", [False, True])
def test_nothing_on_the_picture_is_wider_than_its_place(qtbot, window, stand_in, play, width, height, moving):
    play(window.session, window.clock, stand_in, stand_in.release_s + (3.0 if moving else -1.0))
    if not moving:
        say(window.session, window.clock, State.HOLDING, HOLD)
    view = CourseView(window.session)
    view.footer = "⚠ A message that is rather long, as those are that say what happened and what to do."
    qtbot.addWidget(view)
    view.resize(width, height)
    view.grab()
    for written in view.written.written:
        assert written.needs.width() <= written.box.width() + 1, written
        assert written.needs.height() <= written.box.height() + 1, written
    shown = " ".join(view.texts)
    if moving:
        estimate = window.session.estimate
        assert f"{estimate.eav_mean:.3f}" in shown and f"{estimate.crt_mean:.3f}" in shown
        assert str(len(estimate.impact_samples)) in view.texts
    else:
        assert {"Holding", "On target: hold", "2 s", HOLD.do} <= set(view.texts)


def test_figures_that_are_not_live_are_dashes(qtbot, window, stand_in, play):
    play(window.session, window.clock, stand_in, stand_in.release_s - 1.0)
    window.clock.now += 1.0
    view = CourseView(window.session)
    qtbot.addWidget(view)
    view.grab()
    assert "The rotation is not live" in view.texts
    assert view.texts.count("–") == 5


LOOK = Judgement(call=Call.LOOK, word="Saved", do="Look", tone="good", target=0.25, low=0.2375, high=0.2625)


def test_after_a_test_its_motion_stays_and_the_next_target_is_called_the_next(
    qtbot, window, stand_in, play, clock
):
    session = window.session
    view = CourseView(session)
    qtbot.addWidget(view)
    play(session, clock, stand_in, stand_in.end_s)
    clock.now += 0.6  # the disk has the last of it
    plan = TestPlan(test="FR1-L3-1", theta0_over_alpha=0.25)
    saved = StateMessage(state=State.SAVED, test="FR1-L3-1", plan=plan, judgement=LOOK)
    session.feed(Published(saved, clock.now))
    view.grab()
    assert {"since release", "FR1-L3-1   checked and closed"} <= set(view.texts)
    assert target_words(session) == "target 0.25  (0.237 to 0.263)"
    session.feed(Published(saved.model_copy(update={"plan": TestPlan(test="FR1-L2-1")}), clock.now))
    assert target_words(session).startswith("next test FR1-L2-1: target 0.25")

    # The wall is pulled again: what counts now is how far.
    arm = LOOK.model_copy(update={"call": Call.ARM_FIRST, "gauge": "Not armed", "alarm": "arm"})
    session.feed(Published(saved.model_copy(update={"judgement": arm}), clock.now))
    view.grab()
    assert "since release" not in view.texts and "θ/α" in view.texts


def test_each_change_is_heard_once_and_danger_until_it_is_over(window, clock):
    session, watch = window.session, CueWatch()
    pull = HOLD.model_copy(update={"call": Call.PULL})
    stop = HOLD.model_copy(update={"call": Call.STOP, "alarm": "STOP"})
    free = Judgement(call=Call.KEEP_CLEAR)

    def heard(state, judgement):
        say(session, clock, state, judgement)
        return watch.look(session)

    assert heard(State.ARMED, pull) == []
    assert heard(State.HOLDING, HOLD) == [Cue.ON_TARGET]
    assert heard(State.HOLDING, HOLD.model_copy(update={"call": Call.RELEASE})) == []
    assert heard(State.ARMED, stop) == [Cue.ALARM]
    assert heard(State.ARMED, stop) == []
    clock.now += 3.1
    assert heard(State.ARMED, stop) == [Cue.ALARM]
    assert heard(State.RELEASED, free) == [Cue.RELEASED]
    assert heard(State.ROCKING, free) == []
    assert heard(State.AT_REST, Judgement(call=Call.WAIT)) == [Cue.AT_REST]


def test_a_recording_that_stops_reaching_the_disk_is_heard(window, stand_in, play):
    session, watch = window.session, CueWatch()
    play(session, window.clock, stand_in, stand_in.release_s - 1.0)
    assert Cue.RECORDING_LOST not in watch.look(session)
    window.clock.now += 1.0
    assert watch.look(session)[0] is Cue.RECORDING_LOST
    window.clock.now += 5.0
    assert session.current_state is None
    assert watch.look(session)[0] is Cue.RECORDING_LOST, "a lost link in a test is no less grave"


def test_cues_differ_and_can_be_switched_off(qtbot):
    assert len(set(PATTERNS_MS.values())) == len(Cue)
    beeps: list[int] = []
    sounds = Sounds(lambda: beeps.append(1))
    sounds.play([Cue.RELEASED])
    qtbot.waitUntil(lambda: len(beeps) == len(PATTERNS_MS[Cue.RELEASED]))
    sounds.on = False
    sounds.play([Cue.ALARM])
    qtbot.wait(20)
    assert len(beeps) == len(PATTERNS_MS[Cue.RELEASED])


def test_arming_and_release_bring_the_gauge_and_live_stays_where_it_was_chosen(live_window, clock):
    window = live_window
    for chosen, expected in ((window.campaign, window.test), (window.live, window.live)):
        for state in (State.ARMED, State.RELEASED):
            window.show_page(chosen)
            window._after(StateMessage(state=state))
            assert window.stack.currentWidget() is expected
        window._after(StateMessage(state=State.PREVIEWING))


def test_strip_and_picture_say_one_word_however_long_a_drawing_takes(live_window, clock):
    window = live_window
    window.moment.source, window.session.clock = clock, window.moment
    words = set()
    for sample in range(0, 40_000, 4000):
        window.link.inbox = [
            Published(StateMessage(state=State.ARMED, armed=True), clock.now - 0.9),
            Published(health(sample + 4000), clock.now - 0.1),
        ]
        window._on_frame()
        clock.now += 0.7  # a drawing takes so long
        window._on_slow()
        window.test.view.grab()
        clock.now += 0.3
        words.add(window.header.words["recording"])
        assert window.header.words["recording"] in window.test.view.texts
    assert words == {"Recording"}


def test_a_link_that_is_lost_is_seen_though_the_window_draws_on(live_window, clock):
    window = live_window
    window.moment.source, window.session.clock = clock, window.moment
    window.link.inbox = [
        Published(StateMessage(state=State.ARMED, armed=True), clock.now),
        Published(health(4000), clock.now),
    ]
    window._on_frame()
    assert window.header.words["recording"] == "Recording"
    clock.now += 0.6
    window._on_frame()
    assert window.header.words["recording"] == "Not confirmed"


@pytest.mark.parametrize("state", [State.HOLDING, State.ROCKING, State.AT_REST])
def test_a_window_that_comes_during_a_test_has_the_gauge_in_front(live_window, state):
    live_window._after(StateMessage(state=state))
    assert live_window.stack.currentWidget() is live_window.test


@pytest.mark.parametrize(
    ("name", "made", "waits"),
    [("FR1-L1-1_1.h5", False, True), ("FR1-L1-1_1.h5", True, False), ("unarmed_1.h5", False, False)],
)
def test_the_result_is_waited_for_only_where_the_recorder_will_tell_of_it(
    live_window, tmp_path, monkeypatch, name, made, waits
):
    opened = []
    monkeypatch.setattr(live_window.result, "open", lambda run, *, soon: opened.append(soon))
    monkeypatch.setattr(live_window.replay, "open", lambda run: None)
    live_window.adoption.makes_results = True
    run = tmp_path / name
    run.touch()
    if made:
        run.with_suffix(".result.json").touch()
    look = Judgement(call=Call.LOOK, word="Saved", do="Look", tone="good")
    live_window._after(StateMessage(state=State.SAVED, run_path=str(run), judgement=look))
    assert opened == [waits]


def test_the_full_screen_opens_gives_orders_and_goes_back(qtbot, live_window, clock):
    from PySide6.QtCore import Qt

    window = live_window
    window.show()
    say(window.session, clock, State.ARMED, HOLD)
    window._on_slow()
    window.display.toggle()
    screen = window.display.full_screen
    assert screen.covers, "one display: the picture covers the window"
    with qtbot.waitActive(screen):
        screen.activateWindow()
    window.notices.tell("warning", "the disk is slow")
    window.display.refresh()
    assert "the disk is slow" in screen.view.footer
    window.notices.dismiss()
    window.display.refresh()
    assert "Abort  F8" in screen.view.footer
    for _ in range(2):
        qtbot.keyClick(screen, Qt.Key.Key_F8)
    assert ("abort", {}) in window.link.orders
    with qtbot.waitSignal(screen.closed):
        qtbot.keyClick(screen, Qt.Key.Key_Escape)
    assert window.display.full_screen is None
    assert window.test.list_displays()[0].startswith("Display 1")


@pytest.mark.parametrize("call", [Call.ARM_FIRST, Call.STOP])
def test_the_record_of_the_last_test_is_no_record_of_the_wall_that_is_pulled_now(live_window, clock, call):
    plan = TestPlan(test="FR1-L1-2")
    saved = StateMessage(
        state=State.SAVED, test="FR1-L1-1", plan=plan, judgement=Judgement(call=Call.LOOK, word="Saved")
    )
    live_window.session.feed(Published(saved, clock.now))
    live_window.header.refresh(live_window.colours)
    assert (live_window.header.words["recording"], live_window.header.words["test"]) == (
        "On disk",
        "FR1-L1-1",
    )
    live_window.test.view.resize(900, 560)
    live_window.test.view.grab()
    assert "FR1-L1-1   checked and closed" in live_window.test.view.texts
    pulled = saved.model_copy(update={"judgement": Judgement(call=call, word="Not armed", alarm="Arm first")})
    live_window.session.feed(Published(pulled, clock.now))
    live_window.header.refresh(live_window.colours)
    live_window.test.view.grab()
    assert live_window.header.words["recording"] == "Not recording"
    assert live_window.header.words["test"] == "FR1-L1-2"
    assert "FR1-L1-2" in live_window.test.view.texts and "On disk" not in live_window.test.view.texts


def test_a_key_that_makes_no_sense_now_is_answered(qtbot, live_window, clock):
    say(live_window.session, clock, State.ARMED, HOLD)
    live_window._on_slow()
    from daq_app.monitor.widgets.actions import ACTIONS

    live_window.actions_bar.press(next(action for action in ACTIONS if action.name == "next"))
    assert live_window.notices.current == ("info", f"Next test: not now. {HOLD.do}")
    clock.now += 10.0
    live_window.actions_bar.press(next(action for action in ACTIONS if action.name == "arm"))
    assert "Arm: not now. Nothing is heard from the recorder" in live_window.notices.current[1]


@pytest.mark.parametrize("may_command", [True, False])
def test_a_watching_window_gives_no_orders(qtbot, settings, configs, clock, stand_in, play, may_command):
    from daq_app.monitor.window.main_window import MainWindow

    window = MainWindow(QuietLink(configs / "fr1.toml", may_command=may_command), settings)
    qtbot.addWidget(window)
    window._frame_timer.stop()
    window._slow_timer.stop()
    window.session.clock = clock
    play(window.session, clock, stand_in, 2.0)
    window._on_slow()
    window.prepare.refresh()
    given = [*window.actions_bar.buttons.values(), window.prepare.tare_button, window.prepare.check_button]
    assert any(button.isEnabled() for button in given) is may_command
    assert window.prepare.tare_button.isEnabled() is window.prepare.check_button.isEnabled() is may_command


def test_a_key_of_a_page_that_has_nothing_to_do_it_with_is_answered(qtbot, live_window):
    from PySide6.QtCore import Qt

    with qtbot.waitActive(live_window):
        live_window.show()
        live_window.activateWindow()
    live_window.show_page(live_window.result)
    qtbot.keyClick(live_window.result, Qt.Key.Key_O, Qt.KeyboardModifier.ControlModifier)
    assert live_window.notices.current == ("info", "Page: not yet. There is nothing that it could act on.")


def test_the_log_keeps_what_was_told_and_when_it_was_over(qtbot):
    notices = NoticeLine()
    page = MessagesPage(notices)
    for part in (notices, page):
        qtbot.addWidget(part)
    notices.tell("error", "no samples", "alarm silence")
    notices.tell("info", "zero taken")
    notices.settle("alarm silence")
    model = page.table.model()
    rows = [[model.index(row, column).data() for column in range(4)] for row in range(model.rowCount())]
    assert [row[3] for row in rows] == ["zero taken", "no samples"]
    assert rows[0][1] == "" and rows[1][1] >= rows[1][0]
    assert notices.current == ("info", "zero taken")


def test_the_live_page_keeps_the_record_of_the_last_test_until_the_next_arming(window, stand_in, play):
    play(window.session, window.clock, stand_in, stand_in.release_s + 3.0)
    say(window.session, window.clock, State.SAVED, Judgement(call=Call.LOOK))
    window.live.draw_frame()
    x, y = (values.copy() for values in window.live.motion.rotation.line)
    assert x.size > 100 and x[0] >= -1.001
    window.session._forget_data()  # the tasks were started anew, or the trace has gone on without the test
    window.live.draw_frame()
    again = window.live.motion.rotation.line
    assert (again[0] == x).all() and (again[1] == y).all()
    say(window.session, window.clock, State.ARMED, HOLD)
    window.live.draw_frame()
    window.live.show_estimate()
    assert not window.live.motion.rotation.line[0].size
    assert window.live.restitution.shown == {"eav": 0, "crt": 0}
    assert all(not len(curve.getData()[0]) for curve in window.live.restitution._means.values())


def test_a_warning_that_is_over_leaves_the_line(live_window):
    begins = EventMessage(kind="disk", sample=1, text="the disk is slow", severity="warning")
    live_window._after(begins)
    live_window._after(begins.model_copy(update={"text": "caught up", "severity": "info"}))
    assert live_window.notices.current != ("warning", "the disk is slow")
