"""What the operator can order, with its key, and when it makes sense."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QWidget

from daq_app.acquisition.messages.published import RECORDING, State
from daq_app.monitor.data.session import RUNNING
from daq_app.monitor.look.labels import set_role

CONFIRM_WITHIN_S: Final = 2.5


BETWEEN_TESTS: Final = frozenset({State.PREVIEWING, State.SAVED, State.FAILED})
"""States in which the next test can be prepared while samples come in."""


@dataclass(frozen=True, slots=True)
class Action:
    """One order, enabled in `states`; with `confirm` it must be given twice: one slip costs no test."""

    name: str
    text: str
    key: str
    states: frozenset[State]
    tip: str
    sampling: bool | None = True
    """Whether samples must (or must not) be coming in; None if it does not matter."""
    role: str = ""
    confirm: bool = False


ACTIONS: Final = (
    Action(
        "preview",
        "Live view",
        "F4",
        frozenset({State.IDLE, State.SAVED, State.FAILED}),
        "Start reading the sensors; nothing is recorded",
        sampling=False,
    ),
    Action("arm", "Arm", "F5", BETWEEN_TESTS, "Start recording the test that is chosen", role="primary"),
    Action(
        "next",
        "Next test",
        "F6",
        frozenset(set(State) - RECORDING - {State.SAVING}),
        "Take the next test of the campaign",
        sampling=None,
    ),
    Action(
        "stop",
        "Stop, keep",
        "F7",
        RECORDING,
        "End the recording now and keep the run (it ends by itself at rest)",
        sampling=None,
        confirm=True,
    ),
    Action(
        "abort",
        "Abort",
        "F8",
        frozenset({State.ARMED, State.HOLDING}),
        "Give up this arming before the release; the test's number stays free",
        sampling=None,
        role="danger",
        confirm=True,
    ),
    Action("marker", "Marker", "F9", RUNNING, "Write a marker with this instant into the record"),
    Action("note", "Note", "F10", RUNNING, "Type a note into the record"),
)


class ActionBar(QWidget):
    """The orders as buttons with their keys."""

    ordered = Signal(str)
    """The name of an order that was given."""
    refused = Signal(str)
    """The text of an order whose key was pressed while it makes no sense."""
    told = Signal(str, str)
    """Severity and text: an order that must be asked for twice was asked for once only."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._clock = clock
        self._asked: dict[str, float] = {}
        self.buttons: dict[str, QPushButton] = {}
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(6)
        for action in ACTIONS:
            button = QPushButton(f"{action.text}  {action.key}")
            button.setToolTip(action.tip)
            button.setEnabled(False)
            set_role(button, action.role)
            button.clicked.connect(lambda _checked=False, a=action: self._order(a))
            shortcut = QShortcut(QKeySequence(action.key), self)
            shortcut.activated.connect(lambda a=action: self.press(a))
            self.buttons[action.name] = button
            layout.addWidget(button)

    def refresh(self, state: State | None, *, sampling: bool, may_command: bool) -> None:
        """Enable what makes sense in this state; nothing without a link or the right to command."""
        for action in ACTIONS:
            enabled = may_command and state in action.states and action.sampling in (None, sampling)
            self.buttons[action.name].setEnabled(enabled)
            if action.name in self._asked and not self._is_asked(action):
                self._lapse(action)

    def press(self, action: Action) -> None:
        """The key of an action was pressed."""
        button = self.buttons[action.name]
        if button.isEnabled():
            button.click()
        else:
            self.refused.emit(action.text)

    def _is_asked(self, action: Action) -> bool:
        return self._clock() - self._asked.get(action.name, -1e9) <= CONFIRM_WITHIN_S

    def _order(self, action: Action) -> None:
        if action.confirm and not self._is_asked(action):
            self._asked[action.name] = self._clock()
            self.buttons[action.name].setText(f"{action.key} again: {action.text.lower()}")
            QTimer.singleShot(int(1000 * CONFIRM_WITHIN_S) + 50, self, lambda: self._withdraw_if_old(action))
            return
        self._withdraw(action)
        self.ordered.emit(action.name)

    def _withdraw_if_old(self, action: Action) -> None:
        if action.name in self._asked and not self._is_asked(action):
            self._lapse(action)

    def _lapse(self, action: Action) -> None:
        """It was not asked for again: said, for whoever believes that it was obeyed."""
        self._withdraw(action)
        self.told.emit("info", f"{action.text}: {action.key} was not pressed again, so nothing was done.")

    def _withdraw(self, action: Action) -> None:
        self._asked.pop(action.name, None)
        self.buttons[action.name].setText(f"{action.text}  {action.key}")
