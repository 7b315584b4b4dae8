"""All channels as small strips, grouped by family, painted in one go.

Each pixel column of a strip is the line from the smallest to the largest sample that falls in it:
an impact that lasts one sample is as visible as one that lasts a second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages import BlockMessage
from daq_app.config.rig import Channel, Family, Rig
from daq_app.monitor.labels import DASH, number, shown_unit
from daq_app.monitor.session import Session
from daq_app.monitor.theme import DARK, Colours, font

FAMILY_TITLES: dict[Family, str] = {
    "lvdt": "LVDTs · opening of the base joint (mm)",
    "wire": "Wires (mm)",
    "accelerometer": "Accelerometers (m/s²)",
    "tiltmeter": "Tilt (mrad)",
}
_SMALLEST_SPAN_SI = {"lvdt": 1e-3, "wire": 4e-3, "accelerometer": 1.0, "tiltmeter": 4e-3}
"""A quiet strip is not blown up beyond this, or noise would look like motion."""
_TITLE_PX = 18
_LEAST_ROW_PX = 28
_LEAST_CELL_PX = 112
_GAP_PX = 4


@dataclass(frozen=True, slots=True)
class Cell:
    """Where one channel is drawn."""

    index: int
    channel: Channel
    box: QRectF


def arrange(rig: Rig, width: float, height: float) -> tuple[list[Cell], list[tuple[Family, QRectF]]]:
    """Cells of all channels and the title box of each family, for a panel of that size.

    Every family gets whole columns; there are as few rows as leave a cell wide enough for its name.
    """
    families = [family for family in FAMILY_TITLES if rig.of_family(family)]
    if not families:
        return [], []
    most = max(len(rig.of_family(family)) for family in families)
    rows = most
    for candidate in range(1, most + 1):
        needed = sum(math.ceil(len(rig.of_family(family)) / candidate) for family in families)
        if width / needed >= _LEAST_CELL_PX:
            rows = candidate
            break
    rows = max(1, min(rows, int((height - _TITLE_PX) // _LEAST_ROW_PX)))
    columns = {family: math.ceil(len(rig.of_family(family)) / rows) for family in families}
    rows = max(math.ceil(len(rig.of_family(family)) / columns[family]) for family in families)
    total = sum(columns.values())
    cell_width = (width - _GAP_PX * 2 * (len(families) - 1)) / total
    cell_height = (height - _TITLE_PX) / rows
    place = {channel.id: index for index, channel in enumerate(rig.channels)}
    cells: list[Cell] = []
    titles: list[tuple[Family, QRectF]] = []
    left = 0.0
    for family in families:
        titles.append((family, QRectF(left, 0, columns[family] * cell_width, _TITLE_PX)))
        for order, channel in enumerate(rig.of_family(family)):
            column, row = divmod(order, rows)
            box = QRectF(
                left + column * cell_width,
                _TITLE_PX + row * cell_height,
                cell_width - _GAP_PX,
                cell_height - _GAP_PX,
            )
            cells.append(Cell(place[channel.id], channel, box))
        left += columns[family] * cell_width + 2 * _GAP_PX
    return cells, titles


class StripPanel(QWidget):
    """The strips of a session; `refresh` asks for a repaint."""

    channel_clicked = Signal(str)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
        self._cells: list[Cell] = []
        self._titles: list[tuple[Family, QRectF]] = []
        self._arranged_for: object = None
        self._spans: NDArray[np.float64] = np.empty((0, 2))
        self.paints = 0
        """How often the panel was painted."""
        self.setMinimumHeight(_TITLE_PX + 3 * _LEAST_ROW_PX)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def sizeHint(self) -> QSize:
        return QSize(1200, 196)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.update()

    def refresh(self) -> None:
        """Repaint soon."""
        self.update()

    def _arrange(self) -> None:
        rig = self._session.rig
        key = (id(rig), self.width(), self.height())
        if key == self._arranged_for:
            return
        self._arranged_for = key
        self._cells, self._titles = ([], []) if rig is None else arrange(rig, self.width(), self.height())
        self._spans = np.full((len(rig.channels) if rig is not None else 0, 2), np.nan)

    def paintEvent(self, event: QPaintEvent) -> None:
        self.paints += 1
        self._arrange()
        colours = self._colours
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(colours.ground))
        session = self._session
        small = font(8)
        painter.setFont(small)
        if session.strips is None:
            painter.setPen(QColor(colours.muted))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, "No rig is known yet")
            painter.end()
            return
        bold = font(8.5, bold=True)
        painter.setFont(bold)
        painter.setPen(QColor(colours.muted))
        for family, box in self._titles:
            text = QFontMetrics(bold).elidedText(
                FAMILY_TITLES[family], Qt.TextElideMode.ElideRight, int(box.width() - 4)
            )
            painter.drawText(box, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, text)
        painter.setFont(small)
        low, high = session.strips.columns()
        live = session.fresh(BlockMessage)
        for cell in self._cells:
            self._paint_cell(painter, cell, low[cell.index], high[cell.index], live)
        painter.end()

    def _paint_cell(
        self, painter: QPainter, cell: Cell, low: NDArray[np.float32], high: NDArray[np.float32], live: bool
    ) -> None:
        colours, session, box = self._colours, self._session, cell.box
        overloaded = cell.channel.id in session.overloaded
        painter.fillRect(box, QColor(colours.surface))
        if overloaded:
            painter.setPen(QPen(QColor(colours.bad), 2))
            painter.drawRect(box)
        label_px = 13.0
        _, factor = shown_unit(cell.channel.si_unit)
        trace_box = box.adjusted(2, label_px, -2, -2)
        colour = QColor(colours.family(cell.channel.family) if live else colours.muted)
        if trace_box.height() > 4:
            bottom, top = self._span(cell, low, high)
            path = strip_path(low, high, trace_box, bottom, top)
            painter.setPen(QPen(colour, 1))
            painter.drawPath(path)
        painter.setPen(QColor(colours.bad if overloaded else colours.text))
        name = f"⚠ {cell.channel.id}" if overloaded else cell.channel.id
        head = QRectF(box.left() + 4, box.top(), box.width() - 8, label_px)
        painter.drawText(head, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, name)
        mean = session.block_mean
        value = number(float(mean[cell.index]) * factor, 2) if live and mean is not None else DASH
        painter.setPen(QColor(colours.muted))
        painter.drawText(head, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, value)

    def _span(self, cell: Cell, low: NDArray[np.float32], high: NDArray[np.float32]) -> tuple[float, float]:
        """Vertical range of a strip: grows at once, shrinks only when far too large."""
        smallest = float(np.nanmin(low, initial=np.inf))
        largest = float(np.nanmax(high, initial=-np.inf))
        if not smallest <= largest:
            return -1.0, 1.0
        least = _SMALLEST_SPAN_SI[cell.channel.family]
        need = max(largest - smallest, least)
        bottom, top = self._spans[cell.index]
        keeps = bottom <= smallest and largest <= top and (top - bottom) < 4 * need
        if not keeps:
            centre = (largest + smallest) / 2
            bottom, top = centre - 0.6 * need, centre + 0.6 * need
            self._spans[cell.index] = bottom, top
        return float(bottom), float(top)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """A click on a strip names its channel."""
        for cell in self._cells:
            if cell.box.contains(event.position()):
                self.channel_clicked.emit(cell.channel.id)
                return


def strip_path(
    low: NDArray[np.float32], high: NDArray[np.float32], box: QRectF, bottom: float, top: float
) -> pg.QtGui.QPainterPath:
    """A line through the smallest and largest value of each column that holds data, within `box`."""
    known = np.flatnonzero(~np.isnan(low))
    scale = box.height() / (top - bottom)
    x = np.repeat(box.left() + (known + 0.5) * (box.width() / low.size), 2)
    extremes = np.stack((low[known], high[known]), axis=1).ravel().astype(np.float64)
    y = box.bottom() - (extremes - bottom) * scale
    joined = np.ones(x.size, dtype=np.int32)
    joined[1::2] = np.diff(known, append=-1) == 1  # a gap in the data is a gap in the line
    return pg.arrayToQPath(x, y, connect=joined, finiteCheck=False)
