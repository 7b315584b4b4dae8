"""Sounds: the system's beep in patterns that tell the cues apart.

The beep needs no audio device and no library of its own; where the system has no beep nothing is heard,
and everything that is heard is on the screen as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QApplication

from daq_app.monitor.course.cues import Cue

PATTERNS_MS: Final[dict[Cue, tuple[int, ...]]] = {
    Cue.ON_TARGET: (0,),
    Cue.RELEASED: (0, 180),
    Cue.AT_REST: (0, 600),
    Cue.ALARM: (0, 150, 300, 450),
    Cue.RECORDING_LOST: (0, 150, 300, 700, 850, 1000),
}
"""When the beeps of each cue sound, ms after it."""


class Sounds(QObject):
    """Plays cues. `beep` makes one sound."""

    def __init__(self, beep: Callable[[], None] = QApplication.beep, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._beep = beep
        self.on = True

    def play(self, cues: Iterable[Cue]) -> None:
        """Let the most urgent of the cues be heard, unless sounds are off."""
        cue = next(iter(cues), None)
        if cue is None or not self.on:
            return
        for after_ms in PATTERNS_MS[cue]:
            QTimer.singleShot(after_ms, self, self._sound)

    def _sound(self) -> None:
        if self.on:
            self._beep()
