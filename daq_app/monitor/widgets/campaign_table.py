"""The plan of a campaign as a table: a sign and a word per place, and the releases that fill it."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QAbstractTableModel, QObject, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter
from PySide6.QtWidgets import QStyledItemDelegate, QStyleOptionViewItem

from daq_app.campaign.status import CampaignStatus, Place, PlaceState, TestVerdict
from daq_app.monitor.widgets.check_table import Index
from daq_app.monitor.widgets.shapes import draw_shape
from daq_app.monitor.widgets.theme import DARK

HEADINGS = ("Test", "θ0/α", "State", "Releases")
SHAPES = {PlaceState.DONE: "tick", PlaceState.TO_REPEAT: "triangle", PlaceState.MISSING: "ring"}
TONES = {PlaceState.DONE: "good", PlaceState.TO_REPEAT: "warning", PlaceState.MISSING: "muted"}
_STATE_ROLE = Qt.ItemDataRole.UserRole + 1


class CampaignModel(QAbstractTableModel):
    """Rows are places of the sequence in their order, of one specimen or of all."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._places: list[Place] = []
        self._next = ""

    def show_status(self, status: CampaignStatus, specimen: str) -> None:
        """Take over a status."""
        self.beginResetModel()
        self._places = [place for place in status.places if specimen in ("", place.planned.name.specimen)]
        proposal = status.next_test(specimen)
        self._next = str(proposal.planned.name) if proposal else ""
        self.endResetModel()

    def place(self, row: int) -> Place | None:
        """The place in a row; None beyond the table."""
        return self._places[row] if 0 <= row < len(self._places) else None

    def next_row(self) -> int:
        """Row of the proposed test; −1 if there is none."""
        return next(
            (row for row, place in enumerate(self._places) if str(place.planned.name) == self._next), -1
        )

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self._places)

    def columnCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(HEADINGS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return HEADINGS[section]
        return None

    def data(self, index: Index, role: int = 0) -> Any:
        place = self._places[index.row()]
        is_next = str(place.planned.name) == self._next
        if role == _STATE_ROLE and index.column() == 2:
            return place.state.value
        if role == Qt.ItemDataRole.FontRole and is_next:
            bold = QFont()
            bold.setBold(True)
            return bold
        if role == Qt.ItemDataRole.ToolTipRole:
            return "\n".join(f"{t.name}: {t.verdict.value} {t.reason}" for t in place.tests) or None
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        return (
            f"{place.planned.name}" + ("   ◀ next" if is_next else ""),
            f"{place.planned.theta0_over_alpha:.2f}",
            place.state.value,
            release_text(place),
        )[index.column()]


def release_text(place: Place) -> str:
    """The releases of a place in one line."""
    parts = []
    for test in place.tests:
        word = "" if test.verdict in (TestVerdict.GOOD, TestVerdict.UNCHECKED) else f" {test.verdict.value}"
        reason = f": {test.reason}" if test.reason and word else ""
        parts.append(f"{test.name}{word}{reason}")
    return " · ".join(parts)


class StateDelegate(QStyledItemDelegate):
    """Draws the state of a place as sign and word."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.colours = DARK

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        told = index.data(_STATE_ROLE)
        if told is None:
            super().paint(painter, option, index)
            return
        state = PlaceState(told)
        rect = QRectF(option.rect)
        colour = QColor(str(getattr(self.colours, TONES[state])))
        side = min(14.0, rect.height() - 8)
        draw_shape(
            painter, SHAPES[state], QRectF(rect.left() + 8, rect.center().y() - side / 2, side, side), colour
        )
        painter.setPen(colour)
        painter.setFont(self.colours.font(10, bold=True))
        painter.drawText(rect.adjusted(16 + side, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, state.value)

    def sizeHint(self, option: QStyleOptionViewItem, index: Index) -> QSize:
        return super().sizeHint(option, index).expandedTo(QSize(130, 24))
