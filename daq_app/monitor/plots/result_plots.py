"""The plots of one test's result beside the earlier tests of its level."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from daq_app.campaign.result.motions import measured_periods, theory_motion
from daq_app.campaign.result.result import Result
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.wording import METHOD_MARKS
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.plot_base import Plot, line_pen
from daq_app.rocking.theory import classic as theory

_LEAST_PX: Final = 240
"""Height, at the usual type size, below which the names of the axes have no room beside them."""


class ResultPlots(QWidget):
    """θ(t), dθ/dt(t), r per impact, period against amplitude."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = DARK
        self._result: Result | None = None
        self._over: frozenset[str] | None = None
        """Runs of the level to lie over the test; None: every good one."""
        self.rotation = Plot("Rotation θ", "θ  (mrad)", "")
        self.velocity = Plot("Angular velocity dθ/dt", "dθ/dt  (rad/s)", "time since release  (s)")
        self.velocity.setXLink(self.rotation)
        self.restitution = Plot("r per impact, mean ± standard error", "r", "impact")
        self.periods = Plot("Period against amplitude", "T  (s)", "θ/α")
        self.legend = QLabel()
        self.legend.setTextFormat(Qt.TextFormat.RichText)
        self.legend.setContentsMargins(8, 0, 8, 0)
        for plot in (self.rotation, self.velocity):
            plot.set_axis_width("left", 60)
        layout = QGridLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(6)
        layout.addWidget(self.legend, 0, 0, 1, 2)
        layout.addWidget(self.rotation, 1, 0)
        layout.addWidget(self.velocity, 2, 0)
        layout.addWidget(self.restitution, 1, 1)
        layout.addWidget(self.periods, 2, 1)
        layout.setColumnStretch(0, 62)
        layout.setColumnStretch(1, 38)
        layout.setRowStretch(1, 1)
        layout.setRowStretch(2, 1)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.setMinimumHeight(colours.px(_LEAST_PX))
        for plot in (self.rotation, self.velocity, self.restitution, self.periods):
            plot.restyle(colours)
        self.legend.setText(
            f"<span style='color:{colours.rotation}'>━</span> this test &nbsp; "
            f"<span style='color:{colours.bound}'>━</span> ticked tests of the level &nbsp; "
            f"<span style='color:{colours.theory}'>╌</span> theory with this test's r (CRT) &nbsp; "
            f"<span style='color:{colours.eav}'>●</span> EAV (4.4) &nbsp; "
            f"<span style='color:{colours.crt}'>■</span> CRT (4.5)"
        )
        self._draw()

    def show_result(self, result: Result | None, over: Iterable[str] | None = None) -> None:
        """Draw a result, and over it the tests of its level whose run is in `over` (None: good ones).

        No result: nothing is drawn.
        """
        self._result = result
        self._over = None if over is None else frozenset(over)
        self._draw()

    def _overlaid(self, result: Result) -> Iterator[TestSummary]:
        for other in (*result.earlier, *result.later):
            if other.good if self._over is None else other.run in self._over:
                yield other

    def _draw(self) -> None:
        for plot in (self.rotation, self.velocity, self.restitution, self.periods):
            plot.plot_item.clear()
        if self._result is None:
            return
        self._draw_histories(self._result)
        self._draw_restitution(self._result)
        self._draw_periods(self._result)

    def _draw_histories(self, result: Result) -> None:
        c, test = self._colours, result.test
        for other in self._overlaid(result):
            pen = line_pen(c.bound, dashed=not other.good)
            for plot, values in (
                (self.rotation, 1e3 * other.rotation_rad),
                (self.velocity, other.velocity_rad_s),
            ):
                # A rejected test may be looked at, but the axes are those of the others.
                plot.plot_item.addItem(
                    pg.PlotDataItem(other.time_s, values, pen=pen), ignoreBounds=not other.good
                )
        self.rotation.plot(test.time_s, 1e3 * test.rotation_rad, pen=line_pen(c.rotation, width=2))
        self.velocity.plot(test.time_s, test.velocity_rad_s, pen=line_pen(c.velocity, width=2))
        expected = theory_motion(test)
        if expected is not None:
            time, rotation, velocity = expected
            self.rotation.plot(time, 1e3 * rotation, pen=line_pen(c.theory, dashed=True))
            self.velocity.plot(time, velocity, pen=line_pen(c.theory, dashed=True))
        impacts = np.asarray(test.impacts_s)
        self.rotation.addItem(
            pg.ScatterPlotItem(impacts, np.zeros(impacts.size), symbol="t1", size=7, brush=c.text, pen=c.text)
        )
        if test.time_s.size:
            self.rotation.setXRange(float(test.time_s[0]), float(test.time_s[-1]), padding=0.01)
        for plot in (self.rotation, self.velocity):
            plot.enableAutoRange(axis="y")

    def _draw_restitution(self, result: Result) -> None:
        c, test = self._colours, result.test
        values = [test.r_max]
        last = 5
        for name, colour in (("EAV", c.eav), ("CRT", c.crt)):
            method = test.methods.get(name)
            if method is None:
                continue
            tint = pg.mkColor(colour)
            tint.setAlpha(60)
            low, high = method.r - method.standard_error, method.r + method.standard_error
            band = pg.LinearRegionItem(
                (low, high), orientation="horizontal", movable=False, brush=tint, pen=line_pen(colour)
            )
            self.restitution.addItem(band)
            x = [impact for impact, _ in method.points]
            y = [r for _, r in method.points]
            self.restitution.addItem(
                pg.ScatterPlotItem(x, y, symbol=METHOD_MARKS[name], size=8, brush=colour, pen=colour)
            )
            values += y
            last = max([last, *x])
        self.restitution.addItem(pg.InfiniteLine(test.r_max, angle=0, pen=line_pen(c.bound, dashed=True)))
        self.restitution.setYRange(min(values) - 0.01, max(values) + 0.01, padding=0.05)
        self.restitution.setXRange(0, last + 1, padding=0)

    def _draw_periods(self, result: Result) -> None:
        c, test = self._colours, result.test
        for other in self._overlaid(result):
            self._dots(*measured_periods(other), c.bound, 5, ignore=not other.good)
        self._dots(*measured_periods(test), c.crt, 7)
        phi = np.linspace(0.002, max(0.45, 1.1 * test.phi0), 120)
        self.periods.plot(phi, theory.period(phi, test.p_rad_s), pen=line_pen(c.theory))
        self.periods.setXRange(0, float(phi[-1]), padding=0)
        self.periods.enableAutoRange(axis="y")

    def _dots(
        self, phi: np.ndarray, periods: np.ndarray, colour: str, size: int, *, ignore: bool = False
    ) -> None:
        dots = pg.ScatterPlotItem(phi, periods, symbol="o", size=size, brush=colour, pen=colour)
        self.periods.plot_item.addItem(dots, ignoreBounds=ignore)
