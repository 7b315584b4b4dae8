"""All channels as small strips, grouped by family, painted in one go.

Each pixel column of a strip is the line from the smallest to the largest sample that falls in it:
an impact that lasts one sample is as visible as one that lasts a second.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QMouseEvent, QPainter, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages.published import BlockMessage
from daq_app.config.rig import Channel, Rig
from daq_app.config.shown_units import shown_unit
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import DASH, number
from daq_app.monitor.look.theme import AUXILIARY_GROUP, DARK, Colours, font

FAMILY_TITLES: dict[str, str] = {
    "lvdt": "LVDTs · opening of the base joint (mm)",
    "wire": "Wires (mm)",
    "accelerometer": "Accelerometers (m/s²)",
    "tiltmeter": "Tilt (mrad)",
    AUXILIARY_GROUP: "Other sensors",
}
_SMALLEST_SPAN_SI = {"lvdt": 1e-3, "wire": 4e-3, "accelerometer": 1.0, "tiltmeter": 4e-3}
"""A quiet strip is not blown up beyond this, or noise would look like motion."""
_SMALLEST_SPAN_NOISES = 20.0
"""The same for auxiliary channels, in their own noise."""
_TITLE_PX = 18
_LEAST_ROW_PX = 28
_LEAST_CELL_PX = 112
_GAP_PX = 4
_LABEL_PX = 13.0
_LEAST_TRACE_PX = 4
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Cell:
    """Where one channel is drawn."""

    index: int
    channel: Channel
    box: QRectF


def arrange(
    rig: Rig, width: float, height: float, scale: float = 1.0
) -> tuple[list[Cell], list[tuple[str, QRectF]]]:
    """Cells of all channels and the title box of each family, for a panel of that size and type scale.

    Every family gets whole columns; there are as few rows as leave a cell wide enough for its name.
    """
    title = _TITLE_PX * scale
    groups: dict[str, list[Channel]] = {name: [] for name in FAMILY_TITLES}
    for channel in rig.channels:
        groups[_group(channel)].append(channel)
    families = [family for family in FAMILY_TITLES if groups[family]]
    if not families:
        return [], []
    most = max(len(groups[family]) for family in families)
    rows = most
    for candidate in range(1, most + 1):
        needed = sum(math.ceil(len(groups[family]) / candidate) for family in families)
        if width / needed >= _LEAST_CELL_PX * scale:
            rows = candidate
            break
    rows = max(1, min(rows, int((height - title) // (_LEAST_ROW_PX * scale))))
    columns = {family: math.ceil(len(groups[family]) / rows) for family in families}
    rows = max(math.ceil(len(groups[family]) / columns[family]) for family in families)
    total = sum(columns.values())
    cell_width = (width - _GAP_PX * 2 * (len(families) - 1)) / total
    cell_height = (height - title) / rows
    place = {channel.id: index for index, channel in enumerate(rig.channels)}
    cells: list[Cell] = []
    titles: list[tuple[str, QRectF]] = []
    left = 0.0
    for family in families:
        titles.append((family, QRectF(left, 0, columns[family] * cell_width, title)))
        for order, channel in enumerate(groups[family]):
            column, row = divmod(order, rows)
            box = QRectF(
                left + column * cell_width,
                title + row * cell_height,
                cell_width - _GAP_PX,
                cell_height - _GAP_PX,
            )
            cells.append(Cell(place[channel.id], channel, box))
        left += columns[family] * cell_width + 2 * _GAP_PX
    return cells, titles


def fit(
    rig: Rig, width: float, height: float, most: float
) -> tuple[list[Cell], list[tuple[str, QRectF]], float]:
    """The arrangement with the largest type scale from 1 to `most` that leaves room for the names."""
    for step in range(round(10 * most), 10, -1):
        cells, titles = arrange(rig, width, height, step / 10)
        if cells and cells[0].box.width() + _GAP_PX >= _LEAST_CELL_PX * step / 10:
            return cells, titles, step / 10
    return *arrange(rig, width, height), 1.0


class StripPanel(QWidget):
    """The strips of a session; `refresh` asks for a repaint."""

    channel_opened = Signal(str)
    """The channel whose strip was clicked twice."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
        self._cells: list[Cell] = []
        self._titles: list[tuple[str, QRectF]] = []
        self._arranged_for: object = None
        self._scale = 1.0
        """Type scale of the strips: where there is too little room for large names they stay smaller."""
        self._spans: Array = np.empty((0, 2))
        self._least: Array = np.empty(0)
        self._still: QPixmap | None = None
        self._still_for: object = None
        self.paints = 0
        """How often the panel was painted."""
        self.setMinimumHeight(_TITLE_PX + 3 * _LEAST_ROW_PX)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def sizeHint(self) -> QSize:
        return QSize(1200, 196)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.setMinimumHeight(colours.px(_TITLE_PX + 3 * _LEAST_ROW_PX))
        self.update()

    def refresh(self) -> None:
        """Repaint soon."""
        self.update()

    def _arrange(self) -> None:
        rig = self._session.rig
        key = (id(rig), self.width(), self.height(), self._colours.scale)
        if key == self._arranged_for:
            return
        self._arranged_for = key
        self._cells, self._titles = [], []
        if rig is not None:
            self._cells, self._titles, self._scale = fit(
                rig, self.width(), self.height(), self._colours.scale
            )
        channels = rig.channels if rig is not None else ()
        self._spans = np.full((len(channels), 2), np.nan)
        self._least = np.array([_smallest_span(channel) for channel in channels])

    def paintEvent(self, event: QPaintEvent) -> None:
        self.paints += 1
        self._arrange()
        session = self._session
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._still_picture())
        if session.strips is not None:
            live = session.fresh(BlockMessage)
            self._paint_traces(painter, live)
            self._paint_values(painter, live)
        painter.end()

    def _still_picture(self) -> QPixmap:
        """Everything that changes rarely: grounds, names, titles, the frames of overloaded channels."""
        scale = self.devicePixelRatioF()
        key = (self._arranged_for, self._colours, self._session.overloaded, scale)
        if self._still is not None and key == self._still_for:
            return self._still
        still = QPixmap(round(self.width() * scale), round(self.height() * scale))
        still.setDevicePixelRatio(scale)
        still.fill(QColor(self._colours.ground))
        painter = QPainter(still)
        if self._session.strips is None:
            painter.setPen(QColor(self._colours.muted))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, "No rig is known yet")
        bold = font(8.5 * self._scale, bold=True)
        painter.setFont(bold)
        painter.setPen(QColor(self._colours.muted))
        for family, box in self._titles:
            text = QFontMetrics(bold).elidedText(
                FAMILY_TITLES[family], Qt.TextElideMode.ElideRight, int(box.width() - 4)
            )
            painter.drawText(box, _LEFT, text)
        painter.setFont(font(8 * self._scale))
        for cell in self._cells:
            self._paint_still_cell(painter, cell)
        painter.end()
        self._still, self._still_for = still, key
        return still

    def _paint_still_cell(self, painter: QPainter, cell: Cell) -> None:
        colours = self._colours
        overloaded = cell.channel.id in self._session.overloaded
        painter.fillRect(cell.box, QColor(colours.surface))
        if overloaded:
            painter.setPen(QPen(QColor(colours.bad), 2))
            painter.drawRect(cell.box)
        painter.setPen(QColor(colours.bad if overloaded else colours.text))
        painter.drawText(
            _head(cell, self._scale), _LEFT, f"⚠ {cell.channel.id}" if overloaded else cell.channel.id
        )

    def _paint_traces(self, painter: QPainter, live: bool) -> None:
        """The lines of a family as one path: a path per channel costs three times as much."""
        strips = self._session.strips
        assert strips is not None
        width = _trace_box(self._cells[0], self._scale).width() if self._cells else 1.0
        low, high = strips.columns(max(1, round(strips.n_columns / max(width, 1.0))))
        self._follow_spans(low, high)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for family, _ in self._titles:
            cells = [cell for cell in self._cells if _group(cell.channel) == family]
            rows = [cell.index for cell in cells]
            boxes = np.array([_trace_box(cell, self._scale).getRect() for cell in cells])
            if boxes[0, 3] <= _LEAST_TRACE_PX:
                continue
            colour = self._colours.family(family) if live else self._colours.muted
            painter.setPen(QPen(QColor(colour), 1))
            painter.drawPath(strip_path(low[rows], high[rows], boxes, self._spans[rows]))

    def _paint_values(self, painter: QPainter, live: bool) -> None:
        mean = self._session.block_mean
        painter.setFont(font(8 * self._scale))
        painter.setPen(QColor(self._colours.muted))
        for cell in self._cells:
            unit, factor = shown_unit(cell.channel.si_unit)
            value = number(float(mean[cell.index]) * factor, 2) if live and mean is not None else DASH
            if cell.channel.auxiliary:  # the title of the group names no unit
                value = f"{value} {unit}"
            painter.drawText(_head(cell, self._scale), _RIGHT, value)

    def _follow_spans(self, low: Floats, high: Floats) -> None:
        """Vertical ranges of the strips: grow at once, shrink only when far too large."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a channel without any sample yet
            smallest, largest = np.nanmin(low, axis=1), np.nanmax(high, axis=1)
        known = smallest <= largest
        need = np.maximum(largest - smallest, self._least)
        bottom, top = self._spans[:, 0], self._spans[:, 1]
        with np.errstate(invalid="ignore"):
            keeps = (bottom <= smallest) & (largest <= top) & (top - bottom < 4 * need)
        moved = known & ~keeps
        centre = (largest[moved] + smallest[moved]) / 2
        self._spans[moved, 0] = centre - 0.6 * need[moved]
        self._spans[moved, 1] = centre + 0.6 * need[moved]

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """A double click on a strip opens its channel."""
        for cell in self._cells:
            if cell.box.contains(event.position()):
                self.channel_opened.emit(cell.channel.id)
                return


def _group(channel: Channel) -> str:
    """Title under which a channel stands: its family, or one for all that is beside the rocking motion."""
    return AUXILIARY_GROUP if channel.auxiliary else channel.family


def _smallest_span(channel: Channel) -> float:
    return _SMALLEST_SPAN_SI.get(channel.family, _SMALLEST_SPAN_NOISES * channel.noise_si)


def _head(cell: Cell, scale: float) -> QRectF:
    """Where a strip's name and value stand."""
    return QRectF(cell.box.left() + 4, cell.box.top(), cell.box.width() - 8, _LABEL_PX * scale)


