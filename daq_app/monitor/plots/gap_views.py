"""The pictures of a diagnosis in the window: the gap map, and bars for evidence and closure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from daq_app.monitor.look.labels import DASH, number
from daq_app.monitor.look.theme import DARK, Colours

_PHASES = ("held", "release", "swing", "peak", "impact", "tail", "run", "rest")
_FULL_GAP = 20.0
"""Gap, in units of noise and scatter, at which a cell of the map has its full colour."""
_CUT = -60.0
_LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_MIDDLE = Qt.AlignmentFlag.AlignCenter

Cells = dict[tuple[str, str], tuple[float, float]]


def map_cells(result: Mapping[str, Any]) -> Cells:
    """(channel, phase) → largest gap before and after, in units of noise and scatter."""
    found: Cells = {}
    for place, key in enumerate(("where", "remaining")):
        for cell in result[key]["cells"]:
            spot = (str(cell["channel"]), str(cell["phase"]))
            pair = list(found.get(spot, (math.nan, math.nan)))
            size = float(cell["in_noise"])
            pair[place] = size if math.isnan(pair[place]) else max(pair[place], size)
            found[spot] = (pair[0], pair[1])
    return found


@dataclass(frozen=True, slots=True)
class Bar:
    """One row: its name, and per bar the length (0 … 1), the theme colour and what stands behind it."""

    name: str
    lengths: tuple[tuple[float, str, str], ...]


def evidence_bars(result: Mapping[str, Any], most: int = 8) -> list[Bar]:
    """Log evidence less that of the best, the best first; the figure behind is the probability."""
    ranked = sorted(result["which"], key=lambda entry: -float(entry["log_evidence"]))[:most]
    if not ranked:
        return []
    best = float(ranked[0]["log_evidence"])
    chosen = list(result["which"][0]["effects"])
    bars = []
    for entry in ranked:
        behind = float(entry["log_evidence"]) - best
        length = 1.0 - max(behind, _CUT) / _CUT
        probability = float(entry["probability"])
        text = f"p {probability:.2f}" if probability >= 0.005 else f"{number(behind, 0)}"
        colour = "accent" if list(entry["effects"]) == chosen else "muted"
        bars.append(Bar(" + ".join(entry["effects"]) or "nothing missing", ((length, colour, text),)))
    return bars


def closure_bars(result: Mapping[str, Any]) -> list[Bar]:
    """Held-out gap per level, without and with what was found."""
    gap = result.get("gap")
    if not gap:
        return []
    levels: Mapping[str, Sequence[float]] = gap["per_level"]
    largest = max((max(pair) for pair in levels.values()), default=1.0)
    return [
        Bar(
            level,
            (
                (before / largest, "muted", f"{before:.2f} without"),
                (after / largest, "accent", f"{after:.2f} with it"),
            ),
        )
        for level, (before, after) in levels.items()
    ]


class GapMapView(QWidget):
    """Channels against phases; each cell says ``before → after``."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = DARK
        self._cells: Cells = {}
        self.setMinimumSize(260, 120)

    def sizeHint(self) -> QSize:
        return QSize(520, 220)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.update()

    def show_cells(self, cells: Cells) -> None:
        """Take over a map; empty clears."""
        self._cells = cells
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(self._colours.font(9))
        channels = list(dict.fromkeys(channel for channel, _ in self._cells))
        phases = sorted(
            {phase for _, phase in self._cells},
            key=lambda phase: (_PHASES.index(phase) if phase in _PHASES else len(_PHASES), phase),
        )
        if channels:
            self._paint(painter, channels, phases)
        painter.end()

    def _paint(self, painter: QPainter, channels: list[str], phases: list[str]) -> None:
        colours = self._colours
        metrics = painter.fontMetrics()
        left = max(metrics.horizontalAdvance(name) for name in channels) + 12.0
        top = metrics.height() + 6.0
        width = (self.width() - left) / len(phases)
        height = min(44.0, (self.height() - top) / len(channels))
        painter.setPen(QColor(colours.muted))
        for j, phase in enumerate(phases):
            painter.drawText(QRectF(left + j * width, 0, width, top), _MIDDLE, phase)
        for i, channel in enumerate(channels):
            row = top + i * height
            painter.setPen(QColor(colours.muted))
            painter.drawText(QRectF(0, row, left - 8, height), _RIGHT, channel)
            for j, phase in enumerate(phases):
                box = QRectF(left + j * width + 1, row + 1, width - 2, height - 2)
                self._paint_cell(painter, box, self._cells.get((channel, phase)))

    def _paint_cell(self, painter: QPainter, box: QRectF, pair: tuple[float, float] | None) -> None:
        colours = self._colours
        painter.fillRect(box, QColor(colours.surface))
        if pair is None:
            return
        before, after = pair
        if math.isfinite(before) and before > 1.0:
            tint = QColor(colours.bad)
            tint.setAlphaF(0.55 * min(1.0, math.log(before) / math.log(_FULL_GAP)))
            painter.fillRect(box, tint)
        painter.setPen(QColor(colours.text))
        painter.drawText(
            box, _MIDDLE, f"{number(before, 1)} → {number(after, 1)}" if before == before else DASH
        )


class BarRows(QWidget):
    """Named horizontal bars."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = DARK
        self.bars: list[Bar] = []
        self.setMinimumSize(220, 100)

    def sizeHint(self) -> QSize:
        return QSize(420, 200)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.update()

    def show_bars(self, bars: list[Bar]) -> None:
        """Take over rows; none clears."""
        self.bars = bars
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(self._colours.font(9))
        if self.bars:
            metrics = painter.fontMetrics()
            left = min(
                0.45 * self.width(), max(metrics.horizontalAdvance(bar.name) for bar in self.bars) + 14
            )
            texts = [text for bar in self.bars for _, _, text in bar.lengths]
            right = max(metrics.horizontalAdvance(text) for text in texts) + 12.0
            most = max(len(bar.lengths) for bar in self.bars)
            height = min(16.0 + 26.0 * most, self.height() / len(self.bars))
            for row, bar in enumerate(self.bars):
                self._paint_row(painter, bar, QRectF(0, row * height, self.width(), height), left, right)
        painter.end()

    def _paint_row(self, painter: QPainter, bar: Bar, box: QRectF, left: float, right: float) -> None:
        colours = self._colours
        painter.setPen(QColor(colours.text))
        name = painter.fontMetrics().elidedText(bar.name, Qt.TextElideMode.ElideRight, int(left - 10))
        painter.drawText(QRectF(0, box.top(), left - 10, box.height()), _RIGHT, name)
        room = max(10.0, box.width() - left - right)
        thick = (box.height() - 6) / len(bar.lengths)
        for place, (length, colour, text) in enumerate(bar.lengths):
            top = box.top() + 3 + place * thick
            reach = max(1.0, room * min(1.0, max(0.0, length)))
            painter.setPen(QPen(Qt.PenStyle.NoPen))
            painter.fillRect(QRectF(left, top, reach, thick - 2), QColor(str(getattr(colours, colour))))
            painter.setPen(QColor(colours.muted))
            painter.drawText(QRectF(left + reach + 6, top - 3, right, thick + 4), _LEFT, text)
