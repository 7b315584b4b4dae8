"""Messages to the operator: a line that stays until it is read, never a box in the way."""

from __future__ import annotations

import datetime as dt
from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QSizePolicy, QWidget

from daq_app.monitor.look.labels import PlainLabel, role_label
from daq_app.monitor.look.shapes import Sign
from daq_app.monitor.look.theme import Colours

INFO_MS: Final = 8000
LOG_MESSAGES: Final = 1000
"""Messages kept in the log: more than any test day has."""
Severity = Literal["info", "warning", "error"]
_SHAPES: dict[str, str] = {"info": "disc", "warning": "triangle", "error": "cross"}
_TONES: dict[str, str] = {"info": "accent", "warning": "warning", "error": "bad"}


@dataclass(slots=True)
class Told:
    """One message of the log."""

    at: dt.datetime
    severity: Severity
    text: str
    trouble: str = ""
    """What it is about, where its end is told as well."""
    over: dt.datetime | None = None
    """When that was over."""


class NoticeLine(QFrame):
    """Shows the newest notice; hidden while there is none. Errors stay in front of what is milder."""

    logged = Signal()
    """The log has changed."""
    changed = Signal()
    """Another notice is in front, or none."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("bar")
        self._colours: Colours | None = None
        self._queue: deque[tuple[Severity, str]] = deque(maxlen=50)
        self.log: deque[Told] = deque(maxlen=LOG_MESSAGES)
        """Everything that was told, newest last."""
        self._sign = Sign(18)
        self._text = PlainLabel()
        self._text.setWordWrap(True)
        self._text.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._more = role_label("", "muted")
        button = QPushButton("Read  (Ctrl+D)")
        button.setProperty("role", "flat")
        button.clicked.connect(self.dismiss)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(16, 5, 16, 5)
        layout.setSpacing(10)
        layout.addWidget(self._sign)
        layout.addWidget(self._text, 1)
        layout.addWidget(self._more)
        layout.addWidget(button)
        self._fade = QTimer(self)
        self._fade.setSingleShot(True)
        self._fade.setInterval(INFO_MS)
        self._fade.timeout.connect(self._let_info_go)
        self.hide()

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self._show()

    def tell(self, severity: Severity, text: str, trouble: str = "") -> None:
        """Show a notice; a repetition of one that waits is not added.

        `trouble`: what it is about, so that `settle` can take it away when it is over.
        """
        if not text or any(text == waiting for _, waiting in self._queue):
            return
        self.log.append(Told(dt.datetime.now(), severity, text, trouble if severity != "info" else ""))
        self.logged.emit()
        if severity == "info":
            # What is good to know gives way to the next such line by itself.
            for old in [notice for notice in self._queue if notice[0] == "info"]:
                self._queue.remove(old)
            self._queue.append((severity, text))
            self._fade.start()
        else:
            self._queue.appendleft((severity, text))
        self._show()

    def settle(self, *troubles: str) -> None:
        """These troubles are over: their warnings leave; the log keeps them."""
        lasting = [told for told in self.log if told.trouble in troubles and told.over is None]
        if not lasting:
            return
        for told in lasting:
            told.over = dt.datetime.now()
            if (told.severity, told.text) in self._queue:
                self._queue.remove((told.severity, told.text))
        self.logged.emit()
        self._show()

    def _let_info_go(self) -> None:
        """What was only good to know leaves by itself; warnings and errors wait to be read."""
        for old in [notice for notice in self._queue if notice[0] == "info"]:
            self._queue.remove(old)
        self._show()

    def dismiss(self) -> None:
        """The notice in front has been read."""
        if self._queue:
            self._queue.popleft()
        self._show()

    @property
    def current(self) -> tuple[Severity, str] | None:
        """Severity and text of the notice in front."""
        return self._queue[0] if self._queue else None

    def _show(self) -> None:
        self.changed.emit()
        if not self._queue:
            self.hide()
            return
        severity, text = self._queue[0]
        if self._colours is not None:
            self._sign.show_shape(_SHAPES[severity], str(getattr(self._colours, _TONES[severity])))
        self._text.setText(text)
        rest = len(self._queue) - 1
        self._more.setText(f"{rest} more" if rest else "")
        self.show()
