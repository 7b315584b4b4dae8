"""The picture of the test alone on a display: a second one, or the only one."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QCloseEvent, QGuiApplication, QKeyEvent, QScreen
from PySide6.QtWidgets import QVBoxLayout, QWidget

from daq_app.monitor.course.course_view import CourseView
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.theme import Colours


class FullScreen(QWidget):
    """A window with nothing but the picture. Emits `closed` when it has gone.

    On a display of its own it takes no keys: they belong to the operator's window. Where it covers that
    window, keys come here: Esc and F11 close it, the owner adds its own shortcuts.
    """

    closed = Signal()

    def __init__(self, session: Session, colours: Colours, screen: QScreen, *, covers: bool) -> None:
        """`covers`: the operator's window is on the same display."""
        super().__init__()
        self.covers = covers
        self.setWindowTitle("Rocking-test recorder: the test")
        self.view = CourseView(session)
        self.view.restyle(colours)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.view)
        if not covers:
            self.setWindowFlag(Qt.WindowType.WindowDoesNotAcceptFocus)
            self.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setScreen(screen)
        self.setGeometry(screen.geometry())
        self.showFullScreen()
        if covers:
            self.activateWindow()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Esc goes back."""
        if event.key() == Qt.Key.Key_Escape:
            self.close()
        else:
            super().keyPressEvent(event)

    def closeEvent(self, event: QCloseEvent) -> None:
        super().closeEvent(event)
        self.closed.emit()


def display_beside(window: QWidget) -> QScreen:
    """A display that `window` is not on, else its own."""
    own = window.screen()
    return next((screen for screen in QGuiApplication.screens() if screen is not own), own)


def display_name(screen: QScreen, number: int) -> str:
    """How a display is called in the menu."""
    size = screen.size()
    return f"Display {number}: {screen.name()}, {size.width()} × {size.height()}"