def _trace_box(cell: Cell, scale: float) -> QRectF:
    return cell.box.adjusted(2, _LABEL_PX * scale, -2, -2)


def strip_path(low: Floats, high: Floats, boxes: Array, spans: Array) -> pg.QtGui.QPainterPath:
    """Lines through the smallest and largest value of each column that holds data.

    `low`, `high`: (channels, columns); `boxes`: (channels, 4) left, top, width, height in pixels;
    `spans`: (channels, 2) values at the bottom and the top of a box.
    """
    columns = low.shape[1]
    rows, places = np.nonzero(~np.isnan(low))
    left, top, width, height = boxes[rows].T
    bottom_value, top_value = spans[rows].T
    x = left + (places + 0.5) * (width / columns)
    scale = height / (top_value - bottom_value)
    extremes = np.stack((low[rows, places], high[rows, places]), axis=1)
    y = (top + height)[:, None] - (extremes - bottom_value[:, None]) * scale[:, None]
    joined = np.ones((x.size, 2), dtype=np.int32)
    # A gap in the data is a gap in the line, and a channel is not joined to the next.
    joined[:, 1] = np.diff(rows * (columns + 1) + places, append=-1) == 1
    return pg.arrayToQPath(np.repeat(x, 2), y.ravel(), connect=joined.ravel(), finiteCheck=False)
