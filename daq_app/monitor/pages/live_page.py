"""The live page: the motion large, what follows from it beside, all channels below."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QSplitter, QVBoxLayout, QWidget

from daq_app.acquisition.course.tare import UNZEROED
from daq_app.acquisition.messages.published import EstimateMessage, MotionMessage, StateMessage
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import role_label, set_role, tip_text
from daq_app.monitor.look.theme import Colours
from daq_app.monitor.plots.estimate_plots import PeriodPlot, PhasePlane, RestitutionPlot, side_by_side
from daq_app.monitor.plots.motion_plots import MotionPlots
from daq_app.monitor.plots.strip_panel import StripPanel
from daq_app.monitor.widgets.counters import Counters


class LivePage(QWidget):
    """Everything that moves. The window calls `draw_frame` 60 times and `draw_slow` 6 times a second."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.counters = Counters(session)
        self.motion = MotionPlots(session)
        self.restitution = RestitutionPlot(session)
        self.phase = PhasePlane(session)
        self.periods = PeriodPlot(session)
        self.strips = StripPanel(session)
        self.estimate_drawn_s = -math.inf
        """When r was last handed to its plot (`time.monotonic`); the benchmark reads it."""
        self.frames = 0
        """Frames of the large plots drawn so far."""
        self._seen: tuple[int, int] = (-1, -1)

        self.theory_button = _switch("Theory  (T)", self._on_theory)
        self.strips_button = _switch("Channels  (C)", self._on_strips)
        self.strips_button.setToolTip("Give the whole page to the channels, and back")
        self._caption: QLabel = role_label("", "muted")
        self._caption.setWordWrap(True)

        self.upper = self._side_by_side()
        self.whole = QSplitter(Qt.Orientation.Vertical)
        self.whole.addWidget(self.upper)
        self.whole.addWidget(self.strips)
        self.whole.setSizes([6800, 3200])
        self.whole.setStretchFactor(0, 7)
        self.whole.setStretchFactor(1, 4)
        for splitter in (self.upper, self.whole):
            splitter.setHandleWidth(6)
            splitter.setChildrenCollapsible(False)
        tools = QHBoxLayout()
        tools.setContentsMargins(0, 0, 0, 0)
        tools.addWidget(self._caption, 1)
        tools.addWidget(self.theory_button)
        tools.addWidget(self.strips_button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.setSpacing(6)
        layout.addWidget(self.counters)
        layout.addLayout(tools)
        layout.addWidget(self.whole, 1)

    def _side_by_side(self) -> QSplitter:
        """The motion at the left, what follows from it at the right."""
        right = QSplitter(Qt.Orientation.Vertical)
        right.addWidget(self.restitution)
        right.addWidget(side_by_side(self.phase, self.periods))
        right.setSizes([1000, 1000])
        right.setHandleWidth(6)
        right.setChildrenCollapsible(False)
        left = QWidget()
        left_layout = QVBoxLayout(left)
        left_layout.setContentsMargins(0, 0, 0, 0)
        left_layout.addWidget(self.motion)
        upper = QSplitter(Qt.Orientation.Horizontal)
        upper.addWidget(left)
        upper.addWidget(right)
        upper.setSizes([6200, 3800])
        upper.setStretchFactor(0, 62)
        upper.setStretchFactor(1, 38)
        return upper

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        for part in (self.motion, self.restitution, self.phase, self.periods, self.strips):
            part.restyle(colours)

    def showEvent(self, event: QShowEvent) -> None:
        """The page comes to the front as things stand now, not as it was left."""
        super().showEvent(event)
        self.draw_slow()
        self.draw_frame()

    def draw_frame(self) -> None:
        """Draw the large plots."""
        if not self.strips_button.isChecked():
            self.motion.draw()
        self.frames += 1
        if self._draw_r():
            self._draw_what_follows()

    def draw_slow(self) -> None:
        """Draw figures, strips and the phase plane."""
        self.counters.refresh()
        self.strips.refresh()
        self.phase.draw(self._session.fresh(MotionMessage))
        self._show_caption()

    def _show_caption(self) -> None:
        """What must be known beside the plots: a missing zero, doubts about r, which theory is laid over."""
        estimate = self._session.estimate
        parts = [UNZEROED] if self._session.run_zeroed is False and estimate is not None else []
        if estimate is not None and estimate.doubts:
            parts.append("r is in doubt: " + "; ".join(estimate.doubts))
        doubtful = bool(parts)
        text = "  ".join(part for part in (*parts, self.motion.theory_caption()) if part)
        if self._caption.text() != text:
            self._caption.setText(text)
            self._caption.setToolTip(tip_text(text) if doubtful else "")
        set_role(self._caption, "warning" if doubtful else "muted")

    def show_estimate(self) -> None:
        """Draw and paint r now, between two frames: it is what the operator waits for."""
        if self._draw_r():
            self.restitution.plot.viewport().repaint()
            self._draw_what_follows()

    def _draw_r(self) -> bool:
        """Hand r to its plot; false where it has not changed."""
        revision = self._session.revision
        seen = (revision.get(EstimateMessage, 0), revision.get(StateMessage, 0))
        if seen == self._seen:
            return False
        self._seen = seen
        self.restitution.draw()
        self.estimate_drawn_s = time.monotonic()
        return True

    def _draw_what_follows(self) -> None:
        self.periods.draw()
        self.counters.refresh()

    def _on_theory(self, on: bool) -> None:
        self.motion.set_theory(on)
        self._show_caption()

    def _on_strips(self, on: bool) -> None:
        self.upper.setVisible(not on)


def _switch(text: str, on_toggled: Callable[[bool], None]) -> QPushButton:
    """A flat button that stays down."""
    button = QPushButton(text)
    button.setCheckable(True)
    button.setProperty("role", "flat")
    button.toggled.connect(on_toggled)
    return button
