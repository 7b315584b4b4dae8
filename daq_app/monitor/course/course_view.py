"""One picture of a test's course: state, what to do, gauge or motion, figures. Read from five metres.

Everything is painted as large as its box allows, so that nothing is cut off at any size of the screen.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages.published import Call, MotionMessage, State
from daq_app.monitor.course.fitted_text import FittedText
from daq_app.monitor.course.gauge_words import countdown_s, gauge_words, target_words
from daq_app.monitor.course.recording_light import recording_light
from daq_app.monitor.course.target_bar import paint_target_bar
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import DASH, number
from daq_app.monitor.look.shapes import draw_shape
from daq_app.monitor.look.state_look import look_of, name_of_test
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.plot_base import envelope
from daq_app.monitor.widgets.counters import TileText, tile_texts

TRACE_S: Final = 12.0
_MOVED: Final = frozenset({State.RELEASED, State.ROCKING, State.AT_REST})
_AFTERWARDS: Final = frozenset({State.SAVING, State.SAVED, State.FAILED})
_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


def figures(session: Session) -> dict[str, TileText]:
    """The four figures by caption."""
    tiles = tile_texts(session)
    velocity = session.velocity_rad_s if session.fresh(MotionMessage) else math.nan
    return {
        "Rotation  (mrad)": TileText(tiles["rotation"].value.removesuffix(" mrad")),
        "Velocity  (mrad/s)": TileText(number(1e3 * velocity, 0)),
        "r by EAV": tiles["eav"],
        "r by CRT": tiles["crt"],
    }


def shows_motion(session: Session) -> bool:
    """Whether the motion is drawn in place of the gauge: from the release until the wall is pulled again."""
    state, call = session.current_state, session.judgement.call
    just_recorded = state in _AFTERWARDS and call in (Call.WAIT, Call.LOOK)
    return state in _MOVED or (just_recorded and session.last_motion is not None)


class CourseView(QWidget):
    """The picture. `refresh` asks for a repaint; `footer` is written at the lower edge."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
        self._text = FittedText()
        self.footer = ""
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def sizeHint(self) -> QSize:
        return QSize(900, 560)

    def minimumSizeHint(self) -> QSize:
        return QSize(320, 240)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.update()

    def refresh(self) -> None:
        """Repaint soon."""
        self.update()

    @property
    def texts(self) -> list[str]:
        """Everything that stands on the picture, in the order of painting."""
        return [written.text for written in self._text.written]

    @property
    def written(self) -> FittedText:
        """What was written where."""
        return self._text

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(self._colours.ground))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._text.begin()
        width, height = float(self.width()), float(self.height())
        gap = 0.02 * height
        whole = QRectF(gap, gap, width - 2 * gap, height - 2 * gap)
        foot = 0.05 * height if self.footer else 0.0
        if foot:
            below = QRectF(whole.left(), whole.bottom() - foot, whole.width(), foot)
            self._text.write(painter, below, self.footer, self._colours.muted, bold=False)
            whole.setBottom(below.top() - gap / 2)
        parts = _rows(whole, (0.17, 0.15, 0.40, 0.28), gap)
        self._paint_state(painter, parts[0])
        self._paint_order(painter, parts[1])
        if shows_motion(self._session):
            self._paint_motion(painter, self._card(painter, parts[2]))
        else:
            self._paint_gauge(painter, self._card(painter, parts[2]))
        self._paint_figures(painter, parts[3], gap)
        painter.end()

    def _card(self, painter: QPainter, box: QRectF) -> QRectF:
        """The ground of a part; returns the room within."""
        painter.setPen(QPen(QColor(self._colours.line), 1))
        painter.setBrush(QColor(self._colours.surface))
        painter.drawRoundedRect(box, 8, 8)
        pad = min(0.05 * box.height(), 0.03 * box.width()) + 4
        return box.adjusted(2 * pad, pad, -2 * pad, -pad)

    def _paint_state(self, painter: QPainter, box: QRectF) -> None:
        session, colours = self._session, self._colours
        look, light = look_of(session.current_state, session.judgement), recording_light(session)
        colour = str(getattr(colours, look.tone))
        side = 0.8 * box.height()
        draw_shape(
            painter, look.shape, QRectF(box.left(), box.center().y() - side / 2, side, side), QColor(colour)
        )
        word = QRectF(box.left() + 1.3 * side, box.top(), 0.58 * box.width() - 1.3 * side, box.height())
        self._text.write(painter, word, look.word, colour)
        right = QRectF(box.left() + 0.6 * box.width(), box.top(), 0.4 * box.width(), box.height())
        upper, lower = _rows(right, (0.6, 0.4), 0.0)
        sign = 0.62 * upper.height()
        tone = str(getattr(colours, light.tone))
        sign_box = QRectF(right.right() - sign, upper.center().y() - sign / 2, sign, sign)
        draw_shape(painter, light.shape, sign_box, QColor(tone))
        upper.setRight(sign_box.left() - 0.3 * sign)
        self._text.write(painter, upper, light.word, tone, align=_RIGHT)
        detail = "   ".join(part for part in (name_of_test(session.state), light.detail) if part)
        self._text.write(painter, lower, detail, colours.muted, bold=False, align=_RIGHT)

    def _paint_order(self, painter: QPainter, box: QRectF) -> None:
        session = self._session
        look = look_of(session.current_state, session.judgement)
        text, tone = look.sentence, look.tone
        if session.data_missing:
            text, tone = "No data for more than half a second: what is shown is not live.", "bad"
        self._text.write(
            painter, box, text, str(getattr(self._colours, tone)), wrap=True, most_px=0.62 * box.height()
        )

    def _paint_gauge(self, painter: QPainter, box: QRectF) -> None:
        """The ratio and the recorder's words above the bar with its band; the countdown at the right."""
        session, colours = self._session, self._colours
        judgement = session.live_judgement
        upper, lower = _rows(box, (0.52, 0.48), 0.03 * box.height())
        ratio = QRectF(upper.left(), upper.top(), 0.3 * upper.width(), upper.height())
        self._text.write(painter, ratio, number(judgement.ratio, 3), colours.text)
        name = QRectF(ratio.right(), upper.top(), 0.08 * upper.width(), upper.height())
        self._text.write(painter, name, "θ/α", colours.muted, most_px=0.3 * upper.height())
        words = QRectF(name.right(), upper.top(), upper.right() - name.right(), upper.height())
        left_s = countdown_s(session)
        if left_s is not None:
            count = QRectF(
                words.right() - 0.3 * words.width(), words.top(), 0.3 * words.width(), words.height()
            )
            words.setRight(count.left() - 0.02 * box.width())
            self._text.write(painter, count, f"{left_s} s", colours.good, align=_RIGHT)
        tone = judgement.tone if session.fresh(MotionMessage) else "warning"
        self._text.write(
            painter, words, gauge_words(session), str(getattr(colours, tone)), wrap=True, align=_RIGHT
        )
        label = colours.font(10.0, bold=True)
        label.setPixelSize(max(9, int(0.24 * lower.height())))
        bar = QRectF(lower.left(), lower.top() + 0.1 * lower.height(), lower.width(), 0.45 * lower.height())
        alarm = session.rig.acquisition.alarm_ratio if session.rig is not None else math.inf
        full = max(1.08 * alarm if math.isfinite(alarm) else 0.5, 1.25 * (judgement.high or 0.0))
        paint_target_bar(painter, bar, full, judgement, target_words(session), (colours, label), alarm)

    def _paint_motion(self, painter: QPainter, box: QRectF) -> None:
        """The rotation since the release, and beside it how long and how many impacts."""
        session, colours = self._session, self._colours
        tiles = tile_texts(session)
        side = QRectF(box.right() - 0.2 * box.width(), box.top(), 0.2 * box.width(), box.height())
        box = QRectF(box.left(), box.top(), 0.78 * box.width(), box.height())
        for part, (value, caption) in zip(
            _rows(side, (0.5, 0.5), 0.04 * side.height()),
            ((tiles["elapsed"].value, "since release"), (tiles["impacts"].value, "impacts")),
            strict=True,
        ):
            upper, lower = _rows(part, (0.7, 0.3), 0.0)
            self._text.write(painter, upper, value, colours.text, align=_RIGHT)
            self._text.write(painter, lower, caption, colours.muted, bold=False, align=_RIGHT)
        painter.setPen(QPen(QColor(colours.line), 2))
        middle = box.center().y()
        painter.drawLine(QPointF(box.left(), middle), QPointF(box.right(), middle))
        line = self._motion_line(box)
        if line is not None:
            painter.setPen(QPen(QColor(colours.rotation), max(2.0, 0.012 * box.height())))
            painter.drawPolyline(line)

    def _motion_line(self, box: QRectF) -> QPolygonF | None:
        """θ(t) of the last seconds, after the test of all of it, in `box`; None while nothing is known."""
        session = self._session
        if session.rate_hz <= 0:
            return None
        if session.current_state not in _MOVED and session.last_motion is not None:
            samples, rotation, _ = session.last_motion
            first, span = samples[0], max(samples[-1] - samples[0], 1.0)
        elif len(session.trace):
            first, span = self._latest(), TRACE_S * session.rate_hz
            samples, rotation, _ = session.trace.window(first)
        else:
            return None
        known = ~np.isnan(rotation)
        x, y = envelope(samples[known], rotation[known], max(100, int(box.width() / 2)))
        largest = max(float(np.max(np.abs(y), initial=0.0)), 0.02 * session.alpha_rad)
        px = box.left() + (x - first) / span * box.width()
        py = box.center().y() - y / largest * 0.46 * box.height()
        return QPolygonF([QPointF(a, b) for a, b in zip(px.tolist(), py.tolist(), strict=True)])

    def _latest(self) -> float:
        """First sample of the time axis: a second before the release, later `TRACE_S` ago."""
        session = self._session
        last = session.trace.last_sample
        released = session.estimate.release_sample if session.estimate is not None else last
        elapsed_s = (last - released) / session.rate_hz
        return released + (max(0.0, elapsed_s - TRACE_S + 1.0) - 1.0) * session.rate_hz

    def _paint_figures(self, painter: QPainter, box: QRectF, gap: float) -> None:
        colours = self._colours
        shown = figures(self._session)
        width = (box.width() - gap * (len(shown) - 1)) / len(shown)
        for place, (caption, text) in enumerate(shown.items()):
            card = QRectF(box.left() + place * (width + gap), box.top(), width, box.height())
            inner = self._card(painter, card)
            head, value, detail = _rows(inner, (0.2, 0.58, 0.22), 0.0)
            self._text.write(painter, head, caption, colours.muted)
            colour = str(getattr(colours, text.role or "text"))
            self._text.write(painter, value, text.value or DASH, colour)
            self._text.write(painter, detail, text.detail, colours.muted, bold=False)


def _rows(box: QRectF, shares: tuple[float, ...], gap: float) -> list[QRectF]:
    """`box` cut into rows of these shares, with `gap` between them."""
    room = box.height() - gap * (len(shares) - 1)
    rows, top = [], box.top()
    for share in shares:
        rows.append(QRectF(box.left(), top, box.width(), room * share))
        top += room * share + gap
    return rows
