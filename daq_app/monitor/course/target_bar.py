"""The bar of |θ|/α with the band of the plan, as it is drawn on every page that shows the pull."""

from __future__ import annotations

import math

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen

from daq_app.acquisition.messages.published import Judgement
from daq_app.monitor.look.theme import Colours


def paint_target_bar(
    painter: QPainter,
    bar: QRectF,
    full: float,
    judgement: Judgement,
    target_words: str,
    look: tuple[Colours, QFont],
    alarm_ratio: float = math.inf,
) -> None:
    """Draw the bar from 0 to `full`; the rotation is `judgement.ratio`, `target_words` stand below the bar.

    `look`: colours, and the font of those words. From `alarm_ratio` on the ground is that of danger.
    """
    colours, label = look
    ratio = judgement.ratio
    scale = bar.width() / full
    radius = min(6.0, bar.height() / 5)
    painter.setPen(QPen(QColor(colours.line), 1))
    painter.setBrush(QColor(colours.raised))
    painter.drawRoundedRect(bar, radius, radius)
    painter.setPen(Qt.PenStyle.NoPen)
    if alarm_ratio < full:
        danger = QColor(colours.bad)
        danger.setAlpha(70)
        painter.setBrush(danger)
        left = bar.left() + scale * alarm_ratio
        painter.drawRoundedRect(QRectF(left, bar.top(), bar.right() - left, bar.height()), radius, radius)
    if ratio is not None:
        painter.setBrush(QColor(colours.rotation))
        width = bar.width() * min(1.0, ratio / full)
        painter.drawRoundedRect(QRectF(bar.left(), bar.top(), width, bar.height()), radius, radius)
    if judgement.target is None or judgement.low is None or judgement.high is None:
        return
    over = max(5.0, 0.15 * bar.height())
    band = QColor(colours.good)
    band.setAlpha(90)
    painter.setBrush(band)
    low, high = (bar.left() + scale * value for value in (judgement.low, judgement.high))
    painter.drawRect(QRectF(low, bar.top() - over, high - low, bar.height() + 2 * over))
    x = bar.left() + scale * judgement.target
    painter.setPen(QPen(QColor(colours.good), max(2.0, 0.04 * bar.height())))
    painter.drawLine(int(x), int(bar.top() - over), int(x), int(bar.bottom() + over))
    painter.setFont(label)
    metrics = QFontMetricsF(label)
    wide = metrics.horizontalAdvance(target_words) + 4
    left = max(bar.left(), min(x - wide / 2, bar.right() - wide))
    box = QRectF(left, bar.bottom() + over + 1, wide, metrics.height())
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, target_words)
