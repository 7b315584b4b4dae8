"""The picture of the test on the page and full screen, and what is heard with it."""

from __future__ import annotations

from typing import Final

from PySide6.QtCore import QObject
from PySide6.QtGui import QKeySequence, QScreen, QShortcut
from PySide6.QtWidgets import QWidget

from daq_app.monitor.course.course_view import CourseView
from daq_app.monitor.course.cues import CueWatch
from daq_app.monitor.course.full_screen import FullScreen, display_beside
from daq_app.monitor.course.sounds import Sounds
from daq_app.monitor.data.session import Session
from daq_app.monitor.data.settings import WindowSettings
from daq_app.monitor.look.theme import Colours
from daq_app.monitor.pages.test_page import TestPage
from daq_app.monitor.widgets.actions import ACTIONS
from daq_app.monitor.window.window_frame import WindowFrame

_EVERY: Final = 3
"""The picture is painted with every third frame of the window: 20 times a second."""
_TYPED: Final = "note"
"""The order that needs the window's own line."""


class TestDisplay(QObject):
    """Holds the page and the full screen; the window calls `frame` and `refresh`."""

    __test__ = False  # no test case of pytest

    def __init__(
        self, session: Session, page: TestPage, frame: WindowFrame, settings: WindowSettings, window: QWidget
    ) -> None:
        super().__init__(window)
        self._session, self._page, self._frame, self._settings = session, page, frame, settings
        self._window = window
        self._colours: Colours | None = None
        self._frames = 0
        self._watch = CueWatch()
        self.sounds = Sounds(parent=self)
        self.sounds.on = settings.sounds
        self.full_screen: FullScreen | None = None
        page.sound_button.setChecked(settings.sounds)
        page.sound_button.toggled.connect(self._on_sounds)
        page.full_screen_wanted.connect(self.toggle)
        QShortcut(QKeySequence("F11"), window).activated.connect(self.toggle)
        QShortcut(QKeySequence("Ctrl+M"), window).activated.connect(page.sound_button.toggle)

    def _on_sounds(self, on: bool) -> None:
        self.sounds.on = self._settings.sounds = on

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self._page.restyle(colours)
        if self.full_screen is not None:
            self.full_screen.view.restyle(colours)

    def toggle(self, screen: QScreen | None = None) -> None:
        """Open the full screen on `screen` (a second display, if there is one), or close it."""
        if self.full_screen is not None:
            self.full_screen.close()
            return
        if self._colours is None:
            return
        chosen = screen or display_beside(self._window)
        covers = chosen is self._window.screen()
        self.full_screen = FullScreen(self._session, self._colours, chosen, covers=covers)
        self.full_screen.closed.connect(self._on_closed)
        QShortcut(QKeySequence("F11"), self.full_screen).activated.connect(self.full_screen.close)
        if covers:
            self._hand_keys_on(self.full_screen)
        self.refresh()

    def _hand_keys_on(self, screen: FullScreen) -> None:
        """The orders work where the operator's window is covered; a note is typed in that window."""
        for action in ACTIONS:
            press = self._frame.actions_bar.press
            QShortcut(QKeySequence(action.key), screen).activated.connect(
                lambda a=action, p=press: (screen.close() if a.name == _TYPED else None, p(a))
            )
        QShortcut(QKeySequence("Ctrl+D"), screen).activated.connect(self._frame.notices.dismiss)

    def _on_closed(self) -> None:
        self.full_screen = None
        self._window.activateWindow()

    def _views(self) -> list[CourseView]:
        """The pictures that can be seen now."""
        views = [self._page.view] if self._page.view.isVisible() else []
        return views + ([self.full_screen.view] if self.full_screen is not None else [])

    def frame(self) -> None:
        """A frame of the window has passed."""
        self._frames += 1
        if self._frames % _EVERY == 0:
            for view in self._views():
                view.refresh()

    def show_state(self) -> None:
        """The recorder's words have changed: they are painted together with those of the header."""
        for view in self._views():
            view.refresh()

    def show_estimate(self) -> None:
        """r has come: it is on screen before the next frame."""
        for view in self._views():
            view.repaint()

    def refresh(self) -> None:
        """Let be heard what is new, and bring the lower edge of the full screen up to date."""
        self.sounds.play(self._watch.look(self._session))
        if self.full_screen is not None:
            self.full_screen.view.footer = self._footer(covers=self.full_screen.covers)
        self.show_state()

    def _footer(self, *, covers: bool) -> str:
        """The message in front; without one the keys, where they are wanted here."""
        notice = self._frame.notices.current
        if notice is not None:
            signs = {"info": "●", "warning": "⚠", "error": "✕"}
            return f"{signs[notice[0]]} {notice[1]}"
        if not covers:
            return ""
        orders = [b.text() for b in self._frame.actions_bar.buttons.values() if b.isEnabled()]
        return "     ".join([*orders, "Back  Esc"])

    def close(self) -> None:
        """The window closes: so does the full screen."""
        if self.full_screen is not None:
            self.full_screen.close()
