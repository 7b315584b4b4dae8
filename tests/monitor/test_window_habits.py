"""Theme, type size and layout: remembered, legible, and within the smallest screen that is promised."""

from __future__ import annotations

import pytest

from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.window.main_window import MainWindow


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
    path.write_text("[General]\ntheme=pink\ntype_size=huge\n", encoding="utf-8")
    settings = WindowSettings(path)
    assert (settings.theme, settings.type_size) == ("dark", 10.0)


def test_axes_say_what_they_show_also_after_a_change_of_theme(window, stand_in, play):
    play(window.session, window.clock, stand_in, stand_in.release_s + 2.0)
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
