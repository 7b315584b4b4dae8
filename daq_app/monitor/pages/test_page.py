"""The test page: pull, hold, release and rocking in one picture, here or full screen on another display."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtGui import QGuiApplication, QScreen
from PySide6.QtWidgets import QHBoxLayout, QMenu, QPushButton, QVBoxLayout, QWidget

from daq_app.monitor.course.course_view import CourseView
from daq_app.monitor.course.full_screen import display_name
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import role_label
from daq_app.monitor.look.theme import Colours


class TestPage(QWidget):
    """Emits `full_screen_wanted(display)`: a `QScreen`, or None for the one that suits."""

    __test__ = False  # no test case of pytest
    full_screen_wanted = Signal(object)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.view = CourseView(session)
        self.sound_button = QPushButton("Sounds  (Ctrl+M)")
        self.sound_button.setCheckable(True)
        self.sound_button.setToolTip("Beeps: on target, alarm, released, at rest, recording lost")
        self.screen_button = QPushButton("Full screen  (F11)")
        self.screen_button.setToolTip("This picture alone on a display, a second one where there is one")
        self.menu_button = QPushButton("on …")
        self.menu_button.setToolTip("Choose the display")
        self._menu = QMenu(self)
        self.menu_button.setMenu(self._menu)
        for button in (self.sound_button, self.screen_button, self.menu_button):
            button.setProperty("role", "flat")
        tools = QHBoxLayout()
        tools.addWidget(role_label("What counts, to be read from beside the wall", "muted"), 1)
        for button in (self.sound_button, self.screen_button, self.menu_button):
            tools.addWidget(button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 0)
        layout.setSpacing(2)
        layout.addLayout(tools)
        layout.addWidget(self.view, 1)
        self._menu.aboutToShow.connect(self.list_displays)
        self.screen_button.clicked.connect(lambda: self.full_screen_wanted.emit(None))

    def list_displays(self) -> list[str]:
        """Fill the menu with the displays that are there now; returns their names."""
        self._menu.clear()
        names = []
        for number, screen in enumerate(QGuiApplication.screens(), start=1):
            names.append(display_name(screen, number))
            self._menu.addAction(names[-1]).triggered.connect(
                lambda _checked=False, chosen=screen: self._choose(chosen)
            )
        return names

    def _choose(self, screen: QScreen) -> None:
        self.full_screen_wanted.emit(screen)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self.view.restyle(colours)
