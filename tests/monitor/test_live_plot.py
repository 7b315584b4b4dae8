"""The plot that moves with every frame: no extreme is lost; all but the line is drawn only on a change."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtGui import QColor

from daq_app.monitor.look.theme import DARK, THEMES
from daq_app.monitor.plots.live_plot import LivePlot, columns_of

RATE_HZ = 500.0
LINE = QColor("#ff0000")


@pytest.fixture
def plot(qtbot):
    plot = LivePlot("Rotation", "mrad", "s")
    qtbot.addWidget(plot)
    plot.restyle(DARK)
    plot.set_line_colour(LINE.name())
    plot.setXRange(0.0, 12.0, padding=0)
    plot.setYRange(-10.0, 10.0, padding=0)
    plot.resize(700, 300)
    with qtbot.waitExposed(plot):
        plot.show()
    return plot


def shown(plot: LivePlot) -> np.ndarray:
    """(row, column): where the picture has the colour of the line, within the axes."""
    image = plot.viewport().grab().toImage()
    view = plot.mapFromScene(plot.plot_item.vb.sceneBoundingRect()).boundingRect()
    rows = range(view.top(), view.bottom() + 1)
    return np.array(
        [[image.pixelColor(x, y) == LINE for x in range(view.left(), view.right() + 1)] for y in rows]
    )


def test_a_sample_that_stands_alone_is_in_the_extremes_of_its_column():
    samples = np.arange(6000.0)
    values = np.zeros(6000)
    values[3217] = 9.0
    columns = columns_of(samples, values, 10.0)
    assert columns.first.size == 600 and (np.diff(columns.first) == 1).all()
    assert columns.high[321] == 9.0 and columns.low[321] == 0.0 and columns.high.sum() == 9.0


def test_a_column_keeps_its_samples_as_the_picture_moves_on():
    samples, values = np.arange(6000.0), np.random.default_rng(1).normal(size=6000)
    before, after = columns_of(samples, values, 10.0), columns_of(samples[7:], values[7:], 10.0)
    np.testing.assert_array_equal(before.high[1:], after.high[1:])
    np.testing.assert_array_equal(before.low[1:], after.low[1:])


def test_columns_without_a_number_are_left_out():
    values = np.ones(100)
    values[40:60] = np.nan
    columns = columns_of(np.arange(100.0), values, 10.0)
    assert columns.first.tolist() == [0, 1, 2, 3, 6, 7, 8, 9]


def test_the_line_is_whole_and_a_gap_in_the_data_is_a_gap_in_it(plot):
    samples = np.arange(12 * RATE_HZ)
    values = 8.0 * np.sin(samples / 300.0)
    plot.show_line(samples, values, 0.0, RATE_HZ)
    picture = shown(plot)
    assert picture[:, 2:-1].any(axis=0).all(), "the line runs through every column"
    heights = picture.sum(axis=0)
    assert heights[2:-1].min() >= 2 and heights.max() < 12
    values[2000:4000] = np.nan
    plot.show_line(samples, values, 0.0, RATE_HZ)
    filled = shown(plot).any(axis=0)
    assert not filled[round(0.35 * filled.size) : round(0.65 * filled.size)].any()
    assert filled[: round(0.3 * filled.size)][2:].all()


def test_a_steep_line_does_not_fall_to_pieces(plot):
    samples = np.arange(0.0, 12 * RATE_HZ, 10.0)  # one point in a column: only their joins make a line
    plot.show_line(samples, 9.0 * np.sin(samples / 40.0), 0.0, RATE_HZ)
    picture = shown(plot)[:, 12:-12]
    assert (picture[:, 1:] & picture[:, :-1]).any(axis=0).all(), "neighbouring columns touch"


def test_an_impact_of_one_sample_reaches_its_height(plot):
    samples, values = np.arange(12 * RATE_HZ), np.zeros(round(12 * RATE_HZ))
    values[3000] = 10.0
    plot.show_line(samples, values, 0.0, RATE_HZ)
    assert shown(plot)[1].any(), "it reaches the upper edge"


def test_points_further_apart_than_pixels_are_joined(plot):
    samples = np.arange(0.0, 12 * RATE_HZ, 100.0)
    plot.show_line(samples, np.zeros(samples.size), 0.0, RATE_HZ)
    filled = shown(plot).any(axis=0)
    assert filled[round(0.05 * filled.size) : round(0.95 * filled.size)].all()


def test_nothing_but_the_line_is_drawn_anew_for_a_frame_and_all_of_it_on_a_change(plot, monkeypatch):
    drawn = []
    render = LivePlot.render
    monkeypatch.setattr(LivePlot, "render", lambda self, *a: (drawn.append(1), render(self, *a))[1])
    samples = np.arange(6000.0)
    plot.viewport().grab()
    pg.mkQApp().processEvents()
    plot.viewport().grab()
    drawn.clear()
    for moved in range(5):
        plot.show_line(samples + moved, np.zeros(6000), 0.0, RATE_HZ)
        plot.viewport().grab()
    assert not drawn
    ground = plot.viewport().grab().toImage().pixelColor(1, 1)
    plot.restyle(THEMES["light"])
    assert plot.viewport().grab().toImage().pixelColor(1, 1) != ground
    drawn.clear()
    plot.setYRange(-5.0, 5.0, padding=0)
    pg.mkQApp().processEvents()
    plot.viewport().grab()
    assert drawn
