"""A plot whose line moves with every frame: all else is kept as a picture and drawn anew only on a change.

The line is the extremes of each pixel column: an impact that lasts one sample is as visible as a slow sway.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Final

import numpy as np
from pyqtgraph.Qt import internals
from PySide6.QtCore import QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPaintEvent, QPixmap, QResizeEvent

from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.plot_base import Array, Plot

_HALF_PX: Final = 1.0
"""Half the width of the line."""
_NOTICE_AT: Final = 0.14
"""Where the notice stands, from the top of the plot."""
_NOTHING: Final = np.empty(0)


@dataclass(frozen=True, slots=True)
class Columns:
    """The extremes of neighbouring columns; `first` counts columns since sample 0, and it ascends."""

    first: Array
    low: Array
    high: Array


def columns_of(samples: Array, values: Array, per_column: float) -> Columns:
    """Extremes of `values` in columns of `per_column` samples that are fixed to the sample index.

    So a column keeps its samples as the picture moves on, and the line does not shimmer.
    A column without a number is left out.
    """
    if not samples.size:
        return Columns(_NOTHING, _NOTHING, _NOTHING)
    column = np.floor(samples / per_column)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(column)) + 1))
    low = np.fmin.reduceat(values, starts)
    known = ~np.isnan(low)
    high = np.fmax.reduceat(values, starts)
    return Columns(column[starts][known], low[known], high[known])


class LivePlot(Plot):
    """Draws one line over the still picture of its axes, grid and other items."""

    def __init__(self, title: str, left: str, bottom: str) -> None:
        super().__init__(title, left, bottom)
        self.samples = _NOTHING
        """Sample indices of the line that is shown."""
        self.values = _NOTHING
        """Its values, in the unit of the left axis; NaN is a gap."""
        self._rate_hz = math.nan
        self._origin = 0.0
        self._line_colour = QColor(DARK.rotation)
        self._notice = ""
        self._notice_colour = QColor(DARK.warning)
        self._bars = internals.PrimitiveArray(QRectF, 4)
        self._still: QPixmap | None = None
        self._viewed = QRect()
        self.viewport().setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.scene().changed.connect(self._draw_anew)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        super().restyle(colours)
        self._notice_colour = QColor(colours.warning)
        self._draw_anew()

    def set_line_colour(self, colour: str) -> None:
        """The colour of the line."""
        self._line_colour = QColor(colour)

    @property
    def notice(self) -> str:
        """A sentence over the plot; empty for none."""
        return self._notice

    def show_line(self, samples: Array, values: Array, origin: float, rate_hz: float) -> None:
        """Draw `values` at (samples − origin) / rate_hz with the next frame."""
        self.samples, self.values = samples.copy(), values.copy()  # what they view may move before the frame
        self._origin, self._rate_hz = origin, rate_hz
        self.viewport().update(self._viewed)

    def clear_line(self) -> None:
        """Draw no line."""
        self.show_line(_NOTHING, _NOTHING, 0.0, 1.0)

    def show_notice(self, text: str) -> None:
        """Lay a sentence over the plot."""
        if text != self._notice:
            self._notice = text
            self.viewport().update(self._viewed)

    @property
    def line(self) -> tuple[Array, Array]:
        """The line as it is shown: x and y in the units of the axes."""
        return (self.samples - self._origin) / self._rate_hz, self.values

    def resizeEvent(self, event: QResizeEvent | None) -> None:
        """A plot of another size has another picture."""
        self._draw_anew()
        super().resizeEvent(event)

    def _draw_anew(self, *_regions: object) -> None:
        self._still = None

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint picture and line, and remember when."""
        viewport = self.viewport()
        still = self._still_picture(viewport.size(), viewport.devicePixelRatioF())
        painter = QPainter(viewport)
        painter.setClipRegion(event.region())
        painter.drawPixmap(0, 0, still)
        view = self.plot_item.vb.mapRectToScene(self.plot_item.vb.rect())
        # Everything in front of the picture lies in here: it is all that a frame paints.
        self._viewed = self.mapFromScene(view).boundingRect()
        painter.setClipRect(self._viewed, Qt.ClipOperation.IntersectClip)
        self._paint_line(painter, view)
        if self._notice:
            self._paint_notice(painter)
        painter.end()
        self.paints += 1
        self.painted_s = time.monotonic()

    def _still_picture(self, size: QSize, scale: float) -> QPixmap:
        """The scene as it stands: axes, grid, and items that change rarely."""
        if self._still is None or self._still.size() != size * scale:
            still = QPixmap(size * scale)
            still.setDevicePixelRatio(scale)
            still.fill(self.backgroundBrush().color())
            painter = QPainter(still)
            whole = QRect(0, 0, size.width(), size.height())
            self.render(painter, QRectF(whole), whole)
            painter.end()
            self._still = still
        return self._still

    def _paint_line(self, painter: QPainter, view: QRectF) -> None:
        (left, right), (bottom, top) = self.plot_item.vb.viewRange()
        if self.samples.size < 2 or view.width() < 2 or right <= left or top <= bottom:
            return
        per_px = (right - left) * self._rate_hz / view.width()
        per_column = max(per_px, float(self.samples[1] - self.samples[0]))
        columns = columns_of(self.samples, self.values, per_column)
        if columns.first.size < 2:
            return
        scale_y = view.height() / (top - bottom)
        high, low = (np.round(view.bottom() - (y - bottom) * scale_y) for y in (columns.high, columns.low))
        # Each bar also spans the column before it: that joins them to a line two pixels wide.
        joined = np.diff(columns.first) == 1
        upper = np.where(joined, np.minimum(high[1:], high[:-1]), high[1:]) - _HALF_PX
        lower = np.where(joined, np.maximum(low[1:], low[:-1]), low[1:]) + _HALF_PX
        first_px = view.left() - (self._origin + left * self._rate_hz) / per_px
        self._bars.resize(upper.size)
        bars = self._bars.ndarray()
        bars[:, 0] = np.round(first_px + columns.first[1:] * (per_column / per_px))
        bars[:, 1], bars[:, 2], bars[:, 3] = upper, math.ceil(per_column / per_px), lower - upper
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._line_colour)
        painter.drawRects(*self._bars.drawargs())

    def _paint_notice(self, painter: QPainter) -> None:
        box = QRect(self._viewed)
        font = self.font()
        needs = QFontMetricsF(font).horizontalAdvance(self._notice)
        if needs > box.width() > 0:  # in one line, that it lies above the middle of the smallest plot
            font.setPointSizeF(font.pointSizeF() * 0.98 * box.width() / needs)
        painter.setFont(font)
        painter.setPen(self._notice_colour)
        box.setHeight(round(2 * _NOTICE_AT * box.height()))
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, self._notice)
