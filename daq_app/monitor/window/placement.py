"""Keeps a window on its screen together with its frame, which the window manager adds after it is shown."""

from __future__ import annotations

from typing import Final

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QWidget

_AFTER_MS: Final = (0, 250, 1000)
"""When the frame may be known: some window managers tell of it late."""


def keep_on_screen(window: QWidget) -> None:
    """Fit `window`, which has just been shown, as soon as its frame is known."""
    for after_ms in _AFTER_MS:
        QTimer.singleShot(after_ms, window, lambda: fit_to_screen(window))


def fit_to_screen(window: QWidget) -> None:
    """Make it smaller and move it until frame and all are on the screen, beside the task bar.

    A window that is larger than the whole screen was made so on purpose, and stays.
    """
    screen, frame = window.screen(), window.frameGeometry()
    room = screen.availableGeometry()
    whole = screen.geometry().size()
    larger = window.width() > whole.width() or window.height() > whole.height()
    if window.isMaximized() or window.isFullScreen() or larger or room.contains(frame):
        return
    beside, above = frame.width() - window.width(), frame.height() - window.height()
    window.resize(min(window.width(), room.width() - beside), min(window.height(), room.height() - above))
    frame = window.frameGeometry()
    left = max(room.left(), min(frame.left(), room.right() + 1 - frame.width()))
    top = max(room.top(), min(frame.top(), room.bottom() + 1 - frame.height()))
    window.move(left, top)
