"""How far to pull: the rotation now, the target, and what to do, readable from beside the winch."""

from __future__ import annotations

import math

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages.published import Call, Judgement, MotionMessage
from daq_app.monitor.data.session import Session
from daq_app.monitor.widgets.labels import DASH, number
from daq_app.monitor.widgets.theme import DARK, Colours, font


class PullGauge(QWidget):
    """The gauge: tiltmeters' rotation over α, the band of the recorder's plan, and its words."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
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
    def words(self) -> str:
        """What the gauge says now: the recorder's words, or that the rotation is not live."""
        if not self._session.fresh(MotionMessage):
            return "The rotation is not live"
        judgement = self._session.judgement
        left_s = judgement.hold_s - judgement.held_s
        counts = judgement.call is Call.HOLD and judgement.held_s > 0 and left_s > 0
        return f"{judgement.gauge}  {math.ceil(left_s)} s" if counts else judgement.gauge

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
        judgement = self._session.judgement
        full = max(0.5, 1.25 * (judgement.high or 0.0))
        self._paint_bar(painter, bar, abs(tilt) / alpha, full, judgement)
        role = judgement.tone if self._session.fresh(MotionMessage) else "muted"
        painter.setPen(QColor(str(getattr(colours, role))))
        painter.setFont(font(words, bold=True))
        below = QRectF(0, bar.bottom() + 24, width, height - bar.bottom() - 24)
        wrap = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop | Qt.TextFlag.TextWordWrap
        painter.drawText(below, int(wrap), self.words)
        painter.end()

    def _paint_bar(
        self, painter: QPainter, bar: QRectF, ratio: float, full: float, judgement: Judgement
    ) -> None:
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
        if judgement.target is None or judgement.low is None or judgement.high is None:
            return
        scale = bar.width() / full
        x, low = bar.left() + scale * judgement.target, bar.left() + scale * judgement.low
        painter.setPen(Qt.PenStyle.NoPen)
        band = QColor(colours.good)
        band.setAlpha(90)
        painter.setBrush(band)
        width = scale * (judgement.high - judgement.low)
        painter.drawRect(QRectF(low, bar.top() - 5, width, bar.height() + 10))
        painter.setPen(QPen(QColor(colours.good), 2))
        painter.drawLine(int(x), int(bar.top() - 6), int(x), int(bar.bottom() + 6))
        painter.setFont(font(9, bold=True))
        align = Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop
        told = f"target {judgement.target:.2f}  ({judgement.low:.3f} to {judgement.high:.3f})"
        painter.drawText(QRectF(x - 120, bar.bottom() + 6, 240, 16), align, told)
