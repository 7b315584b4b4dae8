"""The tests of a level as a table; those that are ticked lie over each other in the plots."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHeaderView, QTableWidget, QTableWidgetItem, QWidget

from daq_app.campaign.result.result import Result
from daq_app.campaign.result.words import METHODS, repetition_rows
from daq_app.monitor.look.labels import DASH
from daq_app.monitor.look.theme import DARK, Colours

_HEADER_PX, _ROW_PX, _VISIBLE_ROWS = 38, 23, 5
_HEADINGS = ("Test", "θ0/α", "Impacts", "r EAV", "r CRT", "Verdict")


class LevelTable(QTableWidget):
    """Emits `ticked()` when the choice changes and `opened(run name)` on a double click."""

    ticked = Signal()
    opened = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(0, len(_HEADINGS), parent)
        self.setHorizontalHeaderLabels(list(_HEADINGS))
        self.verticalHeader().hide()
        self.setShowGrid(False)
        header = self.horizontalHeader()
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self._colours = DARK
        self._fit()
        self._runs: tuple[str, ...] = ()
        self.itemChanged.connect(lambda _item: self.ticked.emit())
        self.itemDoubleClicked.connect(lambda item: self.opened.emit(self._runs[item.row()]))

    @property
    def over(self) -> list[str]:
        """Runs that are ticked, by file name."""
        return [run for row, run in enumerate(self._runs) if self._is_ticked(row)]

    def restyle(self, colours: Colours) -> None:
        """Take over a theme: rows are as high as its type needs."""
        self._colours = colours
        self._fit()

    def _fit(self) -> None:
        """As high as its rows need, up to some."""
        self.verticalHeader().setDefaultSectionSize(self._colours.px(_ROW_PX))
        rows = min(self.rowCount(), _VISIBLE_ROWS)
        wider = self.horizontalHeader().length() > self.viewport().width()
        bar_px = self.horizontalScrollBar().sizeHint().height() if wider else 0
        self.setFixedHeight(self._colours.px(_HEADER_PX + _ROW_PX * rows) + bar_px)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Make room for a bar below the rows, where the columns need one."""
        super().resizeEvent(event)
        self._fit()

    def clear_rows(self) -> None:
        """Show no test."""
        self._runs = ()
        self.setRowCount(0)

    def show_result(self, result: Result) -> None:
        """List the level: good tests are ticked, the test itself always lies on top."""
        tests = result.in_order
        rows = repetition_rows(result.test, result.earlier, result.later)
        self._runs = tuple(test.run for test in tests)
        self.blockSignals(True)
        self.setRowCount(len(rows))
        for place, row in enumerate(rows):
            values = [DASH if row.r[name] is None else f"{row.r[name]:.4f}" for name in METHODS]
            name = f"{row.test} (this)" if row.this else row.test
            verdict = "good" if row.good else "not good"
            cells = [name, f"{row.phi0:.4f}", str(row.impacts), *values, verdict]
            first = self._set_row(place, cells, bold=row.this)
            if not row.this:
                first.setFlags(first.flags() | Qt.ItemFlag.ItemIsUserCheckable)
                first.setCheckState(Qt.CheckState.Checked if row.good else Qt.CheckState.Unchecked)
                first.setToolTip("Tick to lay it over the test; double click to open it")
        self.blockSignals(False)
        self._fit()
        self.scrollTo(self.model().index(len(result.earlier), 0))

    def _set_row(self, place: int, cells: Sequence[str], *, bold: bool) -> QTableWidgetItem:
        """Fill a row; returns its first cell."""
        items = [QTableWidgetItem(text) for text in cells]
        for column, item in enumerate(items):
            item.setFlags(item.flags() & ~(Qt.ItemFlag.ItemIsEditable | Qt.ItemFlag.ItemIsUserCheckable))
            if bold:
                item.setFont(self._colours.font(10, bold=True))
            self.setItem(place, column, item)
        return items[0]

    def _is_ticked(self, row: int) -> bool:
        item = self.item(row, 0)
        return bool(
            item is not None
            and item.flags() & Qt.ItemFlag.ItemIsUserCheckable
            and item.checkState() is Qt.CheckState.Checked
        )
