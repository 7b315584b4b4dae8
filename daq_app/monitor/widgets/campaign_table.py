"""The plan of a campaign as a table: a sign and a word per place, and the releases that fill it."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QAbstractTableModel, QDateTime, QObject, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter
from PySide6.QtWidgets import QStyledItemDelegate, QStyleOptionViewItem

from daq_app.campaign.status import CampaignStatus, Place, PlaceState, RecordedTest, TestVerdict
from daq_app.config.shown_text import shortened, visible
from daq_app.monitor.look.labels import number, tip_text
from daq_app.monitor.look.shapes import draw_shape
from daq_app.monitor.look.theme import DARK
from daq_app.monitor.widgets.check_table import Index

HEADINGS = ("Test", "θ0/α", "State", "Measured", "r CRT", "Verdict", "Released", "Operator", "Notes")
SHAPES = {PlaceState.DONE: "tick", PlaceState.TO_REPEAT: "triangle", PlaceState.MISSING: "ring"}
TONES = {PlaceState.DONE: "good", PlaceState.TO_REPEAT: "warning", PlaceState.MISSING: "muted"}
_STATE_ROLE = Qt.ItemDataRole.UserRole + 1
_SIDE_PX = 14
"""Side of a sign."""


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
        if role == Qt.ItemDataRole.FontRole and is_next and index.column() in (0, 1):
            bold = QFont()
            bold.setBold(True)
            return bold
        if role == Qt.ItemDataRole.ToolTipRole:
            return tip_text(release_text(place)) or None
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        heading = (
            f"{place.planned.name}" + (" ◀ next" if is_next else ""),
            f"{place.planned.theta0_over_alpha:.2f}",
            place.state.value,
        )
        return (*heading, *_measured(shown_test(place)))[index.column()]


def shown_test(place: Place) -> RecordedTest | None:
    """The release that fills a place: the newest that counts, else the newest; None before the first."""
    counting = [t for t in place.tests if t.verdict in (TestVerdict.GOOD, TestVerdict.UNCHECKED)]
    return next(iter((counting or place.tests)[-1:]), None)


def _measured(test: RecordedTest | None) -> tuple[str, ...]:
    if test is None:
        return ("",) * (len(HEADINGS) - 3)
    facts = test.facts
    return (
        number(facts.theta0_over_alpha, 3),
        number(facts.r.get("CRT"), 3),
        test.verdict.value,
        _moment(test).toString("dd MMM HH:mm"),
        shortened(facts.operator, 40),
        shortened(" · ".join(facts.notes), 120),
    )


def _moment(test: RecordedTest) -> QDateTime:
    return QDateTime.fromMSecsSinceEpoch(test.released_ns // 10**6)


def release_text(place: Place) -> str:
    """Every release of a place with what is known of it, one below the other."""
    return "\n\n".join(map(_release, place.tests))


def _release(test: RecordedTest) -> str:
    facts = test.facts
    r = ", ".join(f"r {name} {number(value, 4)}" for name, value in facts.r.items())
    lines = [
        f"{test.name}, {_moment(test).toString('yyyy-MM-dd HH:mm:ss')}",
        f"{test.verdict.value}: {test.reason}" if test.reason else test.verdict.value,
        f"θ0/α {number(facts.theta0_over_alpha, 4)}, {r or 'no r'}",
        f"Operator: {facts.operator}" if facts.operator else "",
        *facts.notes,
    ]
    return "\n".join(visible(line) for line in lines if line)


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
        side = min(_SIDE_PX, rect.height() - 8)
        draw_shape(
            painter, SHAPES[state], QRectF(rect.left() + 8, rect.center().y() - side / 2, side, side), colour
        )
        painter.setPen(colour)
        painter.setFont(self._font)
        painter.drawText(rect.adjusted(16 + side, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, state.value)

    @property
    def width(self) -> int:
        """Room for the widest state with its sign, px."""
        metrics = QFontMetricsF(self._font)
        return round(max(metrics.horizontalAdvance(state.value) for state in PlaceState)) + 2 * _SIDE_PX + 8

    @property
    def _font(self) -> QFont:
        return self.colours.font(10, bold=True)

    def sizeHint(self, option: QStyleOptionViewItem, index: Index) -> QSize:
        return super().sizeHint(option, index).expandedTo(QSize(self.width, 24))
