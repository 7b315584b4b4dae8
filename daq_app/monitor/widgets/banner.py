"""The head of a page that ends in a verdict: sign, title and sentences, and buttons that have keys."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, cast

from PySide6.QtCore import QEvent, Qt, SignalInstance
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from daq_app.monitor.look.labels import PlainLabel, role_label
from daq_app.monitor.look.shapes import Sign

_SIGN_PX = 30
_ONE_ROW_UP_TO_PT = 12.0
"""Type size up to which all buttons stand in one row: larger, they would leave no room for the title."""


class Banner(QFrame):
    """A card: the sign, a large title with one label per sentence below it, buttons at the right."""

    def __init__(self, title: str, *sentences: str, points: float) -> None:
        """`points`: size of the title."""
        super().__init__()
        self.setObjectName("card")
        self.sign = Sign(_SIGN_PX)
        self.title = PlainLabel(title)
        self.title.setProperty("scale", "verdict")
        self.sentences = tuple(role_label(sentence, "muted") for sentence in sentences)
        words = QVBoxLayout()
        words.setSpacing(1)
        words.addWidget(self.title)
        for label in self.sentences:
            label.setWordWrap(True)
            words.addWidget(label)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(14, 8, 14, 8)
        self._row.setSpacing(12)
        self._row.addWidget(self.sign, 0, Qt.AlignmentFlag.AlignTop)
        self._row.addLayout(words, 1)
        self._grid = QGridLayout()
        self._row.addLayout(self._grid)
        self._buttons: list[QPushButton] = []

    def add_buttons(self, *buttons: QPushButton) -> None:
        """Put buttons at the right; in large type they stand in two rows."""
        self._buttons += buttons
        self._arrange()

    def changeEvent(self, event: QEvent) -> None:
        """Another type size needs other room."""
        super().changeEvent(event)
        if event.type() is QEvent.Type.FontChange:
            self._arrange()

    def _arrange(self) -> None:
        large = QApplication.font().pointSizeF() > _ONE_ROW_UP_TO_PT and len(self._buttons) > 2
        columns = -(-len(self._buttons) // 2) if large else max(1, len(self._buttons))
        for place, button in enumerate(self._buttons):
            self._grid.addWidget(button, *divmod(place, columns))


class TellingPage(Protocol):
    """A page that can say something in the message line."""

    @property
    def told(self) -> SignalInstance:
        """Severity and text."""


def keyed_button(page: QWidget, text: str, key: str, act: Callable[[], object]) -> QPushButton:
    """A button that names its key, which presses it as long as `page` is in front.

    `page` is a `TellingPage` as well: silence after a key would look as if it had been obeyed.
    """
    button = QPushButton(f"{text}  {key}")
    button.clicked.connect(lambda _checked=False: act())

    def press() -> None:
        if button.isEnabled():
            button.click()
        else:
            cast("TellingPage", page).told.emit(
                "info", f"{text}: not yet. There is nothing that it could act on."
            )

    QShortcut(QKeySequence(key), page).activated.connect(press)
    return button
