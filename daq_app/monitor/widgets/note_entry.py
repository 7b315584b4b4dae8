"""A line to type a note into the record, without a box in front of the test."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLineEdit, QWidget

from daq_app.monitor.look.labels import role_label

LONGEST = 400


class NoteEntry(QFrame):
    """Hidden until `ask`; emits `noted(text)` on Enter. Esc gives up."""

    noted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("bar")
        self.line = QLineEdit()
        self.line.setMaxLength(LONGEST)
        self.line.setPlaceholderText("What happened?")
        self.line.returnPressed.connect(self._finish)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 5, 16, 5)
        layout.setSpacing(10)
        layout.addWidget(role_label("Note", "heading"))
        layout.addWidget(self.line, 1)
        layout.addWidget(role_label("Enter writes it into the record at that instant, Esc gives up", "muted"))
        self.hide()

    def ask(self) -> None:
        """Show the line and put the cursor into it; what was typed before is still there."""
        self.show()
        self.line.setFocus(Qt.FocusReason.ShortcutFocusReason)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Esc hides the line; what was typed stays for the next time."""
        if event.key() == Qt.Key.Key_Escape:
            self.hide()
            return
        super().keyPressEvent(event)

    def _finish(self) -> None:
        text = self.line.text().strip()
        self.hide()
        self.line.clear()
        if text:
            self.noted.emit(text)
