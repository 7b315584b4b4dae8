"""What follows from the impacts: r per impact, the phase plane, period against amplitude."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QVBoxLayout, QWidget

from daq_app.acquisition.messages.published import EstimateMessage
from daq_app.config.wording import METHOD_MARKS
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.theme import Colours
from daq_app.monitor.plots.plot_base import Plot, line_pen
from daq_app.monitor.plots.theory_overlay import measured_periods, period_curve


class RestitutionPlot(QWidget):
    """r after each impact by both estimators, running mean ± standard error, and r_max."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._legend = QLabel()
        self._legend.setTextFormat(Qt.TextFormat.RichText)
        self._legend.setContentsMargins(10, 3, 6, 0)
        self.plot = Plot("", "r", "impact")
        self._bands: dict[str, tuple[object, object, object]] = {}
        self._points: dict[str, pg.ScatterPlotItem] = {}
        self._means: dict[str, pg.PlotCurveItem] = {}
        for name, method in (("eav", "EAV"), ("crt", "CRT")):
            edges = (self.plot.curve(), self.plot.curve())
            band = pg.FillBetweenItem(*edges)
            self.plot.addItem(band)
            self._bands[name] = (*edges, band)
            self._means[name] = self.plot.curve()
            self._points[name] = pg.ScatterPlotItem(symbol=METHOD_MARKS[method], size=8)
            self.plot.addItem(self._points[name])
        self._bound = pg.InfiniteLine(angle=0, movable=False)
        self._bound.setVisible(False)
        self.plot.addItem(self._bound)
        self.plot.setXRange(0, 12, padding=0)
        self.plot.setYRange(0.75, 1.0, padding=0)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self._legend)
        layout.addWidget(self.plot, 1)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self.plot.restyle(colours)
        self._legend.setText(
            f"<span style='color:{colours.eav}'>●</span> EAV, velocity peaks (4.4) &nbsp; "
            f"<span style='color:{colours.crt}'>■</span> CRT, rotation peaks (4.5) &nbsp; "
            f"<span style='color:{colours.bound}'>╌</span> r<sub>max</sub>"
        )
        for name in ("eav", "crt"):
            colour = getattr(colours, name)
            self._points[name].setPen(pg.mkPen(colour))
            self._points[name].setBrush(pg.mkBrush(colour))
            self._means[name].setPen(line_pen(colour))
            low, high, band = self._bands[name]
            for edge in (low, high):
                edge.setPen(pg.mkPen(None))  # type: ignore[attr-defined]
            tint = pg.mkColor(colour)
            tint.setAlpha(46)
            band.setBrush(pg.mkBrush(tint))  # type: ignore[attr-defined]
        self._bound.setPen(line_pen(colours.bound, dashed=True))

    def draw(self) -> None:
        """Draw the session's estimate; called when it changed."""
        estimate = self._session.estimate
        series = (
            {"eav": estimate.eav, "crt": estimate.crt} if estimate is not None else {"eav": [], "crt": []}
        )
        values: list[float] = []
        last = 10
        for name, every in series.items():
            points = [point for point in every if np.isfinite(point.r)]
            self._points[name].setData([point.impact for point in points], [point.r for point in points])
            impacts, mean, error = self._session.running_mean(name)
            self._means[name].setData(impacts, mean)
            low, high, _ = self._bands[name]
            low.setData(impacts, mean - error)  # type: ignore[attr-defined]
            high.setData(impacts, mean + error)  # type: ignore[attr-defined]
            values.extend(point.r for point in points)
            last = max(last, *(point.impact for point in points), 0)
        self._bound.setVisible(estimate is not None)
        if estimate is not None:
            self._bound.setValue(estimate.r_max)
            values.append(estimate.r_max)
        lowest = min([0.8, *(value for value in values if value > 0)])
        highest = max([1.0, *values])
        self.plot.setYRange(max(0.0, np.floor(lowest * 20 - 0.2) / 20), min(highest, 1.2) + 0.005, padding=0)
        self.plot.setXRange(0, 5 * np.ceil((last + 1) / 5), padding=0)

    @property
    def shown(self) -> dict[str, int]:
        """Number of points drawn per estimator."""
        return {name: len(item.data) for name, item in self._points.items()}


class PhasePlane(Plot):
    """θ̇ against θ since the release."""

    def __init__(self, session: Session) -> None:
        super().__init__("Phase plane", "dθ/dt  (rad/s)", "θ  (mrad)")
        self._session = session
        self.set_axis_width("left", 56)
        self._curve = self.curve()
        self._tip = pg.ScatterPlotItem(size=9, symbol="o")
        self.addItem(self._tip)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        super().restyle(colours)
        self._curve.setPen(line_pen(colours.rotation))
        self._tip.setPen(pg.mkPen(colours.text))
        self._tip.setBrush(pg.mkBrush(colours.text))

    def draw(self, live: bool) -> None:
        """Draw the motion so far; the tip is drawn only while it is live."""
        session = self._session
        if session.rate_hz <= 0 or not np.isfinite(session.alpha_rad):
            return
        start = (
            session.estimate.release_sample - 0.2 * session.rate_hz
            if session.estimate is not None
            else session.trace.last_sample - 5.0 * session.rate_hz
        )
        _, rotation, velocity = session.trace.window(start)
        step = max(1, rotation.size // 1500)
        self._curve.setData(rotation[::step] * 1e3, velocity[::step], connect="finite")
        if live and rotation.size:
            self._tip.setData([rotation[-1] * 1e3], [velocity[-1]])
        else:
            self._tip.setData([], [])
        unit = 0.05 * session.alpha_rad
        widest = unit * np.ceil(1.15 * max(np.nanmax(np.abs(rotation), initial=0.0), 2 * unit) / unit)
        fastest = 0.1 * np.ceil(1.15 * max(np.nanmax(np.abs(velocity), initial=0.0), 0.08) / 0.1)
        self.setRange(xRange=(-widest * 1e3, widest * 1e3), yRange=(-fastest, fastest), padding=0)


class PeriodPlot(Plot):
    """Period against amplitude, as in Figure 4.2: measured half-cycles beside Eqn. 4.1."""

    def __init__(self, session: Session) -> None:
        super().__init__("Period against amplitude", "T  (s)", "θ/α")
        self._session = session
        self.set_axis_width("left", 48)
        self._theory = self.curve()
        self._points = pg.ScatterPlotItem(symbol="o", size=7)
        self.addItem(self._points)
        self.setRange(xRange=(0, 0.5), yRange=(0, 2.5), padding=0)
        self._specimen: object = None

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        super().restyle(colours)
        self._theory.setPen(line_pen(colours.theory))
        self._points.setPen(pg.mkPen(colours.text))
        self._points.setBrush(pg.mkBrush(colours.crt))

    def draw(self) -> None:
        """Draw the session's estimate; called when it changed."""
        session = self._session
        if session.rig is not None and session.rig.specimen is not self._specimen:
            self._specimen = session.rig.specimen
            self._theory.setData(*period_curve(session.rig.specimen))
        estimate: EstimateMessage | None = session.estimate
        if estimate is None:
            self._points.setData([], [])
            return
        self._points.setData(*measured_periods(estimate, session.alpha_rad, session.rate_hz))


def side_by_side(*widgets: QWidget) -> QWidget:
    """Widgets of equal width in a row."""
    holder = QWidget()
    layout = QHBoxLayout(holder)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(6)
    for widget in widgets:
        layout.addWidget(widget, 1)
    return holder
