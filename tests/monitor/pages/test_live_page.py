"""The live page draws what the session knows, and nothing that is not true."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.acquisition.messages.published import (
    BlockMessage,
    EstimateMessage,
    EstimatePoint,
    HealthMessage,
    State,
    StateMessage,
)
from daq_app.monitor.data.session import Published
from daq_app.monitor.plots.plot_base import envelope
from daq_app.monitor.plots.strip_panel import arrange


def recorded(sample: int, *, safe: int) -> HealthMessage:
    """A recording that has read up to one sample and has it on disk up to another."""
    return HealthMessage(
        sample=sample,
        acknowledged_sample=safe,
        recording=True,
        backlog_samples=0,
        buffer_samples=80_000,
        gaps=0,
        lost_samples=0,
    )


def test_the_live_page_draws_what_the_session_knows(window, stand_in, play):
    play(window.session, window.clock, stand_in, stand_in.release_s + 3.0)
    live = window.live
    live.motion.set_target(0.35 * window.session.alpha_rad)
    live.theory_button.setChecked(True)
    live.draw_frame()
    live.draw_slow()
    estimate = window.session.estimate
    assert live.restitution.shown == {"eav": len(estimate.eav), "crt": len(estimate.crt)}
    assert len(live.motion._impacts.data) == len(estimate.impact_samples)
    x, y = live.motion.rotation.line
    expected, _ = stand_in.rotation(np.asarray(x) + stand_in.release_s)
    np.testing.assert_allclose(y, 1e3 * expected, atol=1.0)
    assert live.motion.theory_caption() == f"Housner with r = {estimate.crt_mean:.3f} (CRT)"
    assert live.counters.tiles["impacts"].value == str(len(estimate.impact_samples))


def test_r_is_painted_as_soon_as_it_comes_not_with_the_next_frame(qtbot, window, stand_in, play):
    window.stack.addWidget(window.live)  # a window without a link has no live page
    window.stack.setCurrentWidget(window.live)
    with qtbot.waitExposed(window):
        window.show()
    play(window.session, window.clock, stand_in, stand_in.release_s + 3.0)
    plot = window.live.restitution.plot
    before = plot.paints
    window.live.show_estimate()
    paints = plot.paints
    assert paints > before and plot.painted_s > window.live.estimate_drawn_s
    window.live.show_estimate()
    assert plot.paints == paints, "nothing new: nothing painted"


def test_theory_with_the_right_r_lies_on_the_measured_motion(window, stand_in, play):
    play(window.session, window.clock, stand_in, stand_in.release_s + 4.0)
    live = window.live
    live.theory_button.setChecked(True)
    live.draw_frame()
    x, y = live.motion._theory[0].getData()
    measured, _ = stand_in.rotation(np.asarray(x) + stand_in.release_s)
    until = np.asarray(x) < 3.0
    assert (
        np.max(np.abs(np.asarray(y) - 1e3 * measured)[until]) < 6.0
    )  # mrad, of 75: r is found to half a percent


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


def test_a_doubt_about_r_stands_beside_the_plots(window, stand_in):
    doubt = "wires are slow"
    estimate = stand_in.estimate(8.0).model_copy(update={"doubts": (doubt,)})
    window.session.feed(Published(estimate, window.clock.now))
    window.live.draw_slow()
    assert doubt in window.live._caption.text()
    assert window.live._caption.property("role") == "warning"


def test_the_strips_keep_an_impact_that_lasts_one_sample(window, stand_in, play, rig):
    play(window.session, window.clock, stand_in, 3.0)
    row = rig.channel_ids.index("AC-1")
    assert np.nanmax(window.session.strips.columns()[1][row]) < 1.0
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


def test_sensors_beside_the_rocking_motion_stand_under_one_title(rig):
    load_cell = rig.channel("WP-1").model_copy(
        update={"id": "ROPE", "family": "load_cell", "sensitivity_unit": "mV/kN", "anchor_m": None}
    )
    laser = rig.channel("WP-2").model_copy(update={"id": "TOP", "family": "laser", "anchor_m": None})
    more = rig.model_copy(update={"channels": (load_cell, *rig.channels, laser)})
    cells, titles = arrange(more, 1800, 260)
    assert [family for family, _ in titles][-1] == "auxiliary"
    assert sorted(cell.index for cell in cells) == list(range(43))
    assert {cell.channel.id for cell in cells[-2:]} == {"ROPE", "TOP"}


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


def test_a_silent_acquisition_is_shown_as_not_live(window, stand_in, play):
    play(window.session, window.clock, stand_in, 6.0)
    window.header.refresh(window.colours)
    assert "Armed" in window.header.words["state"]
    window.clock.now += 0.8
    window.live.draw_frame()
    window._on_slow()
    assert window.live.motion.rotation.notice.startswith("Not live")
    assert "not live" in window.header.words["sentence"]
    assert window.header.words["recording"] == "Not confirmed"
    assert all(text == "–" for text in window.health.texts)
    window.clock.now += 3.0
    window.header.refresh(window.colours)
    assert window.header.words["state"] == "No link"


def test_a_value_that_goes_stale_leaves_the_screen_with_the_next_frame(window, stand_in, play):
    play(window.session, window.clock, stand_in, 3.0)
    window.stack.addWidget(window.live)  # a window without a link has no live page
    window.stack.setCurrentWidget(window.live)
    window._on_frame()
    assert window.live.counters.tiles["rotation"].detail != "not live"
    window.clock.now += 0.51
    window._on_frame()
    assert window.live.counters.tiles["rotation"].detail == "not live"
    assert all(text == "–" for text in window.health.texts)


def test_recording_light_says_when_the_disk_is_behind(window):
    window.session.feed(Published(StateMessage(state=State.ARMED), window.clock.now))
    window.session.feed(Published(recorded(20_000, safe=8_000), window.clock.now))
    window.header.refresh(window.colours)
    assert window.header.words["recording"] == "Disk is slow"
    assert window.header.words["recording_detail"] == "3.0 s wait for the disk"


def test_an_r_without_a_zero_says_so_in_words(window, stand_in, play):
    window.session.set_zeroed(False)
    play(window.session, window.clock, stand_in, stand_in.release_s + 4.0)
    window.live.draw_slow()
    tile = window.live.counters.tiles["crt"]
    assert "no zero" in tile.detail and "3 %" in tile.detail
    assert "No zero has been taken" in window.live._caption.text()
    # A zero that is taken afterwards does not mend what this run has shown.
    window.session.feed(Published(StateMessage(state=State.SAVED), window.clock.now))
    window.session.set_zeroed(True)
    window.live.draw_slow()
    assert "no zero" in tile.detail


def test_a_standard_error_that_rounds_to_nothing_is_not_shown_as_none(window, stand_in, play):
    window.session.set_zeroed(True)
    play(window.session, window.clock, stand_in, stand_in.release_s + 4.0)
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
    window.adoption.take({"events": past})
    assert window.notices.current == ("warning", "Left by an earlier session")
    window.session.feed(Published(StateMessage(state=State.ROCKING, armed=True), window.clock.now))
    window.session.feed(Published(recorded(60_400, safe=60_000), window.clock.now))
    window.header.refresh(window.colours)
    assert window.header.words["recording_detail"] == "5.0 s safe on disk"
    window.live.draw_slow()
    assert window.live.counters.tiles["impacts"].value == "–"
    assert window.live.counters.tiles["elapsed"].detail == "no impact heard yet"


def test_a_warning_that_was_over_before_the_window_came_is_not_told_as_if_it_lasted(window):
    alarm = {"kind": "alarm", "sample": 0, "data": {"alarm": "silence"}}
    disk = {"kind": "alarm", "sample": 0, "data": {"alarm": "space"}, "severity": "error"}
    past = [
        alarm | {"text": "No samples", "severity": "error"},
        disk | {"text": "No room"},
        alarm | {"text": "Samples arrive again", "severity": "info"},
    ]
    window.adoption.take({"events": past})
    assert window.notices.current == ("error", "No room")
    window.notices.dismiss()
    assert window.notices.current is None
    assert [(told.text, told.over is not None) for told in window.notices.log] == [
        ("No samples", True),
        ("No room", False),
    ]
