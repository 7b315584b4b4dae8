"""What stands around the pages: header, messages, the rail of pages, and orders and health figures."""

from __future__ import annotations

from typing import Final

from PySide6.QtGui import QKeySequence, QResizeEvent, QShortcut
from PySide6.QtWidgets import (
    QBoxLayout,
    QFrame,
    QHBoxLayout,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from daq_app.monitor.data.session import Session
from daq_app.monitor.widgets.actions import ActionBar
from daq_app.monitor.widgets.note_entry import NoteEntry
from daq_app.monitor.widgets.notices import NoticeLine
from daq_app.monitor.window.header import Header
from daq_app.monitor.window.health_bar import HealthBar
from daq_app.monitor.window.navigation import NavigationRail

_FOOTER_SPARE_PX: Final = 28
"""Margins and the gap between orders and figures."""


class WindowFrame(QWidget):
    """The window's content: one page at a time in `stack`, everything else always there."""

    def __init__(
        self, session: Session, pages: dict[str, QWidget], notices: NoticeLine, *, live: bool
    ) -> None:
        """`live` False: a window for looking at runs, without the parts that speak of the present."""
        super().__init__()
        self.header = Header(session)
        self.notices = notices
        self.note_entry = NoteEntry()
        self.actions_bar = ActionBar()
        self.health = HealthBar(session)
        self.pages = pages
        # A shortcut of the window: with no message to read, the key must not reach a field and edit it.
        QShortcut(QKeySequence("Ctrl+D"), self).activated.connect(self.notices.dismiss)
        self.stack = QStackedWidget()
        for page in pages.values():
            self.stack.addWidget(page)
        self.rail = NavigationRail(list(pages))
        footer = QFrame()
        footer.setObjectName("bar")
        footer.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self._footer = QBoxLayout(QBoxLayout.Direction.LeftToRight, footer)
        self._footer.setContentsMargins(10, 5, 12, 5)
        self._footer.addWidget(self.actions_bar)
        self._footer.addStretch(1)
        self._footer.addWidget(self.health)
        middle = QHBoxLayout()
        middle.setSpacing(0)
        middle.addWidget(self.rail)
        middle.addWidget(self.stack, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.header)
        layout.addWidget(self.notices)
        layout.addWidget(self.note_entry)
        layout.addLayout(middle, 1)
        layout.addWidget(footer)
        if not live:
            for part in (self.header, footer):
                part.hide()  # nothing is live here, so nothing may look as if it were

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Orders and figures stand in one row where there is room, else below each other."""
        super().resizeEvent(event)
        self.fit_footer()

    def fit_footer(self) -> None:
        """Called on a change of size or type, and as figures grow: a gap is told with its samples."""
        needs = self.actions_bar.sizeHint().width() + self.health.sizeHint().width() + _FOOTER_SPARE_PX
        directions = QBoxLayout.Direction
        stacked = needs > self.width()
        self._footer.setDirection(directions.TopToBottom if stacked else directions.LeftToRight)

    def show_page(self, page: QWidget) -> None:
        """Bring a page to the front; one that this window does not have stays away."""
        if page not in self.pages.values():
            return
        self.stack.setCurrentWidget(page)
        self.rail.mark(list(self.pages.values()).index(page))
