"""The rail at the left: pages by number, theme and type size."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QButtonGroup, QFrame, QPushButton, QVBoxLayout, QWidget


class NavigationRail(QFrame):
    """Emits `page_wanted(place)`, `theme_wanted` and `size_wanted(steps)`. Every button has a key."""

    page_wanted = Signal(int)
    theme_wanted = Signal()
    size_wanted = Signal(int)

    def __init__(self, names: Sequence[str], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("bar")
        self._group = QButtonGroup(self)
        self._rail = QVBoxLayout(self)
        self._rail.setContentsMargins(0, 10, 0, 10)
        self._rail.setSpacing(2)
        for place, name in enumerate(names):
            button = self._add(name, "", f"Ctrl+{place + 1}")
            button.setCheckable(True)
            button.clicked.connect(lambda _checked=False, p=place: self.page_wanted.emit(p))
            self._group.addButton(button, place)
        self._rail.addStretch(1)
        self._add("Theme", "Light or dark", "Ctrl+T").clicked.connect(self.theme_wanted)
        self._add("A+", "Larger type", "Ctrl++").clicked.connect(lambda: self.size_wanted.emit(1))
        self._add("A−", "Smaller type", "Ctrl+-").clicked.connect(lambda: self.size_wanted.emit(-1))

    def _add(self, text: str, tip: str, key: str) -> QPushButton:
        button = QPushButton(text)
        button.setProperty("role", "nav")
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # reached by its key
        button.setToolTip(f"{tip}  ({key})" if tip else key)
        button.setShortcut(key)
        self._rail.addWidget(button)
        return button

    def fit(self) -> None:
        """As wide as the longest name: called after every change of the type."""
        buttons = self.findChildren(QPushButton)
        for button in buttons:
            button.ensurePolished()
        self.setFixedWidth(max(button.sizeHint().width() for button in buttons))

    def mark(self, place: int) -> None:
        """Show which page is in front."""
        self._group.button(place).setChecked(True)
