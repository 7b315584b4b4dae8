"""How far to pull: the rotation now, the target, and what to do, readable from beside the winch."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from daq_app.acquisition.messages.published import MotionMessage
from daq_app.monitor.course.fitted_text import FittedText
from daq_app.monitor.course.gauge_words import countdown_s, gauge_words, target_words
from daq_app.monitor.course.target_bar import paint_target_bar
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import DASH, number
from daq_app.monitor.look.theme import DARK, Colours

_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_TOP = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop


class PullGauge(QWidget):
    """The gauge: tiltmeters' rotation over α, the band of the recorder's plan, and its words."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
        self._text = FittedText()
        self.setMinimumHeight(130)

    def sizeHint(self) -> QSize:
        return QSize(360, 160)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.update()

    @property
    def words(self) -> str:
        """What the gauge says now: the recorder's words, or that the rotation is not live."""
        left_s = countdown_s(self._session)
        live = self._session.fresh(MotionMessage)
        return gauge_words(self._session) + (f"  {left_s} s" if live and left_s is not None else "")

    def paintEvent(self, event: QPaintEvent) -> None:
        session, colours = self._session, self._colours
        live = session.fresh(MotionMessage)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._text.begin()
        width, height = float(self.width()), float(self.height())
        upper = QRectF(0, 0, 0.5 * width, 0.34 * height)
        self._text.write(painter, upper, number(session.judged_ratio, 3), colours.text, most_px=110)
        beside = QRectF(0.52 * width, 0, 0.48 * width, 0.3 * height)
        detail = number(session.judged_rad * 1e3, 1, "mrad") if live else DASH
        usual_px = 1.35 * colours.points
        self._text.write(
            painter,
            beside,
            f"θ/α\n{detail}",
            colours.muted,
            bold=False,
            wrap=True,
            most_px=usual_px,
            align=_RIGHT,
        )
        bar = QRectF(1, 0.38 * height, width - 2, max(12.0, min(44.0, 0.14 * height)))
        label = colours.font(9, bold=True)
        label.setPixelSize(max(9, int(min(1.25 * colours.points, 0.12 * height))))
        full = max(0.5, 1.25 * (session.judgement.high or 0.0))
        paint_target_bar(painter, bar, full, session.live_judgement, target_words(session), (colours, label))
        below = QRectF(0, bar.bottom() + 0.16 * height, width, height - bar.bottom() - 0.16 * height)
        tone = session.judgement.tone if live else "muted"
        colour = str(getattr(colours, tone))
        self._text.write(painter, below, self.words, colour, wrap=True, most_px=2.6 * usual_px, align=_TOP)
        painter.end()
