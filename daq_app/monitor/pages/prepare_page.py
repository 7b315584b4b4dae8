"""Before the test: choose it, check every sensor, zero, and pull to the right rotation."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from daq_app.acquisition.checks.check_model import SensorCheck
from daq_app.acquisition.checks.pull_check import PullTooSmall, check_pull
from daq_app.acquisition.checks.sensor_check import Conditions, check_at_rest
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.session import RECORDING, Session
from daq_app.monitor.widgets.actions import BETWEEN_TESTS
from daq_app.monitor.widgets.check_table import SHAPES, TONES, CheckTable
from daq_app.monitor.widgets.labels import role_label, set_role
from daq_app.monitor.widgets.notices import Severity
from daq_app.monitor.widgets.pull_gauge import PullGauge
from daq_app.monitor.widgets.shapes import Sign
from daq_app.monitor.widgets.test_card import TestCard
from daq_app.monitor.widgets.theme import DARK, Colours, font
from daq_app.monitor.widgets.wall_card import WallCard

REST_S = 3.0
"""How much of the still wall the check looks at."""
PULL_S = 1.0


@dataclass(slots=True)
class Zero:
    """The tare in force, as the acquisition told it."""

    readings: Mapping[str, float] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)


class PreparePage(QWidget):
    """Emits `tare_wanted` and `told(severity, text)`; everything else happens here."""

    tare_wanted = Signal()
    told = Signal(str, str)
    checked = Signal()

    def __init__(self, session: Session, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._background = background
        self._colours = DARK
        self.zero = Zero()
        self.planned_rate_hz = 0.0
        self.check: SensorCheck | None = None
        self._rest_readings: NDArray[np.float64] | None = None
        """Mean reading of each channel at the check at rest: the pull test starts from it."""
        self.card = TestCard()
        self.gauge = PullGauge(session)
        self.table = CheckTable()
        self.wall = WallCard(background)
        self.wall.told.connect(self.told)
        self._sign = Sign(30)
        self._verdict = QLabel("Not checked")
        self._verdict.setFont(font(19, bold=True))
        self._summary = role_label("Leave the wall alone and check the sensors.", "muted")
        self._summary.setWordWrap(True)
        self.check_button = QPushButton("Check sensors  F2")
        self.pull_button = QPushButton("Pull test  F3")
        self.tare_button = QPushButton("Zero  Ctrl+0")
        self._zero_text = role_label("", "muted")
        self._zero_text.setWordWrap(True)
        self._detail = role_label("", "muted")
        self._detail.setWordWrap(True)
        self._detail.setMinimumHeight(36)
        self.table.selectionModel().selectionChanged.connect(lambda *_: self._show_detail())
        self._build()
        self.keys = {"F2": self.check_button, "F3": self.pull_button, "Ctrl+0": self.tare_button}
        """Keys of the whole window: a pull test is wanted while the live page is in front."""
        self.check_button.clicked.connect(self.run_check)
        self.pull_button.clicked.connect(self.run_pull)
        self.tare_button.clicked.connect(self.tare_wanted.emit)
        self.card.changed.connect(self._on_choice)

    def _build(self) -> None:
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addWidget(role_label("1  Choose the test", "heading"))
        left.addWidget(self.card)
        left.addWidget(role_label("2  Zero with the wall upright", "heading"))
        left.addWidget(self._card(self._zero_row()))
        left.addWidget(role_label("4  Arm, then pull to the target", "heading"))
        left.addWidget(self._card(self.gauge), 1)
        left.addWidget(self.wall)
        holder = QWidget()
        holder.setLayout(left)
        left.setContentsMargins(0, 0, 0, 0)
        holder.setFixedWidth(400)
        banner = QHBoxLayout()
        banner.setSpacing(12)
        words = QVBoxLayout()
        words.setSpacing(0)
        words.addWidget(self._verdict)
        words.addWidget(self._summary)
        banner.addWidget(self._sign)
        banner.addLayout(words, 1)
        banner.addWidget(self.check_button)
        banner.addWidget(self.pull_button)
        right = QVBoxLayout()
        right.setSpacing(8)
        right.addWidget(role_label("3  Check the sensors", "heading"))
        right.addWidget(self._card(banner))
        right.addWidget(self.table, 1)
        right.addWidget(self._detail)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.setSpacing(12)
        layout.addWidget(holder)
        layout.addLayout(right, 1)

    def _zero_row(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.addWidget(self._zero_text, 1)
        row.addWidget(self.tare_button)
        return row

    @staticmethod
    def _card(content: QWidget | QHBoxLayout) -> QFrame:
        frame = QFrame()
        frame.setObjectName("card")
        layout = QVBoxLayout(frame)
        layout.setContentsMargins(12, 10, 12, 10)
        if isinstance(content, QWidget):
            layout.addWidget(content)
        else:
            layout.addLayout(content)
        return frame

    def restyle(self, colours: Colours) -> None:
        """Take over a theme."""
        self._colours = colours
        self.gauge.restyle(colours)
        self.table.restyle(colours)
        self._show_verdict()

    def set_rig(self, rig: Rig) -> None:
        """A new rig is wired: nothing has been checked on it."""
        self.check = None
        self._rest_readings = None
        self.table.show_check(rig, None)
        self._show_verdict()
        self._show_zero()

    def set_zero(self, zero: Zero) -> None:
        """The tare in force has changed."""
        self.zero = zero
        self._show_zero()

    def refresh(self) -> None:
        """Bring buttons and gauge up to date; several times a second."""
        state = self._session.current_state
        between = state in BETWEEN_TESTS and self._session.sampling
        self.check_button.setEnabled(between and not self._background.busy)
        self.tare_button.setEnabled(between)
        may_pull = between or (state in RECORDING and self._session.sampling)
        self.pull_button.setEnabled(self._rest_readings is not None and may_pull)
        self.gauge.update()

    # -- the check -------------------------------------------------------------------------------

    def run_check(self) -> None:
        """Check the last seconds of every channel; the wall must stand still."""
        rig = self._session.rig
        data = self._session.recent(REST_S)
        if rig is None or data is None:
            self._tell(
                "warning", f"The check needs {REST_S:g} s of data without a gap. Wait a little and try again."
            )
            return
        health = self._session.health
        conditions = Conditions(
            rate_hz=self._session.rate_hz,
            planned_rate_hz=self.planned_rate_hz or self._session.rate_hz,
            free_bytes=health.free_bytes if health is not None else -1,
            today=dt.date.today(),
            tare=dict(self.zero.readings),
            overloaded=self._session.overloaded,
        )
        readings = self._mean_readings(data)
        self.check_button.setEnabled(False)

        def done(check: SensorCheck) -> None:
            self._rest_readings = readings
            self._show_check(check)

        self._background.run(
            lambda: check_at_rest(rig, data, conditions), done, lambda error: self._tell("error", str(error))
        )

    def run_pull(self) -> None:
        """Compare every channel with the common rotation since the check at rest."""
        rig, check, rest = self._session.rig, self.check, self._rest_readings
        data = self._session.recent(PULL_S)
        if rig is None or check is None or rest is None or data is None:
            self._tell("warning", "Check the sensors at rest first; the pull test compares with it.")
            return
        now = self._mean_readings(data)
        scaling = Scaling.of(rig.channels)
        change = (scaling.to_si(now) - scaling.to_si(rest))[:, 0]
        try:
            self._show_check(check_pull(rig, check, change))
        except PullTooSmall as error:
            self._tell("warning", str(error))

    def _mean_readings(self, data: NDArray[np.float32]) -> NDArray[np.float64]:
        """(n_channels, 1): a zero taken between two looks must not count as motion."""
        assert self._session.rig is not None
        mean = data.mean(axis=1, dtype=np.float64, keepdims=True)
        return Scaling.of(self._session.rig.channels, self.zero.readings).to_readings(mean)

    def _show_check(self, check: SensorCheck) -> None:
        self.check = check
        self.table.show_check(self._session.rig, check)
        self.table.selectRow(0)
        self._show_detail()
        self._show_verdict()
        self.checked.emit()

    def _show_detail(self) -> None:
        """The whole sentence on the chosen channel, which the table may have to cut."""
        rows = self.table.selectionModel().selectedRows()
        check = self.table.check_model.check_of(rows[0].row()) if rows else None
        text = "" if check is None else f"{check.channel_id}: {check.text or 'nothing is wrong.'}"
        self._detail.setText(text)

    def _show_verdict(self) -> None:
        check = self.check
        if check is None:
            self._sign.show_shape("ring", self._colours.muted)
            self._verdict.setText("Not checked")
            self._summary.setText("Leave the wall alone and check the sensors.")
            set_role(self._verdict, "")
            return
        tone = TONES[check.verdict]
        self._sign.show_shape(SHAPES[check.verdict], str(getattr(self._colours, tone)))
        words = {"go": "Go", "caution": "Go, with a look", "no-go": "No-go"}
        self._verdict.setText(words[check.verdict.value])
        set_role(self._verdict, tone)
        pull = (
            f" Pull test at {1e3 * check.pull_rotation_rad:.1f} mrad."
            if check.pull_rotation_rad is not None
            else " Pull test not done."
        )
        at = dt.datetime.fromisoformat(check.taken_utc).astimezone() if check.taken_utc else None
        when = f" Checked at {at:%H:%M}." if at is not None else ""
        self._summary.setText(check.summary + pull + when)

    @property
    def verdict_text(self) -> str:
        """The verdict as shown."""
        return self._verdict.text()

    def _show_zero(self) -> None:
        if not self.zero.readings:
            self._zero_text.setText("Not zeroed: readings are relative to the certificates' offsets.")
            return
        rig = self._session.rig
        parts = []
        taken = str(self.zero.record.get("taken_utc", ""))
        if taken:
            parts.append(f"Zeroed at {dt.datetime.fromisoformat(taken).astimezone():%H:%M:%S}")
        else:
            parts.append("Zeroed")
        samples = self.zero.record.get("n_samples")
        if samples:
            parts.append(f"over {samples} samples")
        if rig is not None:
            name, share = max(
                (
                    (c.id, abs(self.zero.readings.get(c.id, 0.0)) / (c.input_range_v[1] - c.input_range_v[0]))
                    for c in rig.channels
                ),
                key=lambda pair: pair[1],
            )
            parts.append(f"· largest {100 * share:.1f} % of the input range ({name})")
        self._zero_text.setText(" ".join(parts))

    def _on_choice(self) -> None:
        self.gauge.target_ratio = self.wall.target_ratio = self.card.choice.target_ratio
        self.gauge.update()

    def _tell(self, severity: Severity, text: str) -> None:
        self.told.emit(severity, text)
