"""Text on screen: labels with a role, and numbers as a person reads them."""

from __future__ import annotations

import html
import math

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QFontMetricsF, QResizeEvent
from PySide6.QtWidgets import QApplication, QFrame, QLabel, QSizePolicy, QVBoxLayout, QWidget

from daq_app.config.shown_text import visible
from daq_app.config.wording import signed
from daq_app.monitor.look.theme import font

DASH = "–"
"""Stands where no true value is known."""


class PlainLabel(QLabel):
    """A label whose words are words: no tags, and a character without a picture shows as its code."""

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setText(text)

    def setText(self, text: str) -> None:
        """Show a text, whoever wrote it."""
        super().setText(visible(text))


def tip_text(text: str) -> str:
    """A text for a tool tip, in which Qt would take some words for tags; long lines are folded."""
    shown = html.escape(visible(text).strip())
    return "<qt>" + shown.replace("\n", "<br>") + "</qt>" if shown else ""


class FittedLabel(PlainLabel):
    """A line that stays whole: in smaller type where there is too little room for it."""

    _tenths = 0
    """Tenths of a point in which the line is shown; 0 before it was fitted."""

    def __init__(self, role: str, parent: QWidget | None = None) -> None:
        super().__init__("", parent)
        self.setProperty("role", role)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def setText(self, text: str) -> None:
        """Show a text as large as it fits."""
        if text != self.text():
            super().setText(text)
            self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Another room."""
        super().resizeEvent(event)
        self._fit()

    def changeEvent(self, event: QEvent) -> None:
        """Another type size."""
        super().changeEvent(event)
        if event.type() is QEvent.Type.FontChange:
            self._fit()

    def _fit(self) -> None:
        # Letters are drawn on whole pixels: a line of them may be a little wider than its type says.
        room = 0.97 * self.width()
        tenths = fitting_tenths(self.text(), QApplication.font().pointSizeF(), room, bold=False)
        if self._tenths != tenths:
            self._tenths = tenths
            self.setStyleSheet(f"font-size: {tenths / 10:.1f}pt;")


def fitting_tenths(text: str, points: float, room: float, *, bold: bool) -> int:
    """Tenths of a point at which a text is no wider than its room, those of the usual size at most."""
    needs = QFontMetricsF(font(points, bold=bold)).horizontalAdvance(text)
    return round(10 * points * min(1.0, room / needs if needs > 0 and room > 0 else 1.0) - 0.5)


def role_label(text: str, role: str, parent: QWidget | None = None) -> QLabel:
    """A label that the style sheet knows by its role."""
    label = PlainLabel(text, parent)
    label.setProperty("role", role)
    return label


def set_role(label: QWidget, role: str) -> None:
    """Change a widget's role and have its style computed anew."""
    if label.property("role") != role:
        label.setProperty("role", role)
        label.style().unpolish(label)
        label.style().polish(label)


def number(value: float | None, digits: int, unit: str = "") -> str:
    """A number with fixed decimals and a true minus sign; a dash when there is none."""
    if value is None or not math.isfinite(value):
        return DASH
    text = signed(value, f".{digits}f")
    if text.strip("−0.") == "":
        text = text.lstrip("−")
    return f"{text} {unit}" if unit else text


def size_text(n_bytes: float) -> str:
    """Bytes as kB, MB, GB (powers of ten, as disks are sold)."""
    for unit, scale, digits in (("TB", 1e12, 2), ("GB", 1e9, 1), ("MB", 1e6, 1), ("kB", 1e3, 0)):
        if n_bytes >= scale:
            return f"{n_bytes / scale:.{digits}f} {unit}"
    return f"{n_bytes:.0f} B"


def restitution_text(mean: float | None) -> str:
    """Mean r."""
    return DASH if mean is None else f"{mean:.3f}"


class Tile(QFrame):
    """A caption, one large value and a line below: what can be read at three metres."""

    def __init__(self, caption: str, points: float = 21.0, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("card")
        self._caption = role_label(caption, "heading")
        self._value = PlainLabel(DASH)
        self._value.setFont(font(points, bold=True))
        self._points = points
        self._tenths: dict[QLabel, int] = {}
        self._detail = role_label("", "muted")
        layout = QVBoxLayout(self)
        layout.setContentsMargins(12, 6, 10, 6)
        layout.setSpacing(0)
        for widget in (self._caption, self._value, self._detail):
            widget.setTextInteractionFlags(Qt.TextInteractionFlag.NoTextInteraction)
            widget.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
            layout.addWidget(widget)

    def set_points(self, points: float) -> None:
        """Change the size of the value."""
        self._points = points
        self._fit_all()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """What stands on the tile stays whole."""
        super().resizeEvent(event)
        self._fit_all()

    def changeEvent(self, event: QEvent) -> None:
        """So it does at another type size."""
        super().changeEvent(event)
        if event.type() is QEvent.Type.FontChange:
            self._tenths.clear()
            self._fit_all()

    def _fit_all(self) -> None:
        base = QApplication.font().pointSizeF()
        self._fit(self._caption, 0.95 * base, bold=True)
        self._fit(self._value, self._points, bold=True)
        self._fit(self._detail, base, bold=False)

    def _fit(self, label: QLabel, points: float, *, bold: bool) -> None:
        """The usual size, or less where the text would be wider than the tile."""
        tenths = fitting_tenths(label.text(), points, self.width() - 33, bold=bold)
        if self._tenths.get(label) != tenths:
            self._tenths[label] = tenths
            label.setStyleSheet(f"font-size: {tenths / 10:.1f}pt;")

    def show_value(self, value: str, detail: str = "", role: str = "") -> None:
        """Set the value, the line below it and the role of its colour (good, warning, bad or none)."""
        if self._value.text() != value:
            self._value.setText(value)
            self._fit(self._value, self._points, bold=True)
        if self._detail.text() != detail:
            self._detail.setText(detail)
            self._fit(self._detail, QApplication.font().pointSizeF(), bold=False)
        set_role(self._value, role)

    @property
    def value(self) -> str:
        """The value as shown."""
        return self._value.text()

    @property
    def detail(self) -> str:
        """The line below the value."""
        return self._detail.text()
