"""The sensor check as a table: a sign and a word per channel, what is wrong, and the figures behind it."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QResizeEvent
from PySide6.QtWidgets import QHeaderView, QStyledItemDelegate, QStyleOptionViewItem, QTableView, QWidget

from daq_app.acquisition.checks.check_model import ChannelCheck, SensorCheck, Verdict
from daq_app.config.rig import Rig
from daq_app.config.shown_units import shown_unit
from daq_app.monitor.look.labels import DASH, number
from daq_app.monitor.look.shapes import draw_shape
from daq_app.monitor.look.theme import DARK, Colours

Index = QModelIndex | QPersistentModelIndex
HEADINGS = ("Verdict", "Channel", "What to do", "At rest", "Noise", "Hum", "Pull")
TIPS = {
    4: "rms noise over the expected figure",
    5: "mains hum over the expected noise",
    6: "measured over expected change in the pull test",
}
_FINDING = 2
_FIGURES = (6, 4, 5, 3)
"""Columns of figures, the first the last to go where there is too little room."""
_WIDTHS_PX = {0: 96, 1: 84, 3: 108, 4: 72, 5: 64, 6: 68}
_LEAST_FINDING_PX = 260
"""Room for the sentence on a channel."""
SHAPES = {Verdict.GO: "tick", Verdict.CAUTION: "triangle", Verdict.NO_GO: "cross"}
WORDS = {Verdict.GO: "Go", Verdict.CAUTION: "Look", Verdict.NO_GO: "No-go"}
TONES = {Verdict.GO: "good", Verdict.CAUTION: "warning", Verdict.NO_GO: "bad"}
_ORDER = {Verdict.NO_GO: 0, Verdict.CAUTION: 1, Verdict.GO: 2}
_VERDICT_ROLE = Qt.ItemDataRole.UserRole + 1


class CheckModel(QAbstractTableModel):
    """Rows are channels, the worst first; before a check they say so."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._rig: Rig | None = None
        self._rows: list[tuple[str, str, ChannelCheck | None]] = []

    def show_check(self, rig: Rig | None, check: SensorCheck | None) -> None:
        """Take over a check, or the bare channels of a rig."""
        self.beginResetModel()
        self._rig = rig
        channels = rig.channels if rig is not None else ()
        found = {result.channel_id: result for result in check.channels} if check is not None else {}
        self._rows = [(channel.id, channel.si_unit, found.get(channel.id)) for channel in channels]
        if check is not None:
            self._rows.sort(key=lambda row: _ORDER[row[2].verdict] if row[2] is not None else 3)
        self.endResetModel()

    def check_of(self, row: int) -> ChannelCheck | None:
        """The check in a row; None before a check."""
        return self._rows[row][2] if 0 <= row < len(self._rows) else None

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self._rows)

    def columnCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(HEADINGS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is not Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.ToolTipRole:
            return TIPS.get(section)
        if role == Qt.ItemDataRole.TextAlignmentRole and section > _FINDING:
            return int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        return HEADINGS[section] if role == Qt.ItemDataRole.DisplayRole else None

    def data(self, index: Index, role: int = 0) -> Any:
        name, unit, check = self._rows[index.row()]
        if role == _VERDICT_ROLE:
            # As text: Qt hands enumerations of text back as text.
            return check.verdict.value if check is not None and index.column() == 0 else None
        if role == Qt.ItemDataRole.ToolTipRole and check is not None:
            return check.text or "Nothing is wrong."
        if role == Qt.ItemDataRole.TextAlignmentRole and index.column() > _FINDING:
            return int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        if check is None:
            return ["not checked", name, "", DASH, DASH, DASH, DASH][index.column()]
        shown, factor = shown_unit(unit)
        cells = (
            WORDS[check.verdict],
            name,
            check.text,
            number(check.mean_si * factor, 2, shown),
            number(check.noise_si / check.expected_noise_si, 1) + " ×",
            number(check.hum_si / check.expected_noise_si, 1) + " ×",
            DASH if check.pull_ratio is None else number(check.pull_ratio, 2) + " ×",
        )
        return cells[index.column()]


class VerdictDelegate(QStyledItemDelegate):
    """Draws the verdict as sign and word."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.colours = DARK

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        told = index.data(_VERDICT_ROLE)
        if told is None:
            super().paint(painter, option, index)
            return
        verdict = Verdict(told)
        rect = QRectF(option.rect)
        colour = QColor(str(getattr(self.colours, TONES[verdict])))
        side = min(15.0 * self.colours.scale, rect.height() - 6)
        draw_shape(
            painter,
            SHAPES[verdict],
            QRectF(rect.left() + 8, rect.center().y() - side / 2, side, side),
            colour,
        )
        painter.setPen(colour)
        painter.setFont(self.colours.font(10, bold=True))
        painter.drawText(rect.adjusted(16 + side, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, WORDS[verdict])

    def sizeHint(self, option: QStyleOptionViewItem, index: Index) -> QSize:
        return super().sizeHint(option, index).expandedTo(QSize(86, 24))


class CheckTable(QTableView):
    """The table."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.check_model = CheckModel(self)
        self._delegate = VerdictDelegate(self)
        self.setModel(self.check_model)
        self.setItemDelegateForColumn(0, self._delegate)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(25)
        self.setShowGrid(False)
        self.setSelectionBehavior(QTableView.SelectionBehavior.SelectRows)
        self.setEditTriggers(QTableView.EditTrigger.NoEditTriggers)
        self.setWordWrap(False)
        header = self.horizontalHeader()
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        for column, width in _WIDTHS_PX.items():
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Interactive)
            self.setColumnWidth(column, width)
        header.setSectionResizeMode(_FINDING, QHeaderView.ResizeMode.Stretch)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """The sentence is never squeezed: where there is too little room, figures give way to it."""
        super().resizeEvent(event)
        self._show_columns()

    def _show_columns(self) -> None:
        room = self.viewport().width() - _LEAST_FINDING_PX * self._delegate.colours.scale
        for column in (0, 1, *_FIGURES):
            room -= self.columnWidth(column) or round(_WIDTHS_PX[column] * self._delegate.colours.scale)
            self.setColumnHidden(column, column in _FIGURES and room < 0)

    def show_check(self, rig: Rig | None, check: SensorCheck | None) -> None:
        """Take over a check and show its top."""
        self.check_model.show_check(rig, check)
        self.scrollToTop()

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._delegate.colours = colours
        self.verticalHeader().setDefaultSectionSize(colours.px(25))
        for column, width in _WIDTHS_PX.items():
            self.setColumnWidth(column, colours.px(width))
        self._show_columns()
        self.viewport().update()
