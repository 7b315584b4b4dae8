"""The linked plots of the replay page: one per chosen kind of signal, a common time cursor, events."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QColor, QFontMetricsF, QResizeEvent

from daq_app.monitor.data.replay_data import ROTATION, VELOCITY, ReplayRun
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.plot_base import axes, line_pen

TITLES = {
    ROTATION: "θ  (mrad)",
    VELOCITY: "dθ/dt  (rad/s)",
    "lvdt": "LVDT  (mm)",
    "wire": "Wires  (mm)",
    "accelerometer": "Accel.  (m/s²)",
    "tiltmeter": "Tilt  (mrad)",
    "load_cell": "Force  (kN)",
    "strain_gauge": "Strain  (µm/m)",
    "laser": "Lasers  (mm)",
    "displacement": "Displacement  (mm)",
    "temperature": "Temperature  (°C)",
    "voltage": "Voltage  (V)",
    "other": "Others",
}
_MARKED_EVENTS = {"released": "release", "at_rest": "rest", "marker": "marker", "gap": "gap", "note": "note"}


def shade(colour: str, place: int, count: int) -> QColor:
    """One of `count` neighbouring hues about a family's colour."""
    base = QColor(colour)
    hue, saturation, value = base.hueF(), base.saturationF(), base.valueF()
    shift = 0.0 if count < 2 else 0.22 * (place / (count - 1) - 0.5)
    return QColor.fromHsvF((hue + shift) % 1.0, saturation, value)


