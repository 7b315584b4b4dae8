"""Everything that was told, with times: also what is over, and what was read and put away."""

from __future__ import annotations

import datetime as dt
from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QHeaderView, QTableView, QVBoxLayout, QWidget

from daq_app.monitor.look.labels import role_label
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.widgets.notices import NoticeLine, Told

Index = QModelIndex | QPersistentModelIndex
HEADINGS: Final = ("Told at", "Over at", "Kind", "Message")
_KINDS: Final = {"info": "● to know", "warning": "▲ warning", "error": "✕ error"}
_TONES: Final = {"info": "muted", "warning": "warning", "error": "bad"}
_TEXT: Final = 3


class MessageModel(QAbstractTableModel):
    """The log of a notice line, the newest on top."""

    def __init__(self, notices: NoticeLine, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._notices = notices
        self.colours = DARK
        notices.logged.connect(self._on_logged)

    def _on_logged(self) -> None:
        self.beginResetModel()
        self.endResetModel()

    def _told(self, row: int) -> Told:
        return self._notices.log[len(self._notices.log) - 1 - row]

    def rowCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(self._notices.log)

    def columnCount(self, parent: Index | None = None) -> int:
        return 0 if parent is not None and parent.isValid() else len(HEADINGS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        wanted = orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole
        return HEADINGS[section] if wanted else None

    def data(self, index: Index, role: int = 0) -> Any:
        told = self._told(index.row())
        if role == Qt.ItemDataRole.ForegroundRole and index.column() != _TEXT:
            return QColor(str(getattr(self.colours, _TONES[told.severity])))
        if role == Qt.ItemDataRole.ToolTipRole and index.column() == _TEXT:
            return told.text
        if role != Qt.ItemDataRole.DisplayRole:
            return None
        over = _clock(told.over) if told.over is not None else ""
        return (_clock(told.at), over, _KINDS[told.severity], told.text)[index.column()]


def _clock(at: dt.datetime) -> str:
    return f"{at:%H:%M:%S}"


class MessagesPage(QWidget):
    """The table of messages."""

    def __init__(self, notices: NoticeLine, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._model = MessageModel(notices, self)
        self.table = QTableView()
        self.table.setModel(self._model)
        self.table.verticalHeader().hide()
        self.table.setShowGrid(False)
        self.table.setWordWrap(True)
        self.table.setSelectionBehavior(QTableView.SelectionBehavior.SelectRows)
        self.table.setEditTriggers(QTableView.EditTrigger.NoEditTriggers)
        header = self.table.horizontalHeader()
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        for column in range(_TEXT):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(_TEXT, QHeaderView.ResizeMode.Stretch)
        self.table.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.addWidget(role_label("Messages of this window, the newest on top", "heading"))
        layout.addWidget(self.table, 1)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._model.colours = colours
        self.table.viewport().update()
