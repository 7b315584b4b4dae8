"""How far to pull: the rotation now, the target, and what to do, readable from beside the winch."""

from __future__ import annotations

import math
from dataclasses import dataclass

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages.published import MotionMessage
from daq_app.monitor.data.session import Session
from daq_app.monitor.widgets.labels import DASH, number
from daq_app.monitor.widgets.theme import DARK, Colours, font

ON_TARGET = 0.02
"""Within this share of the target the pull is right."""


@dataclass(frozen=True, slots=True)
class PullAdvice:
    """What the gauge says."""

    words: str
    role: str
    """Theme colour: text, good, warning, bad or muted."""


def pull_advice(tilt_rad: float, target_rad: float, alpha_rad: float) -> PullAdvice:
    """What to do at this rotation to come to the target on either side."""
    if not math.isfinite(tilt_rad):
        return PullAdvice("The rotation is not live", "muted")
    if not math.isfinite(target_rad) or target_rad <= 0:
        return PullAdvice("Choose a test to get a target", "muted")
    missing = target_rad - abs(tilt_rad)
    if abs(missing) <= ON_TARGET * target_rad:
        return PullAdvice("On target: hold", "good")
    if missing > 0:
        return PullAdvice(f"Pull {1e3 * missing:.1f} mrad more", "text")
    over = "ease back" if abs(tilt_rad) < 0.6 * alpha_rad else "STOP, ease back: near overturning"
    return PullAdvice(
        f"{-1e3 * missing:.1f} mrad too far: {over}", "warning" if "STOP" not in over else "bad"
    )


class PullGauge(QWidget):
    """The gauge: tiltmeters' rotation over α from 0 to 0.5, target marked."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
        self.target_ratio = math.nan
        self.setMinimumHeight(150)

    def sizeHint(self) -> QSize:
        return QSize(360, 160)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.update()

    def _tilt_rad(self) -> float:
        session = self._session
        return session.tilt_rad if session.fresh(MotionMessage) else math.nan

    @property
    def advice(self) -> PullAdvice:
        """What the gauge says now."""
        alpha = self._session.alpha_rad
        return pull_advice(self._tilt_rad(), self.target_ratio * alpha, alpha)

    def paintEvent(self, event: QPaintEvent) -> None:
        colours = self._colours
        tilt, alpha = self._tilt_rad(), self._session.alpha_rad
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        width, height = self.width(), self.height()
        left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        # The figure fills what room there is: it is read from beside the winch.
        large = max(26.0, min(64.0, min(height * 0.16, width * 0.12)))
        words = max(13.0, min(24.0, large * 0.45))
        line = 1.5 * large
        top = QRectF(0, 0, width, line)
        painter.setPen(QColor(colours.text))
        painter.setFont(font(large, bold=True))
        painter.drawText(top, left, number(abs(tilt) / alpha, 3))
        painter.setPen(QColor(colours.muted))
        painter.setFont(font(11))
        detail = number(tilt * 1e3, 1, "mrad") if math.isfinite(tilt) else DASH
        painter.drawText(top, right, f"θ/α by tiltmeters\n{detail}")
        bar = QRectF(1, line + 8, width - 2, max(14.0, min(44.0, height * 0.13)))
        full = max(0.5, 1.25 * self.target_ratio) if math.isfinite(self.target_ratio) else 0.5
        self._paint_bar(painter, bar, abs(tilt) / alpha, full)
        advice = self.advice
        painter.setPen(QColor(str(getattr(colours, advice.role))))
        painter.setFont(font(words, bold=True))
        below = QRectF(0, bar.bottom() + 24, width, height - bar.bottom() - 24)
        wrap = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop | Qt.TextFlag.TextWordWrap
        painter.drawText(below, int(wrap), advice.words)
        painter.end()

    def _paint_bar(self, painter: QPainter, bar: QRectF, ratio: float, full: float) -> None:
        colours = self._colours
        painter.setPen(QPen(QColor(colours.line), 1))
        painter.setBrush(QColor(colours.raised))
        painter.drawRoundedRect(bar, 3, 3)
        if math.isfinite(ratio):
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.rotation))
            painter.drawRoundedRect(
                QRectF(bar.left(), bar.top(), bar.width() * min(1.0, ratio / full), bar.height()), 3, 3
            )
        if not math.isfinite(self.target_ratio):
            return
        x = bar.left() + bar.width() * self.target_ratio / full
        half = bar.width() * ON_TARGET * self.target_ratio / full
        painter.setPen(Qt.PenStyle.NoPen)
        band = QColor(colours.good)
        band.setAlpha(90)
        painter.setBrush(band)
        painter.drawRect(QRectF(x - half, bar.top() - 5, 2 * half, bar.height() + 10))
        painter.setPen(QPen(QColor(colours.good), 2))
        painter.drawLine(int(x), int(bar.top() - 6), int(x), int(bar.bottom() + 6))
        painter.setFont(font(9, bold=True))
        align = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop
        painter.drawText(QRectF(x - 90, bar.bottom() + 6, 180, 16), align, f"target {self.target_ratio:.2f}")