class ReplayPlots(pg.GraphicsLayoutWidget):  # type: ignore[misc]
    """Emits `cursor_moved(time_s)`."""

    cursor_moved = Signal(float)

    def __init__(self) -> None:
        super().__init__()
        self._colours = DARK
        self._run: ReplayRun | None = None
        self._chosen: list[str] = []
        self._plots: list[pg.PlotItem] = []
        self._curves: dict[str, Any] = {}
        self._cursors: list[pg.InfiniteLine] = []
        self._labels: list[Any] = []
        self.cursor_s = math.nan
        self._redraw = QTimer(self)
        self._redraw.setSingleShot(True)
        self._redraw.setInterval(30)
        self._redraw.timeout.connect(self.draw)

    def resizeEvent(self, event: QResizeEvent | None) -> None:
        """A wider screen shows more columns: a run is often drawn before its page has a size."""
        super().resizeEvent(event)
        if event is not None and event.size().width() != event.oldSize().width():
            self._redraw.start()

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.setBackground(colours.surface)
        self._rebuild()

    def show_run(self, run: ReplayRun, names: list[str]) -> None:
        """Draw signals of a run over its whole length."""
        self._run, self._chosen = run, names
        self.cursor_s = math.nan
        self._rebuild(keep_view=False)

    def choose(self, names: list[str]) -> None:
        """Change which signals are drawn; the view stays."""
        self._chosen = names
        self._rebuild()

    @property
    def view_s(self) -> tuple[float, float]:
        """The visible span."""
        if not self._plots:
            return (0.0, 0.0)
        left, right = self._plots[0].viewRange()[0]
        return float(left), float(right)

    def set_view(self, start_s: float, stop_s: float) -> None:
        """Show a span."""
        if self._plots and stop_s > start_s:
            self._plots[0].setXRange(start_s, stop_s, padding=0)
            self.draw()

    def set_cursor(self, time_s: float) -> None:
        """Put the time cursor somewhere, within the run."""
        if self._run is None:
            return
        start, stop = self._run.span_s
        self.cursor_s = max(start, min(stop, time_s))
        for line in self._cursors:
            line.blockSignals(True)
            line.setValue(self.cursor_s)
            line.blockSignals(False)
        self.cursor_moved.emit(self.cursor_s)

    # -- building --------------------------------------------------------------------------------

    def _groups(self) -> dict[str, list[str]]:
        """Signals by plot, in the order of `TITLES`."""
        assert self._run is not None
        groups: dict[str, list[str]] = {}
        for key in TITLES:
            for name in self._chosen:
                signal = self._run.signals.get(name)
                if signal is not None and key in (name, signal.family):
                    groups.setdefault(key, []).append(name)
        return groups

    def _rebuild(self, *, keep_view: bool = True) -> None:
        view = self.view_s if keep_view and self._plots else None
        self.clear()
        self._plots, self._curves, self._cursors, self._labels = [], {}, [], []
        run = self._run
        if run is None:
            return
        groups = self._groups()
        start, stop = run.span_s
        for row, (key, names) in enumerate(groups.items()):
            plot = self.addPlot(row=row, col=0, axisItems=axes(), enableMenu=False)
            self._style(plot, TITLES[key], last=row == len(groups) - 1)
            plot.setLimits(xMin=start - 0.02 * (stop - start), xMax=stop + 0.02 * (stop - start))
            plot.setMouseEnabled(x=True, y=False)
            if self._plots:
                plot.setXLink(self._plots[0])
            for place, name in enumerate(names):
                curve = pg.PlotCurveItem(skipFiniteCheck=False)
                curve.setPen(line_pen(self._pen_colour(name, key, place, len(names))))
                plot.addItem(curve)
                self._curves[name] = curve
            self._add_cursor(plot)
            self._add_events(plot, named=row == 0)
            self._plots.append(plot)
        if not self._plots:
            return
        self._plots[0].sigXRangeChanged.connect(lambda *_: self._redraw.start())
        low, high = view if view is not None else (start, stop)
        self.set_view(low, high)
        if math.isfinite(self.cursor_s):
            self.set_cursor(self.cursor_s)

    def _pen_colour(self, name: str, key: str, place: int, count: int) -> QColor:
        if name == ROTATION:
            return QColor(self._colours.rotation)
        if name == VELOCITY:
            return QColor(self._colours.velocity)
        return shade(self._colours.family(key), place, count)

    def _style(self, plot: pg.PlotItem, title: str, *, last: bool) -> None:
        colours = self._colours
        plot.hideButtons()
        plot.showGrid(x=True, y=True, alpha=0.18)
        for name in ("left", "bottom"):
            axis = plot.getAxis(name)
            axis.setPen(pg.mkPen(colours.line))
            axis.setTextPen(pg.mkPen(colours.muted))
            axis.setTickFont(colours.font(8.5))
            axis.text_px = QFontMetricsF(colours.font(8.5)).height()
        plot.getAxis("left").setWidth(colours.px(64))
        plot.setLabel("left", title, **colours.axis_style)
        if last:
            assert self._run is not None
            zero = "release" if any(e.kind == "released" for e in self._run.events) else "first sample"
            plot.setLabel("bottom", f"time since {zero}  (s)", **colours.axis_style)
        else:
            plot.getAxis("bottom").setStyle(showValues=False)
            plot.getAxis("bottom").setHeight(6)

    def _add_cursor(self, plot: pg.PlotItem) -> None:
        line = pg.InfiniteLine(angle=90, movable=True, pen=line_pen(self._colours.text))
        line.setHoverPen(pg.mkPen(self._colours.accent, width=3))
        line.setVisible(True)
        line.setZValue(20)
        assert self._run is not None
        line.setValue(self.cursor_s if math.isfinite(self.cursor_s) else self._run.span_s[0])
        line.sigPositionChanged.connect(lambda moved: self.set_cursor(float(moved.value())))
        plot.addItem(line, ignoreBounds=True)
        self._cursors.append(line)

    def _add_events(self, plot: pg.PlotItem, *, named: bool) -> None:
        assert self._run is not None
        for event in self._run.events:
            if event.kind not in _MARKED_EVENTS:
                continue
            time = self._run.time_of(event.sample - self._run.first_sample)
            line = pg.InfiniteLine(time, angle=90, pen=line_pen(self._colours.muted, dashed=True))
            if named:
                options = {"position": 0.94, "color": self._colours.muted, "anchors": [(0, 0), (0, 0)]}
                line.label = pg.InfLineLabel(line, text=_MARKED_EVENTS[event.kind], **options)
            plot.addItem(line, ignoreBounds=True)

    # -- drawing ---------------------------------------------------------------------------------

    def draw(self) -> None:
        """Draw the visible span at the resolution of the screen."""
        run = self._run
        if run is None or not self._plots:
            return
        start, stop = self.view_s
        columns = max(100, self.width() - 80)
        for plot, names in zip(self._plots, self._groups().values(), strict=True):
            lowest, highest = math.inf, -math.inf
            for name in names:
                envelope = run.envelope(name, start, stop, columns)
                x = np.repeat(envelope.time_s, 2)
                y = np.stack((envelope.low, envelope.high), axis=1).ravel()
                self._curves[name].setData(x, y, connect="finite")
                lowest = min(lowest, float(np.nanmin(envelope.low, initial=math.inf)))
                highest = max(highest, float(np.nanmax(envelope.high, initial=-math.inf)))
            if lowest <= highest:
                margin = 0.06 * (highest - lowest) or 1.0
                plot.setYRange(lowest - margin, highest + margin, padding=0)
