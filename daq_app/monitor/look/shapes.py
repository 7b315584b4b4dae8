"""The small drawn signs that stand beside words, so that no meaning hangs on colour alone."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

_POLYGONS: dict[str, tuple[tuple[float, float], ...]] = {
    "triangle": ((0.5, 0.06), (0.96, 0.9), (0.04, 0.9)),
    "square": ((0.12, 0.12), (0.88, 0.12), (0.88, 0.88), (0.12, 0.88)),
    "diamond": ((0.5, 0.02), (0.98, 0.5), (0.5, 0.98), (0.02, 0.5)),
    "bar": ((0.04, 0.36), (0.96, 0.36), (0.96, 0.64), (0.04, 0.64)),
    "arrow": ((0.36, 0.05), (0.64, 0.05), (0.64, 0.48), (0.9, 0.48), (0.5, 0.95), (0.1, 0.48), (0.36, 0.48)),
}
_STROKES: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "tick": (((0.1, 0.55), (0.4, 0.84), (0.92, 0.18)),),
    "cross": (((0.15, 0.15), (0.85, 0.85)), ((0.85, 0.15), (0.15, 0.85))),
    "eye": (
        tuple(
            (0.5 + 0.48 * math.cos(a), 0.5 + 0.3 * math.sin(a)) for a in [k * math.pi / 12 for k in range(25)]
        ),
    ),
}


def draw_shape(painter: QPainter, shape: str, box: QRectF, colour: QColor) -> None:
    """Draw a sign into `box`; an unknown name draws a ring."""
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    scale = min(box.width(), box.height())
    painter.translate(box.center().x() - scale / 2, box.center().y() - scale / 2)

    def polygon(points: tuple[tuple[float, float], ...]) -> QPolygonF:
        return QPolygonF([QPointF(x * scale, y * scale) for x, y in points])

    pen = QPen(
        colour, scale * 0.14, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin
    )
    if shape in _POLYGONS:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        painter.drawPolygon(polygon(_POLYGONS[shape]))
    elif shape in _STROKES:
        painter.setPen(pen)
        for stroke in _STROKES[shape]:
            painter.drawPolyline(polygon(stroke))
        if shape == "eye":
            painter.setBrush(colour)
            painter.drawEllipse(QPointF(scale / 2, scale / 2), scale * 0.08, scale * 0.08)
    else:
        painter.setPen(pen if shape != "disc" else QPen(Qt.PenStyle.NoPen))
        painter.setBrush(colour if shape == "disc" else Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QRectF(scale * 0.08, scale * 0.08, scale * 0.84, scale * 0.84))
    painter.restore()


class Sign(QWidget):
    """One sign as a widget."""

    def __init__(self, size_px: int, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._size = size_px
        self._shape = "ring"
        self._colour = QColor("gray")
        self.setFixedSize(size_px, size_px)

    def show_shape(self, shape: str, colour: str) -> None:
        """Change the sign."""
        if shape != self._shape or QColor(colour) != self._colour:
            self._shape, self._colour = shape, QColor(colour)
            self.update()

    @property
    def shape(self) -> str:
        """Name of the sign that is drawn."""
        return self._shape

    def sizeHint(self) -> QSize:
        return QSize(self._size, self._size)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        draw_shape(painter, self._shape, QRectF(self.rect()), self._colour)
        painter.end()
