"""A channel opened large says what it measures, against what the rig file expects of it."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from daq_app.monitor.data.channel_look import expected_density_si, look_at, neighbours
from daq_app.monitor.pages.channel_window import ChannelWindow, limit_word


def test_a_look_gives_volts_noise_and_spectrum_of_the_channel(window, stand_in, play):
    play(window.session, window.clock, stand_in, 3.9)
    channel = window.session.rig.channel("LV-A01")
    look = look_at(window.session, "LV-A01", {"LV-A01": 0.25})
    assert look.quality.noise_si == pytest.approx(channel.noise_si, rel=0.1)
    assert look.readings.mean() == pytest.approx(channel.offset + 0.25, abs=0.01)
    expected = expected_density_si(channel, window.session.rate_hz)
    assert np.sqrt(np.mean(look.density_si**2)) == pytest.approx(expected, rel=0.15)


def test_neighbours_are_of_the_family_and_near(rig):
    near = neighbours(rig, "WP-2")
    assert set(near) == {"WP-1", "WP-3", "WP-4", "WP-5"}
    assert set(near[:2]) <= {"WP-1", "WP-3"}


def test_the_limits_of_the_rig_file_are_drawn_and_told(rig):
    channel = rig.channel("WP-2").model_copy(update={"warning_si": 0.1, "critical_si": 0.2})
    assert limit_word(channel, 0.05) == ("", "")
    assert limit_word(channel, -0.15) == ("warning", "⚠ above the warning limit")
    assert limit_word(channel, 0.25)[0] == "bad"


def test_a_double_click_on_a_strip_opens_its_channel_and_its_neighbours(qtbot, window, stand_in, play):
    play(window.session, window.clock, stand_in, 3.9)
    strips = window.live.strips
    strips.resize(1200, 240)
    strips.grab()
    cell = next(cell for cell in strips._cells if cell.channel.id == "WP-2")
    opened = []
    strips.channel_opened.connect(opened.append)
    centre = cell.box.center().toPoint()
    qtbot.mouseDClick(strips, Qt.MouseButton.LeftButton, pos=QPoint(centre))
    assert opened == ["WP-2"]
    view = ChannelWindow(window.session, "WP-2", dict, window.colours)
    qtbot.addWidget(view)
    assert "certificate" not in view._facts["Certificate"].text() and view._facts["Certificate"].text()
    assert view._facts["Raw reading"].text().endswith("V")
    view.neighbour_buttons["WP-3"].click()
    assert view.name == "WP-3" and "WP-2" in view.neighbour_buttons
    window.clock.now += 1.0
    view.refresh()
    assert "not live" in view._facts["Now"].text()


def test_channels_are_open_side_by_side_take_the_theme_and_go_with_the_window(qtbot, window, stand_in, play):
    play(window.session, window.clock, stand_in, 3.9)
    for name in ("WP-2", "LV-A07", "WP-2"):
        window.open_channel(name)
    assert [view.name for view in window.channels.shown] == ["WP-2", "LV-A07"]
    before = [view.signal.backgroundBrush().color() for view in window.channels.shown]
    window.toggle_theme()
    after = [view.signal.backgroundBrush().color() for view in window.channels.shown]
    assert all(now != then for now, then in zip(after, before, strict=True))
    window.channels.shown[0].close()
    qtbot.waitUntil(lambda: len(window.channels.shown) == 1)
    window.open_channel("WP-2")
    window.close()
    qtbot.waitUntil(lambda: not window.channels.shown)
