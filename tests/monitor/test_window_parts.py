"""The parts of the window, each driven by hand: what is enabled, shown, remembered and asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.acquisition.messages import (
    EstimateMessage,
    EstimatePoint,
    EventMessage,
    HealthMessage,
    State,
    StateMessage,
)

# qtbot: this module needs Qt; tests/monitor/conftest.py skips it where Qt cannot start.
from daq_app.monitor.actions import ActionBar
from daq_app.monitor.background import Background
from daq_app.monitor.main_window import MainWindow
from daq_app.monitor.notices import NoticeLine
from daq_app.monitor.plot_base import envelope
from daq_app.monitor.pull_gauge import pull_advice
from daq_app.monitor.session import Published
from daq_app.monitor.settings import WindowSettings
from daq_app.monitor.state_look import LOOKS, look_of
from daq_app.monitor.strip_panel import arrange
from daq_app.monitor.test_card import TestCard


class Clock:
    now = 50.0

    def __call__(self):
        return self.now


@pytest.fixture
def window(qtbot, settings, rig):
    """A window without a link, whose session a test feeds by hand."""
    window = MainWindow(None, settings)
    qtbot.addWidget(window)
    window._frame_timer.stop()
    window._slow_timer.stop()
    clock = Clock()
    window.session.clock = clock
    window.clock = clock
    window.session.set_rig(rig, 4000.0)
    window.prepare.set_rig(rig)
    window.header.show()
    return window


def play(window, stand_in, until_s):
    start = window.clock.now
    for instant in stand_in.instants(until_s):
        window.clock.now = start + instant.time_s
        for message, readings in instant.messages:
            window.session.feed(Published(message, window.clock.now, readings))


# -- states and orders ---------------------------------------------------------------------------


def test_every_state_has_its_own_word_and_shape_so_that_colour_is_not_needed():
    words = [look.word for look in LOOKS.values()]
    assert set(LOOKS) == set(State)
    assert len(set(words)) == len(words)
    assert len({(look.shape, look.tone) for look in LOOKS.values()}) == len(LOOKS)
    assert look_of(None).word == "No link"


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


def test_an_abort_must_be_ordered_twice_within_seconds(qtbot):
    clock = Clock()
    bar = ActionBar(clock)
    qtbot.addWidget(bar)
    bar.refresh(State.ARMED, sampling=True, may_command=True)
    orders = []
    bar.ordered.connect(orders.append)
    button = bar.buttons["abort"]
    button.click()
    assert orders == [] and button.text() == "F8 again: abort"
    clock.now += 3.0
    bar.refresh(State.ARMED, sampling=True, may_command=True)
    assert button.text() == "Abort  F8"
    button.click()
    button.click()
    assert orders == ["abort"]


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


# -- notices -------------------------------------------------------------------------------------


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


def test_a_background_failure_is_handed_back_not_swallowed(qtbot):
    background = Background()
    failures = []

    def fail():
        raise ValueError("no")

    background.run(fail, lambda _: None, failures.append)
    qtbot.waitUntil(lambda: bool(failures), timeout=60_000)
    assert isinstance(failures[0], ValueError)
    assert not background.busy


# -- the live page -------------------------------------------------------------------------------


def test_the_live_page_draws_what_the_session_knows(window, stand_in):
    play(window, stand_in, stand_in.release_s + 3.0)
    live = window.live
    live.motion.set_target(0.35 * window.session.alpha_rad)
    live.theory_button.setChecked(True)
    live.draw_frame()
    live.draw_slow()
    estimate = window.session.estimate
    assert live.restitution.shown == {"eav": len(estimate.eav), "crt": len(estimate.crt)}
    assert len(live.motion._impacts.data) == len(estimate.impact_samples)
    x, y = live.motion._curves[0].getData()
    expected, _ = stand_in.rotation(np.asarray(x) + stand_in.release_s)
    np.testing.assert_allclose(y, 1e3 * expected, atol=1.0)
    assert live.motion.theory_caption() == f"Housner with r = {estimate.crt_mean:.3f} (CRT)"
    assert live.counters.tiles["impacts"].value == str(len(estimate.impact_samples))


def test_theory_with_the_right_r_lies_on_the_measured_motion(window, stand_in):
    play(window, stand_in, stand_in.release_s + 4.0)
    live = window.live
    live.theory_button.setChecked(True)
    live.draw_frame()
    x, y = live.motion._theory[0].getData()
    measured, _ = stand_in.rotation(np.asarray(x) + stand_in.release_s)
    until = np.asarray(x) < 3.0
    assert (
        np.max(np.abs(np.asarray(y) - 1e3 * measured)[until]) < 6.0
    )  # mrad, of 75: r is found to half a percent


def test_a_silent_acquisition_is_shown_as_not_live(window, stand_in):
    play(window, stand_in, 6.0)
    window.header.refresh(window.colours)
    assert "Armed" in window.header.words["state"]
    window.clock.now += 0.8
    window.live.draw_frame()
    window._on_slow()
    assert window.live.motion._notice.toPlainText().startswith("Not live")
    assert "not live" in window.header.words["sentence"]
    assert window.header.words["recording"] == "Not confirmed"
    assert all(text == "–" for text in window.health.texts)
    window.clock.now += 3.0
    window.header.refresh(window.colours)
    assert window.header.words["state"] == "No link"


def test_the_strips_keep_an_impact_that_lasts_one_sample(window, stand_in, rig):
    play(window, stand_in, 3.0)
    row = rig.channel_ids.index("AC-1")
    assert np.nanmax(window.session.strips.columns()[1][row]) < 1.0
    from daq_app.acquisition.messages import BlockMessage

    block = np.zeros((41, 400), dtype=np.float32)
    block[row, 177] = 40.0
    heading = BlockMessage(first_sample=12000, n_samples=400, n_channels=41, rate_hz=4000.0)
    window.session.feed(Published(heading, window.clock.now, block))
    assert np.nanmax(window.session.strips.columns()[1][row]) == 40.0
    window.show_page(window.live)
    window.live.strips.resize(1240, 180)
    image = window.live.strips.grab().toImage()
    assert image.width() > 0 and window.live.strips.paints > 0


@pytest.mark.parametrize("size", [(1240, 160), (1800, 260), (1240, 620), (700, 300)])
def test_all_41_strips_have_their_own_place_inside_the_panel(rig, size):
    cells, titles = arrange(rig, *size)
    assert sorted(cell.index for cell in cells) == list(range(41))
    assert [family for family, _ in titles] == ["lvdt", "wire", "accelerometer", "tiltmeter"]
    for place, cell in enumerate(cells):
        assert cell.box.right() <= size[0] + 0.5 and cell.box.bottom() <= size[1] + 0.5
        assert cell.box.height() > 15
        assert not any(cell.box.intersects(other.box) for other in cells[place + 1 :])


def test_drawing_decimation_keeps_every_extreme():
    rng = np.random.default_rng(2)
    y = rng.normal(size=20_000)
    y[777], y[13_131] = 50.0, -60.0
    y[5000:5100] = np.nan
    x = np.arange(y.size) / 4000
    dx, dy = envelope(x, y, 600)
    assert dx.size < 2500 and (np.diff(dx) >= 0).all()
    assert np.nanmax(dy) == 50.0 and np.nanmin(dy) == -60.0
    short = envelope(x[:100], y[:100], 600)
    np.testing.assert_array_equal(short[1], y[:100])


def test_the_running_mean_is_the_one_that_the_acquisition_tells(window):
    def heard(impacts, mean, error, release=1000):
        points = [EstimatePoint(impact=k + 1, r=0.9) for k in range(impacts)]
        estimate = EstimateMessage(
            theta0_rad=0.07,
            release_sample=release,
            impact_samples=[1000.0 + k for k in range(impacts)],
            peaks_rad=[0.07] * (impacts + 1),
            impact_velocities_rad_s=[0.1] * impacts,
            eav=[],
            crt=points,
            crt_mean=mean,
            crt_standard_error=error,
            r_max=0.93,
        )
        window.session.feed(Published(estimate, window.clock.now))

    heard(1, 0.91, None)
    heard(3, 0.92, 0.004)
    impacts, mean, error = window.session.running_mean("crt")
    assert (impacts.tolist(), mean.tolist(), error.tolist()) == ([1, 3], [0.91, 0.92], [0.0, 0.004])
    assert window.session.running_mean("eav")[0].size == 0
    window.live.restitution.draw()
    assert window.live.restitution._means["crt"].getData()[1].tolist() == [0.91, 0.92]
    heard(1, 0.80, None, release=9000)
    assert window.session.running_mean("crt")[1].tolist() == [0.80]


# -- preparing -----------------------------------------------------------------------------------


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


def test_the_check_ends_in_a_verdict_with_the_worst_channel_on_top(qtbot, window, stand_in, rig):
    play(window, stand_in, 3.5)
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


# -- habits --------------------------------------------------------------------------------------


def test_theme_type_size_and_layout_are_remembered(qtbot, settings, tmp_path):
    window = MainWindow(None, settings)
    qtbot.addWidget(window)
    window.resize(780, 740)  # within the screen that Qt has without a display
    window.toggle_theme()
    window.change_type_size(2)
    window.close()
    again = WindowSettings(tmp_path / "window.ini")
    assert (again.theme, again.type_size) == ("light", 13.0)
    second = MainWindow(None, again)
    qtbot.addWidget(second)
    assert (second.width(), second.height()) == (780, 740)


def test_nonsense_in_the_settings_file_falls_back(tmp_path):
    path = tmp_path / "window.ini"
    path.write_text("[General]\ntheme=pink\ntype_size=huge\n[overturning]\nalarm_ratio=7\n", encoding="utf-8")
    settings = WindowSettings(path)
    assert (settings.theme, settings.type_size) == ("dark", 10.0)
    assert settings.alarm_levels.alarm == 0.65


def test_events_that_matter_are_told_and_routine_ones_are_not(window):
    window._after(EventMessage(kind="impact", sample=1, text="impact 3"))
    window._after(EventMessage(kind="rocking", sample=1, text="rocking"))
    assert window.notices.current is None
    window._after(EventMessage(kind="gap", sample=1, text="400 samples lost", severity="error"))
    assert window.notices.current == ("error", "400 samples lost")


def test_arming_without_a_name_is_refused_with_what_to_do(window):
    window.orders.arm()
    assert window.notices.current == ("warning", "Give the test a name before arming.")


def test_recording_light_says_when_the_disk_is_behind(window):
    window.session.feed(Published(StateMessage(state=State.ARMED), window.clock.now))
    health = HealthMessage(
        sample=20_000,
        acknowledged_sample=8_000,
        recording=True,
        backlog_samples=0,
        buffer_samples=80_000,
        gaps=0,
        lost_samples=0,
    )
    window.session.feed(Published(health, window.clock.now))
    window.header.refresh(window.colours)
    assert window.header.words["recording"] == "Disk is slow"
    assert window.header.words["recording_detail"] == "3.0 s wait for the disk"


def test_a_no_go_must_be_overruled_on_purpose(window, monkeypatch):
    from daq_app.campaign.check_model import ChannelCheck, Finding, SensorCheck, Verdict

    bad = Finding("stuck", Verdict.NO_GO, "Stuck.")
    window.prepare.check = SensorCheck((ChannelCheck("WP-3", "wire", (bad,), 0.0, 0.0, 1.0, 0.0),))
    window.prepare.card.propose("FR1-L3-1")
    asked = []
    monkeypatch.setattr(
        window.orders, "request", lambda name, arguments=None: asked.append((name, arguments))
    )
    window.orders.arm()
    assert asked == []
    assert "no-go" in window.notices.current[1]
    window.orders.arm()
    assert asked[0][1]["test"] == "FR1-L3-1"
    assert "Sensor check: no-go" in asked[0][1]["notes"]


def test_axes_say_what_they_show_also_after_a_change_of_theme(window, stand_in):
    play(window, stand_in, stand_in.release_s + 2.0)
    window.live.draw_frame()
    for _ in range(2):
        window.toggle_theme()
    for plot in (
        window.live.motion.velocity,
        window.live.motion.rotation,
        window.live.periods,
        window.live.phase,
    ):
        for name in ("left", "bottom", "right"):
            assert plot.plot_item.getAxis(name).autoSIPrefixScale == 1.0
    assert window.live.motion.velocity.plot_item.getAxis("bottom").labelText == "time since release  (s)"


# -- truth ---------------------------------------------------------------------------------------


def test_an_r_without_a_zero_says_so_in_words(window, stand_in):
    window.session.set_zeroed(False)
    play(window, stand_in, stand_in.release_s + 4.0)
    window.live.draw_slow()
    tile = window.live.counters.tiles["crt"]
    assert "no zero" in tile.detail and "3 %" in tile.detail
    assert "No zero has been taken" in window.live._caption.text()
    # A zero that is taken afterwards does not mend what this run has shown.
    window.session.feed(Published(StateMessage(state=State.SAVED), window.clock.now))
    window.session.set_zeroed(True)
    window.live.draw_slow()
    assert "no zero" in tile.detail


def test_a_standard_error_that_rounds_to_nothing_is_not_shown_as_none(window, stand_in):
    window.session.set_zeroed(True)
    play(window, stand_in, stand_in.release_s + 4.0)
    estimate = window.session.estimate
    sure = estimate.model_copy(update={"crt_standard_error": 2e-6, "eav_standard_error": 0.0021})
    window.session.feed(Published(sure, window.clock.now))
    window.live.draw_slow()
    assert window.live.counters.tiles["crt"].detail.startswith("± < 0.0001")
    assert window.live.counters.tiles["eav"].detail.startswith("± 0.0021")


def test_a_window_opened_in_mid_run_dates_the_recording_from_its_arming(window):
    past = [
        {"kind": "armed", "sample": 40_000, "text": "Armed", "severity": "info"},
        {"kind": "recovered", "sample": 0, "text": "Left by an earlier session", "severity": "warning"},
    ]
    window._adopt_past(past)
    assert window.notices.current == ("warning", "Left by an earlier session")
    window.session.feed(Published(StateMessage(state=State.ROCKING), window.clock.now))
    health = HealthMessage(
        sample=60_400,
        acknowledged_sample=60_000,
        recording=True,
        backlog_samples=0,
        buffer_samples=80_000,
        gaps=0,
        lost_samples=0,
    )
    window.session.feed(Published(health, window.clock.now))
    window.header.refresh(window.colours)
    assert window.header.words["recording_detail"] == "5.0 s safe on disk"
    window.live.draw_slow()
    assert window.live.counters.tiles["impacts"].value == "–"
    assert window.live.counters.tiles["elapsed"].detail == "no impact heard yet"


def test_a_value_that_goes_stale_leaves_the_screen_with_the_next_frame(window, stand_in):
    play(window, stand_in, 3.0)
    window.stack.addWidget(window.live)  # a window without a link has no live page
    window.stack.setCurrentWidget(window.live)
    window._on_frame()
    assert window.live.counters.tiles["rotation"].detail != "not live"
    window.clock.now += 0.51
    window._on_frame()
    assert window.live.counters.tiles["rotation"].detail == "not live"
    assert all(text == "–" for text in window.health.texts)


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


@pytest.mark.parametrize("points", [10.0, 13.0, 15.0])
def test_the_window_fits_the_smallest_screen_that_is_promised(window, points):
    for part in (window.header, window.actions_bar.parentWidget()):
        part.show()
    for page in (window.prepare, window.live):
        window.stack.addWidget(page)
    window.settings.type_size = points
    window.restyle()
    window.show()  # only then the style sheet counts
    window.replay._facts.setText(
        "FR1-L3-2_20261121T160353-314Z.h5 · 25.3 s at 4000 Hz · 41 channels · no gap"
    )
    window.repaint()
    hint = window.centralWidget().minimumSizeHint()
    assert hint.width() <= 1366 and hint.height() <= 768
