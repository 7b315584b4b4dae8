"""Measured beside simulated rotation on the page of a diagnosis: one run, without and with what was found."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from daq_app.config.shown_text import shortened
from daq_app.monitor.look.labels import number
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.plots.plot_base import Plot, line_pen

_SHOWN: Final = (("measured", "text"), ("baseline", "warning"), ("augmented", "good"))
"""Trace → theme colour."""


class GapTraces(QWidget):
    """θ of the run with the largest release, and below what each simulation leaves of it."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colours = DARK
        self._trace: Mapping[str, Any] | None = None
        self._result_shown = False
        self.legend = QLabel()
        self.legend.setTextFormat(Qt.TextFormat.RichText)
        self.legend.setWordWrap(True)
        self.rotation = Plot("", "θ  (mrad)", "")
        self.left = Plot("", "Δθ  (mrad)", "time from release  (s)")
        self.left.setXLink(self.rotation)
        self.curves = {name: self.rotation.curve() for name, _ in _SHOWN}
        self.rests = {name: self.left.curve() for name, _ in _SHOWN[1:]}
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.legend)
        layout.addWidget(self.rotation, 1)
        layout.addWidget(self.left, 1)
        self.legend.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._show_legend()

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        for plot in (self.rotation, self.left):
            plot.restyle(colours)
        for name, colour in _SHOWN:
            self.curves[name].setPen(line_pen(getattr(colours, colour)))
            if name in self.rests:
                self.rests[name].setPen(line_pen(getattr(colours, colour)))
        self._show_legend()

    def show_traces(self, traces: Sequence[Mapping[str, Any]]) -> None:
        """Take over the traces of a result (its notes); none clears."""
        self._result_shown = True
        self._trace = traces[0] if traces else None
        empty: list[float] = []
        known = {name: (self._trace or {}).get(f"{name}_mrad", empty) for name, _ in _SHOWN}
        values = {name: np.array(row, dtype=np.float64) for name, row in known.items()}
        time_s = np.array((self._trace or {}).get("time_s", empty), dtype=np.float64)
        for name, curve in self.curves.items():
            curve.setData(time_s, values[name])
        for name, curve in self.rests.items():
            curve.setData(time_s, values["measured"] - values[name])
        self._show_legend()

    def _show_legend(self) -> None:
        for plot in (self.rotation, self.left):
            plot.setVisible(self._trace is not None)
        if self._trace is None:
            self.legend.setText("This result holds no simulated rotation." if self._result_shown else "")
            return
        colours, rms, shown = self._colours, self._trace["rms_mrad"], self._trace["shown"]
        run = html.escape(shortened(str(self._trace["run"]), 80))
        self.legend.setText(
            f"{run}: <span style='color:{colours.text}'>measured</span> ({shown}), "
            f"<span style='color:{colours.warning}'>simulated</span> (leaves {number(rms[0], 2)} mrad rms), "
            f"<span style='color:{colours.good}'>with what was found</span> ({number(rms[1], 2)} mrad)"
        )
