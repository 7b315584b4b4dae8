"""What all plots share: look, pens, and a decimation for drawing that keeps every extreme."""

from __future__ import annotations

import math
import time
from typing import Any, Final

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPaintEvent

from daq_app.monitor.look.theme import Colours

Array = NDArray[np.float64]

LINE_WIDTH: Final = 1
"""Width 1 takes Qt's fast path; only the few curves that are read from afar get a wider pen."""

_LABELLED: Final = (1.0, 2.0, 5.0, 10.0)
"""Steps of a decade whose figures keep apart on a logarithmic axis."""


def envelope(x: Array, y: Array, columns: int) -> tuple[Array, Array]:
    """The smallest and largest y of each of about `columns` groups, in time order of x.

    Input of at most two points a column comes back unchanged.
    """
    size = x.size // columns if columns > 0 else 0
    if size <= 2:
        return x, y
    whole = (x.size // size) * size
    groups = y[:whole].reshape(-1, size)
    rows = np.arange(groups.shape[0]) * size
    filled_low = np.where(np.isnan(groups), np.inf, groups)
    filled_high = np.where(np.isnan(groups), -np.inf, groups)
    picks = np.sort(np.stack((rows + filled_low.argmin(axis=1), rows + filled_high.argmax(axis=1))), axis=0)
    index = np.concatenate((picks.T.ravel(), np.arange(whole, x.size)))
    return x[index], y[index]


class Axis(pg.AxisItem):  # type: ignore[misc]
    """An axis that writes a true minus sign, as every other figure of the window does."""

    def __init__(self, orientation: str) -> None:
        super().__init__(orientation)
        # Only here, while no label shows: later, pyqtgraph computes a prefix in this very call.
        self.enableAutoSIPrefix(False)
        self.text_px = 0.0
        """Height of the figures; 0 until they have a font."""

    def tickSpacing(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, float]]:
        """Spacings of the ticks, coarse to fine: figures above each other keep a line's distance."""
        levels: list[tuple[float, float]] = super().tickSpacing(minVal, maxVal, size)
        if self.orientation not in ("left", "right") or not levels or size <= 0:
            return levels
        least = 1.3 * self.text_px / size * abs(maxVal - minVal)
        coarse = levels[0][0]
        while coarse < least:
            coarse *= 2
        return [(coarse, 0.0)] + [level for level in levels[1:] if coarse > level[0] >= least]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """The texts of the ticks; on a logarithmic axis 1, 2 and 5 of each decade have one."""
        texts = [text.replace("-", "−") for text in super().tickStrings(values, scale, spacing)]
        if not self.logMode:
            return texts
        return [
            text if round(10.0 ** (value % 1.0), 6) in _LABELLED else ""
            for value, text in zip(values, texts, strict=True)
        ]


def axes() -> dict[str, Axis]:
    """New axes for a plot: left and below."""
    return {side: Axis(side) for side in ("left", "bottom")}


class Plot(pg.PlotWidget):  # type: ignore[misc]
    """A plot in the window's colours, without pyqtgraph's menus; call `restyle` on a new theme."""

    def __init__(self, title: str, left: str, bottom: str, *, mouse: bool = False) -> None:
        super().__init__(axisItems=axes(), enableMenu=False)
        self._title = title
        self._axis_px: dict[str, int] = {}
        self._labels = {"left": left, "bottom": bottom}
        self.plot_item = self.getPlotItem()
        self.plot_item.hideButtons()
        self.setMouseEnabled(mouse, mouse)
        self.setFrameShape(self.Shape.NoFrame)
        self.setAntialiasing(False)
        self.plot_item.showGrid(x=True, y=True, alpha=0.18)
        self.plot_item.layout.setContentsMargins(2, 2, 10, 2)
        self.setMinimumSize(120, 90)
        self.painted_s = -math.inf
        """When the plot was last painted (`time.monotonic`); the benchmark reads it."""
        self.paints = 0
        self._swallow_wheel = not mouse
        self.viewport().installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Live plots do not react to the wheel: a range moved by accident would hide the motion."""
        if self._swallow_wheel and event.type() == QEvent.Type.Wheel:
            return True
        return bool(super().eventFilter(watched, event))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint, and remember when."""
        super().paintEvent(event)
        self.paints += 1
        self.painted_s = time.monotonic()

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self.setBackground(colours.surface)
        small = colours.font(8.5)
        for name in ("left", "bottom", "right"):
            axis = self.plot_item.getAxis(name)
            axis.setPen(pg.mkPen(colours.line))
            axis.setTextPen(pg.mkPen(colours.muted))
            axis.setTickFont(small)
            if isinstance(axis, Axis):
                axis.text_px = QFontMetricsF(small).height()
            axis.setStyle(tickLength=-4, hideOverlappingLabels=True)
            # Axes and grid change rarely and cost most of a frame: keep them as a picture.
            axis.setCacheMode(pg.QtWidgets.QGraphicsItem.CacheMode.DeviceCoordinateCache)
        for name, text in self._labels.items():
            if text:
                self.plot_item.setLabel(name, text, **colours.axis_style)
        if self._title:
            self.plot_item.setTitle(self._title, color=colours.muted, size=f"{0.95 * colours.points:.1f}pt")
            self.plot_item.titleLabel.setMaximumHeight(colours.px(20))
            self.plot_item.layout.setRowFixedHeight(0, colours.px(20))
        for name, pixels in self._axis_px.items():
            self.plot_item.getAxis(name).setWidth(colours.px(pixels))

    def set_axis_width(self, axis: str, pixels: int) -> None:
        """Fix the width of an axis at the usual type size, so that plots below each other are in line."""
        self._axis_px[axis] = pixels
        self.plot_item.getAxis(axis).setWidth(pixels)

    def set_label(self, axis: str, text: str) -> None:
        """Change an axis label, which then outlives a change of theme."""
        self._labels[axis] = text
        self.plot_item.getAxis(axis).setLabel(text)

    def curve(self, *, dashed: bool = False) -> Any:
        """A new line in this plot; colour it in `restyle`."""
        item = pg.PlotCurveItem(skipFiniteCheck=True)
        # A wide pen along one path is worked out as an outline: 80 times slower on a noisy line.
        item.setSegmentedLineMode("auto")
        self.addItem(item)
        item.dashed = dashed
        return item


def line_pen(colour: str | QColor, *, dashed: bool = False, width: int = LINE_WIDTH) -> Any:
    """A pen for curves."""
    style = Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine
    return pg.mkPen(colour, width=width, style=style)
