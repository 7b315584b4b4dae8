"""The head of a page that ends in a verdict: sign, title and sentences, and buttons that have keys."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices, QKeySequence, QShortcut
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from daq_app.monitor.widgets.labels import role_label
from daq_app.monitor.widgets.shapes import Sign
from daq_app.monitor.widgets.theme import font

_SIGN_PX = 30


class Banner(QFrame):
    """A card: the sign, a large title with one label per sentence below it, buttons at the right."""

    def __init__(self, title: str, *sentences: str, points: float) -> None:
        """`points`: size of the title."""
        super().__init__()
        self.setObjectName("card")
        self.sign = Sign(_SIGN_PX)
        self.title = QLabel(title)
        self.title.setFont(font(points, bold=True))
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

    def add_buttons(self, *buttons: QPushButton) -> None:
        """Put buttons at the right."""
        for button in buttons:
            self._row.addWidget(button, 0, Qt.AlignmentFlag.AlignTop)


def keyed_button(page: QWidget, text: str, key: str, act: Callable[[], object]) -> QPushButton:
    """A button that names its key, which presses it as long as `page` is in front."""
    button = QPushButton(f"{text}  {key}")
    button.clicked.connect(lambda _checked=False: act())
    QShortcut(QKeySequence(key), page).activated.connect(button.click)
    return button


def open_outside(path: Path) -> bool:
    """Show a saved page with what this computer shows such files with; False where there is nothing."""
    return QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))
