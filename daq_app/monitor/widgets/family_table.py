"""What each sensor family says of a test, as a table in the window."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHeaderView, QTableWidget, QTableWidgetItem, QWidget

from daq_app.campaign.result.family_rows import CAPTION, HEADINGS, family_rows
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.monitor.look.theme import DARK, Colours

_HEADER_PX, _ROW_PX, _ROWS = 38, 23, 4


class FamilyTable(QTableWidget):
    """One row per family; as high as four of them need where the page has room."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(0, len(HEADINGS), parent)
        self.setHorizontalHeaderLabels(list(HEADINGS))
        self.setToolTip(CAPTION)
        self.verticalHeader().hide()
        self.setShowGrid(False)
        header = self.horizontalHeader()
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.restyle(DARK)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme: rows are as high as its type needs."""
        self.verticalHeader().setDefaultSectionSize(colours.px(_ROW_PX))
        self.setMinimumHeight(colours.px(_HEADER_PX))
        self._height_of_rows = colours.px(_HEADER_PX + _ROW_PX * _ROWS)
        self._fit_height()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Make room for a bar below the rows, where long remarks need one."""
        super().resizeEvent(event)
        self._fit_height()

    def _fit_height(self) -> None:
        bar = self.horizontalScrollBar()
        wider = self.horizontalHeader().length() > self.viewport().width()
        self.setMaximumHeight(self._height_of_rows + (bar.sizeHint().height() if wider else 0))

    def show_test(self, test: TestSummary | None) -> None:
        """Show the families of a test; none where there is no result."""
        rows = [] if test is None else family_rows(test)
        self.setRowCount(len(rows))
        for place, cells in enumerate(rows):
            for column, text in enumerate(cells):
                item = QTableWidgetItem(text)
                item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEditable)
                self.setItem(place, column, item)
        self._fit_height()
