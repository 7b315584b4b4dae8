"""The two large plots: rotation and angular velocity against time.

Before the release the axis says how long ago; from the release on it says how long since, and stands
still, so that a ten-second test draws itself into one picture.
"""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QVBoxLayout, QWidget

from daq_app.acquisition.messages.published import RECORDING, EstimateMessage, MotionMessage
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.theme import Colours
from daq_app.monitor.plots.live_plot import LivePlot
from daq_app.monitor.plots.plot_base import Array, Axis, line_pen
from daq_app.monitor.plots.theory_overlay import current_restitution, housner_motion

WINDOW_S = 12.0
LEAD_S = 1.0
"""How much of the hold stays visible before the release."""


class MotionPlots(QWidget):
    """θ(t) with a second axis θ/α, and θ̇(t) below on the same time axis."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.rotation = LivePlot("Rotation θ", "θ  (mrad)", "")
        self.velocity = LivePlot("Angular velocity dθ/dt", "dθ/dt  (rad/s)", "time  (s)")
        self.velocity.setXLink(self.rotation)
        for plot in (self.rotation, self.velocity):
            plot.plot_item.setAxisItems({"right": Axis("right")})
            plot.set_axis_width("left", 62)
            plot.set_axis_width("right", 52)
        self.rotation.plot_item.setLabel("right", "θ/α")
        self.velocity.plot_item.getAxis("right").setStyle(showValues=False)
        self.rotation.plot_item.getAxis("bottom").setStyle(showValues=False)
        self.rotation.plot_item.getAxis("bottom").setHeight(6)
        self._theory = (self.rotation.curve(dashed=True), self.velocity.curve(dashed=True))
        self._targets = [pg.InfiniteLine(angle=0, movable=False) for _ in range(2)]
        for line in self._targets:
            line.setVisible(False)
            self.rotation.addItem(line)
        self._impacts = pg.ScatterPlotItem(symbol="t1", size=7)
        self.rotation.addItem(self._impacts)
        self._frame = (math.nan, math.nan)
        self._limits = (math.nan, math.nan)
        self._theory_on = False
        self._theory_key: object = None
        self.target_rad = math.nan
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(2)
        layout.addWidget(self.rotation, 11)
        layout.addWidget(self.velocity, 10)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self.rotation.restyle(colours)
        self.velocity.restyle(colours)
        self.rotation.plot_item.getAxis("right").setLabel("θ/α", **colours.axis_style)
        self.rotation.set_line_colour(colours.rotation)
        self.velocity.set_line_colour(colours.velocity)
        for curve in self._theory:
            curve.setPen(line_pen(colours.theory, dashed=True))
        for line in self._targets:
            line.setPen(line_pen(colours.good, dashed=True))
        self._impacts.setPen(pg.mkPen(colours.text))
        self._impacts.setBrush(pg.mkBrush(colours.text))

    def set_theory(self, on: bool) -> None:
        """Show or hide the motion of the classic theory."""
        self._theory_on = on
        self._theory_key = None

    def set_target(self, target_rad: float) -> None:
        """Rotation to pull to, drawn on both sides; NaN hides it."""
        self.target_rad = target_rad
        for line, sign in zip(self._targets, (1, -1), strict=True):
            line.setVisible(math.isfinite(target_rad))
            if math.isfinite(target_rad):
                line.setValue(sign * target_rad * 1e3)
        self._limits = (math.nan, math.nan)

    def draw(self) -> None:
        """Draw the present; called for every frame."""
        session = self._session
        rate = session.rate_hz
        now = session.sample_now
        released = session.estimate.release_sample if session.estimate is not None else None
        kept = session.last_motion if session.current_state not in RECORDING else None
        if rate <= 0 or (kept is None and not math.isfinite(now)):
            for plot in (self.rotation, self.velocity):
                plot.clear_line()
            self.rotation.show_notice("No motion is measured")
            return
        if released is not None:
            elapsed = (now if kept is None else kept[0][-1]) / rate - released / rate
            start = -LEAD_S if elapsed < WINDOW_S - LEAD_S else self._paged_start(elapsed)
            self._set_frame(start, start + WINDOW_S, "time since release  (s)")
            origin = float(released)
        else:
            self._set_frame(-WINDOW_S, 0.0, "seconds ago")
            origin, start = now, -WINDOW_S
        if kept is not None:
            shown = (kept[0] >= origin + start * rate) & (kept[0] <= origin + (start + WINDOW_S) * rate)
            samples, rotation, velocity = (row[shown] for row in kept)
        else:
            samples, rotation, velocity = session.trace.window(origin + start * rate)
        self.rotation.show_line(samples, rotation * 1e3, origin, rate)
        self.velocity.show_line(samples, velocity, origin, rate)
        self._set_limits(rotation, velocity)
        self._draw_estimate()
        self.rotation.show_notice(self._what_is_shown(kept is not None))

    def _what_is_shown(self, kept: bool) -> str:
        """A sentence where the line is not the present."""
        session = self._session
        if kept:
            return "The test has ended: this is its record, not the present"
        if not session.fresh(MotionMessage):
            return f"Not live: the newest value is {session.age_s(MotionMessage):.1f} s old"
        return ""

    def _paged_start(self, elapsed_s: float) -> float:
        """Left end of the frame for a long test: moves on by thirds of the frame, not with every frame."""
        step = WINDOW_S / 3.0
        return -LEAD_S + step * math.ceil((elapsed_s - (WINDOW_S - LEAD_S)) / step)

    def _set_frame(self, start: float, stop: float, label: str) -> None:
        if self._frame != (start, stop):
            self._frame = (start, stop)
            self.rotation.setXRange(start, stop, padding=0)
            self.velocity.set_label("bottom", label)
            self._limits = (math.nan, math.nan)

    def _set_limits(self, rotation: Array, velocity: Array) -> None:
        """Ranges that hold still: set from the target, grown in steps when the motion leaves them."""
        alpha = self._session.alpha_rad
        if not math.isfinite(alpha):
            return
        biggest = max(
            float(np.nanmax(np.abs(rotation), initial=0.0)),
            self.target_rad if math.isfinite(self.target_rad) else 0.0,
            0.1 * alpha,
        )
        fastest = max(float(np.nanmax(np.abs(velocity), initial=0.0)), 0.08)
        rotation_limit = 0.05 * alpha * math.ceil(1.12 * biggest / (0.05 * alpha))
        velocity_limit = 0.1 * math.ceil(1.12 * fastest / 0.1)
        if (rotation_limit, velocity_limit) != self._limits:
            self._limits = (rotation_limit, velocity_limit)
            self.rotation.setYRange(-rotation_limit * 1e3, rotation_limit * 1e3, padding=0)
            self.rotation.plot_item.getAxis("right").setScale(1e-3 / alpha)
            self.velocity.setYRange(-velocity_limit, velocity_limit, padding=0)

    def _draw_estimate(self) -> None:
        session = self._session
        estimate = session.estimate
        key = (id(estimate), self._theory_on)
        if key == self._theory_key:
            return
        self._theory_key = key
        impacts = np.asarray(estimate.impact_samples if estimate is not None else [])
        if estimate is not None and session.rig is not None:
            self._impacts.setData(
                (impacts - estimate.release_sample) / session.rate_hz, np.zeros(impacts.size)
            )
        else:
            self._impacts.setData([], [])
        if self._theory_on and estimate is not None and session.rig is not None:
            time, rotation, velocity = housner_motion(
                session.rig.specimen, estimate, WINDOW_S, session.rate_hz
            )
            self._theory[0].setData(time, rotation * 1e3)
            self._theory[1].setData(time, velocity)
        else:
            for curve in self._theory:
                curve.setData([], [])

    def theory_caption(self) -> str:
        """Which r the overlay uses; empty when there is none."""
        estimate: EstimateMessage | None = self._session.estimate
        chosen = current_restitution(estimate) if estimate is not None and self._theory_on else None
        return f"Housner with r = {chosen[1]:.3f} ({chosen[0]})" if chosen else ""
