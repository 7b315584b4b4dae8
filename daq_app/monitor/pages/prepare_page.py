"""Before the test: choose it, check every sensor, zero, and pull to the right rotation."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QScrollArea, QVBoxLayout, QWidget

from daq_app.acquisition.checks.check_model import SensorCheck
from daq_app.acquisition.messages.published import RECORDING
from daq_app.config.rig import Rig
from daq_app.monitor.course.pull_gauge import PullGauge
from daq_app.monitor.data.background import Background
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.labels import PlainLabel, role_label, set_role
from daq_app.monitor.look.shapes import Sign
from daq_app.monitor.look.theme import DARK, Colours
from daq_app.monitor.widgets.actions import BETWEEN_TESTS
from daq_app.monitor.widgets.check_table import SHAPES, TONES, CheckTable
from daq_app.monitor.widgets.test_card import TestCard
from daq_app.monitor.widgets.wall_card import WallCard


@dataclass(slots=True)
class Zero:
    """The tare in force, as the acquisition told it."""

    readings: Mapping[str, float] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)


class PreparePage(QWidget):
    """Emits what is wanted of the recorder (zero, check, pull test) and `told(severity, text)`."""

    tare_wanted = Signal()
    check_wanted = Signal()
    pull_wanted = Signal()
    told = Signal(str, str)
    checked = Signal()

    def __init__(self, session: Session, background: Background, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._colours = DARK
        self.zero = Zero()
        self.planned_rate_hz = 0.0
        self.may_command = True
        """Whether this window may zero and check."""
        self.check: SensorCheck | None = None
        self.card = TestCard()
        self.gauge = PullGauge(session)
        self.table = CheckTable()
        self.wall = WallCard(background)
        self.wall.told.connect(self.told)
        self._sign = Sign(30)
        self._verdict = PlainLabel("Not checked")
        self._verdict.setProperty("scale", "verdict")
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
        self.check_button.clicked.connect(self.check_wanted.emit)
        self.pull_button.clicked.connect(self.pull_wanted.emit)
        self.tare_button.clicked.connect(self.tare_wanted.emit)

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
        left.setContentsMargins(0, 0, 12, 0)
        self._holder = QScrollArea()
        self._holder.setWidget(holder)
        self._holder.setWidgetResizable(True)
        self._holder.setFrameShape(QFrame.Shape.NoFrame)
        self._holder.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        banner = QHBoxLayout()
        banner.setSpacing(12)
        words = QVBoxLayout()
        words.setSpacing(0)
        words.addWidget(self._verdict)
        words.addWidget(self._summary)
        banner.addWidget(self._sign)
        banner.addLayout(words, 1)
        buttons = QVBoxLayout()
        buttons.addWidget(self.check_button)
        buttons.addWidget(self.pull_button)
        banner.addLayout(buttons)
        right = QVBoxLayout()
        right.setSpacing(8)
        right.addWidget(role_label("3  Check the sensors", "heading"))
        right.addWidget(self._card(banner))
        right.addWidget(self.table, 1)
        right.addWidget(self._detail)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(10, 8, 10, 8)
        layout.setSpacing(4)
        layout.addWidget(self._holder)
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
        self._holder.setFixedWidth(colours.side_px(412))
        self.gauge.restyle(colours)
        self.table.restyle(colours)
        self._show_verdict()

    def set_rig(self, rig: Rig) -> None:
        """A new rig is wired: nothing has been checked on it."""
        self.check = None
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
        sampling = self._session.sampling and self.may_command
        between = state in BETWEEN_TESTS and sampling
        self.check_button.setEnabled(between)
        self.tare_button.setEnabled(between)
        may_pull = between or (state in RECORDING and sampling)
        self.pull_button.setEnabled(self.check is not None and may_pull)
        self.gauge.update()

    # -- the check -------------------------------------------------------------------------------

    def show_check(self, check: SensorCheck | None) -> None:
        """Show the check in force, as the recorder took it."""
        if check is None:
            self.check = None
            self.table.show_check(self._session.rig, None)
            self._show_verdict()
        else:
            self._show_check(check)

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
