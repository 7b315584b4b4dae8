"""One channel large: signal with limits, spectrum against the expected noise, and all that is known of it."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QApplication,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from daq_app.acquisition.messages.published import BlockMessage
from daq_app.config.rig import Channel
from daq_app.config.shown_units import shown_unit
from daq_app.monitor.data.channel_look import ChannelLook, expected_density_si, look_at, neighbours
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import DASH, PlainLabel, number, role_label, set_role
from daq_app.monitor.look.theme import Colours, apply_theme
from daq_app.monitor.plots.plot_base import Plot, envelope, line_pen

EVERY_MS: Final = 400
_FACTS: Final = (
    "Now",
    "Raw reading",
    "Noise, rms",
    "Mains hum, rms",
    "Drift",
    "Limits",
    "Range of the sensor",
    "Wired to",
    "Scale",
    "Certificate",
)


def limit_word(channel: Channel, value_si: float) -> tuple[str, str]:
    """(role, word) of a value against the limits of the rig file."""
    size = abs(value_si)
    if channel.critical_si is not None and size >= channel.critical_si:
        return "bad", "✕ above the critical limit"
    if channel.warning_si is not None and size >= channel.warning_si:
        return "warning", "⚠ above the warning limit"
    return "", ""


class ChannelWindow(QWidget):
    """A window of its own, beside the operator's; follows the channel until it is closed (Esc)."""

    def __init__(
        self, session: Session, name: str, tare: Callable[[], Mapping[str, float]], colours: Colours
    ) -> None:
        """`tare`: gives the zero in force, reading by channel."""
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._session, self._tare = session, tare
        self._title = role_label("", "title")
        self.signal = Plot("", "", "seconds ago")
        self.spectrum = Plot("Amplitude spectral density", "", "frequency  (Hz)")
        self.spectrum.plot_item.setLogMode(x=True, y=True)
        self._line, self._density = self.signal.curve(), self.spectrum.curve()
        self._expected = self.spectrum.curve(dashed=True)
        self._limits: list[tuple[pg.InfiniteLine, str]] = []
        self._facts = {name: PlainLabel(DASH) for name in _FACTS}
        self._neighbours = QVBoxLayout()
        self._build()
        QShortcut(QKeySequence("Esc"), self).activated.connect(self.close)
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.refresh)
        self._timer.start(EVERY_MS)
        self.resize(1100, 640)
        self.name = ""
        self.show_channel(name)
        self.restyle(colours)

    def _build(self) -> None:
        plots = QVBoxLayout()
        plots.addWidget(self._title)
        plots.addWidget(self.signal, 3)
        plots.addWidget(self.spectrum, 2)
        side = QGridLayout()
        side.setVerticalSpacing(6)
        for row, (caption, label) in enumerate(self._facts.items()):
            label.setWordWrap(True)
            side.addWidget(role_label(caption, "heading"), row, 0, Qt.AlignmentFlag.AlignTop)
            side.addWidget(label, row, 1)
        side.setColumnStretch(1, 1)
        right = QVBoxLayout()
        right.addLayout(side)
        right.addWidget(role_label("Neighbours", "heading"))
        right.addLayout(self._neighbours)
        right.addStretch(1)
        right.addWidget(role_label("Back  Esc", "muted"))
        layout = QHBoxLayout(self)
        layout.addLayout(plots, 5)
        layout.addLayout(right, 3)

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        app = QApplication.instance()
        if isinstance(app, QApplication):
            apply_theme(app, self, colours, colours.points)
        for plot in (self.signal, self.spectrum):
            plot.restyle(colours)
        channel = self._channel()
        colour = colours.family(channel.family)
        self._line.setPen(line_pen(colour))
        self._density.setPen(line_pen(colour))
        self._expected.setPen(line_pen(colours.bound, dashed=True))
        for line, tone in self._limits:
            line.setPen(line_pen(str(getattr(colours, tone)), dashed=True))
        self._colours = colours

    def _channel(self) -> Channel:
        assert self._session.rig is not None
        return self._session.rig.channel(self.name)

    def show_channel(self, name: str) -> None:
        """Change to another channel."""
        assert self._session.rig is not None
        self.name = name
        channel = self._channel()
        unit, factor = shown_unit(channel.si_unit)
        self.setWindowTitle(f"{name} – channel")
        self._title.setText(f"{name}  ({channel.family})")
        self.signal.set_label("left", unit)
        self.spectrum.set_label("left", f"{unit}/√Hz")
        for line, _ in self._limits:
            self.signal.removeItem(line)
        self._limits = []
        for limit, tone in ((channel.warning_si, "warning"), (channel.critical_si, "bad")):
            for sign in (-1, 1) if limit is not None else ():
                line = pg.InfiniteLine(angle=0, pos=sign * (limit or 0.0) * factor)
                self.signal.plot_item.addItem(line, ignoreBounds=True)
                self._limits.append((line, tone))
        self._show_neighbours()
        if hasattr(self, "_colours"):
            self.restyle(self._colours)
        self._show_wiring(channel, unit, factor)
        self.refresh()

    def _show_neighbours(self) -> None:
        while self._neighbours.count():
            item = self._neighbours.takeAt(0)
            widget = item.widget() if item is not None else None
            if widget is not None:
                widget.deleteLater()
        assert self._session.rig is not None
        self.neighbour_buttons = {}
        for name in neighbours(self._session.rig, self.name):
            button = QPushButton(name)
            button.setProperty("role", "flat")
            button.clicked.connect(lambda _checked=False, n=name: self.show_channel(n))
            self._neighbours.addWidget(button)
            self.neighbour_buttons[name] = button

    def _show_wiring(self, channel: Channel, unit: str, factor: float) -> None:
        low, high = (number(limit * factor, 1) for limit in channel.range_si)
        limits = [
            f"{word} from ± {number(limit * factor, 2, unit)}"
            for word, limit in (("warning", channel.warning_si), ("critical", channel.critical_si))
            if limit is not None
        ]
        low_v, high_v = channel.input_range_v
        due = (channel.certificate.due - dt.date.today()).days
        self._facts["Limits"].setText(", ".join(limits) or "none in the rig file")
        self._facts["Range of the sensor"].setText(f"{low} to {high} {unit}")
        volts = f"{number(low_v, 0)} to {number(high_v, 0)} V"
        self._facts["Wired to"].setText(f"{channel.physical_channel}, {volts}, {channel.terminal_config}")
        sign = "−" if channel.polarity < 0 else ""
        self._facts["Scale"].setText(f"{sign}{channel.sensitivity:g} {channel.sensitivity_unit}")
        self._facts["Certificate"].setText(
            f"{channel.certificate.number}, of {channel.certificate.calibrated}, "
            + (f"due in {due} days" if due >= 0 else "✕ ran out")
        )
        set_role(self._facts["Certificate"], "" if due >= 0 else "bad")

    def refresh(self) -> None:
        """Look again."""
        if not self.name:
            return
        look = look_at(self._session, self.name, self._tare())
        live = look is not None and self._session.fresh(BlockMessage)
        if look is None or not live:
            for name in ("Now", "Raw reading"):
                self._facts[name].setText(f"{DASH}  not live")
                set_role(self._facts[name], "muted")
            return
        self._draw(look)
        self._show_figures(look)
        self._show_values_of_neighbours()

    def _draw(self, look: ChannelLook) -> None:
        _, factor = shown_unit(look.channel.si_unit)
        self._line.setData(*envelope(look.time_s, look.values_si * factor, 600))
        low, high = float(look.values_si.min()) * factor, float(look.values_si.max()) * factor
        spare = max(0.1 * (high - low), 4 * look.channel.noise_si * factor)
        self.signal.setRange(xRange=(look.time_s[0], 0.0), yRange=(low - spare, high + spare), padding=0)
        density = np.maximum(look.density_si, 1e-300) * factor
        self._density.setData(np.log10(look.frequency_hz), np.log10(density))
        expected = math.log10(expected_density_si(look.channel, self._session.rate_hz) * factor)
        ends = np.log10(look.frequency_hz[[0, -1]])
        self._expected.setData(ends, np.array([expected, expected]))
        shown = np.append(np.log10(density), expected)
        self.spectrum.setRange(
            xRange=(ends[0], ends[1]), yRange=(np.percentile(shown, 1) - 0.3, shown.max() + 0.3), padding=0
        )

    def _show_figures(self, look: ChannelLook) -> None:
        unit, factor = shown_unit(look.channel.si_unit)
        now = float(look.values_si[-round(0.1 * self._session.rate_hz) :].mean())
        role, word = limit_word(look.channel, now)
        self._facts["Now"].setText(f"{number(now * factor, 3, unit)}  {word}".strip())
        set_role(self._facts["Now"], role)
        reading = float(look.readings[-round(0.1 * self._session.rate_hz) :].mean())
        self._facts["Raw reading"].setText(number(reading, 5, look.channel.reading_unit))
        set_role(self._facts["Raw reading"], "")
        expected = look.channel.noise_si
        for name, size in (("Noise, rms", look.quality.noise_si), ("Mains hum, rms", look.quality.hum_si)):
            against = f"{number(size / expected, 1)} × the expected {number(expected * factor, 4, unit)}"
            self._facts[name].setText(f"{number(size * factor, 4, unit)}, {against}")
        drift = number(look.quality.drift_si * factor, 4, unit)
        self._facts["Drift"].setText(f"{drift} in {-look.time_s[0]:.0f} s")

    def _show_values_of_neighbours(self) -> None:
        session = self._session
        if session.rig is None or session.block_mean is None:
            return
        for name, button in self.neighbour_buttons.items():
            unit, factor = shown_unit(session.rig.channel(name).si_unit)
            value = float(session.block_mean[session.rig.channel_ids.index(name)])
            button.setText(f"{name}   {number(value * factor, 3, unit)}")


class ChannelWindows:
    """The channels that are open in windows of their own; they go with the operator's window."""

    def __init__(self, session: Session, tare: Callable[[], Mapping[str, float]]) -> None:
        """`tare`: gives the zero in force, reading by channel."""
        self._session, self._tare = session, tare
        self.shown: list[ChannelWindow] = []

    def open(self, name: str, colours: Colours) -> ChannelWindow:
        """The window of a channel, in front; the one that shows it already, if there is one."""
        for window in self.shown:
            if window.name == name and window.isVisible():
                window.setWindowState(window.windowState() & ~Qt.WindowState.WindowMinimized)
                window.raise_()
                window.activateWindow()
                return window
        window = ChannelWindow(self._session, name, self._tare, colours)
        self.shown.append(window)
        window.destroyed.connect(lambda: self.shown.remove(window))
        window.show()
        return window

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        for window in self.shown:
            window.restyle(colours)

    def close(self) -> None:
        """Close them all."""
        for window in self.shown:
            window.close()
