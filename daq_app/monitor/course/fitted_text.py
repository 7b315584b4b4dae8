"""Text that is as large as its box allows: for what is read from afar."""

from __future__ import annotations

import re
from dataclasses import dataclass

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter

from daq_app.monitor.look.theme import font

_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_LEAST_PX = 6
_DIGIT = re.compile(r"\d")


@dataclass(frozen=True, slots=True)
class Written:
    """A text, its box, and the room that it takes."""

    text: str
    box: QRectF
    needs: QRectF


class FittedText:
    """Writes with a painter and remembers which size fits: figures of one width all get one size."""

    def __init__(self) -> None:
        self._sizes: dict[tuple[str, int, int, bool, bool], int] = {}
        self.written: list[Written] = []
        """Everything written since `begin`."""

    def begin(self) -> None:
        """A new picture."""
        self.written.clear()
        if len(self._sizes) > 500:
            self._sizes.clear()

    def write(
        self,
        painter: QPainter,
        box: QRectF,
        text: str,
        colour: str,
        *,
        bold: bool = True,
        wrap: bool = False,
        most_px: float = 1e4,
        align: Qt.AlignmentFlag = _LEFT,
    ) -> None:
        """Write `text` into `box` as large as fits, at most `most_px` high; `wrap`: in lines."""
        if not text or box.width() < _LEAST_PX or box.height() < _LEAST_PX:
            return
        flags = int(align | (Qt.TextFlag.TextWordWrap if wrap else Qt.TextFlag.TextSingleLine))
        largest = int(min(box.height(), most_px))
        key = (_DIGIT.sub("0", text), int(box.width()), largest, bold, wrap)
        size = self._sizes.get(key)
        if size is None:
            size = self._sizes[key] = _largest_px(key[0], box, flags, bold, largest)
        chosen = _font_px(size, bold)
        painter.setFont(chosen)
        painter.setPen(QColor(colour))
        painter.drawText(box, flags, text)
        self.written.append(Written(text, QRectF(box), QFontMetricsF(chosen).boundingRect(box, flags, text)))


def _font_px(pixels: int, bold: bool) -> QFont:
    chosen = font(10.0, bold=bold)
    chosen.setPixelSize(max(1, pixels))
    return chosen


def _largest_px(text: str, box: QRectF, flags: int, bold: bool, largest: int) -> int:
    """The largest size in pixels at which `text` stays within `box`, by bisection."""
    low, high = _LEAST_PX, max(_LEAST_PX, largest)
    while low < high:
        middle = (low + high + 1) // 2
        needs = QFontMetricsF(_font_px(middle, bold)).boundingRect(box, flags, text)
        if needs.width() <= box.width() and needs.height() <= box.height():
            low = middle
        else:
            high = middle - 1
    return low
