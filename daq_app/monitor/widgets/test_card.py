"""Which test comes next: its name, the rotation to pull to, and notes that go into the run."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from daq_app.monitor.look.labels import role_label
from daq_app.runfile import TestPlan

LEVELS = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}
"""θ0/α of Table 3.2."""
_LEVEL = re.compile(r"(?:^|-)(L[1-4])(?:-|$)")


@dataclass(frozen=True, slots=True)
class TestChoice:
    """The test that would be armed now."""

    __test__ = False  # no test case of pytest

    name: str = ""
    target_ratio: float = math.nan
    """θ0/α to pull to; NaN when no level is chosen."""
    notes: str = ""
    side: str = ""
    operator: str = ""

    @property
    def level(self) -> str:
        """Level of the target, as in the plan of a campaign; empty where there is none."""
        return next((name for name, ratio in LEVELS.items() if abs(ratio - self.target_ratio) < 1e-6), "")

    def as_order(self) -> dict[str, float | str]:
        """The arguments of an order to choose or to arm this test."""
        target = {"theta0_over_alpha": self.target_ratio} if math.isfinite(self.target_ratio) else {}
        words = {"test": self.name, "level": self.level, "side": self.side}
        return {**words, "operator": self.operator, "notes": self.notes, **target}


class TestCard(QFrame):
    """Edits the choice; `changed` tells of every edit."""

    __test__ = False
    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("card")
        self._name = QLineEdit()
        self._name.setPlaceholderText("for instance FR1-L3-2")
        self._name.setMaxLength(60)
        self._notes = QPlainTextEdit()
        self._notes.setPlaceholderText("Notes for the run: weather, cracks, who pulled …")
        self._notes.setMaximumHeight(58)
        self._notes.setTabChangesFocus(True)
        self._operator = QLineEdit()
        self._operator.setPlaceholderText("operator")
        self._operator.setMaxLength(200)
        self._side = QComboBox()
        for text, side in (("either side", ""), ("towards +x", "+x"), ("towards −x", "-x")):
            self._side.addItem(text, side)
        self._group = QButtonGroup(self)
        levels = QHBoxLayout()
        levels.setSpacing(4)
        self._buttons: dict[str, QPushButton] = {}
        for level, ratio in LEVELS.items():
            button = QPushButton(f"{level}  {ratio:.2f}")
            button.setCheckable(True)
            button.setProperty("role", "flat")
            self._group.addButton(button)
            self._buttons[level] = button
            levels.addWidget(button, 1)
        layout = QGridLayout(self)
        layout.setContentsMargins(12, 10, 12, 10)
        layout.setVerticalSpacing(6)
        layout.addWidget(role_label("Test", "heading"), 0, 0)
        layout.addWidget(self._name, 0, 1)
        layout.addWidget(role_label("θ0/α", "heading"), 1, 0)
        layout.addLayout(levels, 1, 1)
        people = QHBoxLayout()
        people.addWidget(self._operator, 1)
        people.addWidget(self._side)
        layout.addWidget(role_label("By", "heading"), 2, 0)
        layout.addLayout(people, 2, 1)
        layout.addWidget(self._notes, 3, 0, 1, 2)
        self._name.textEdited.connect(self._on_name)
        self._group.buttonClicked.connect(lambda _button: self.changed.emit())
        self._notes.textChanged.connect(self.changed.emit)
        self._operator.textEdited.connect(lambda _text: self.changed.emit())
        self._side.activated.connect(lambda _index: self.changed.emit())

    @property
    def choice(self) -> TestChoice:
        """What is chosen now."""
        ratio = next((LEVELS[name] for name, button in self._buttons.items() if button.isChecked()), math.nan)
        return TestChoice(
            self._name.text().strip(),
            ratio,
            self._notes.toPlainText().strip(),
            str(self._side.currentData()),
            self._operator.text().strip(),
        )

    def adopt(self, plan: TestPlan, *, locked: bool) -> None:
        """Show the recorder's plan: it is what counts, whoever chose it. Locked: nothing can be changed."""
        for part in (self._name, self._operator, self._side, self._notes, *self._buttons.values()):
            part.blockSignals(True)
            part.setEnabled(not locked)
        if self.choice.as_order() != _order_of(plan):
            self._name.setText(plan.test)
            self._operator.setText(plan.operator)
            self._side.setCurrentIndex(max(0, self._side.findData(plan.side)))
            self._notes.setPlainText(plan.notes)
            self._group.setExclusive(False)
            for level, button in self._buttons.items():
                target = plan.theta0_over_alpha
                button.setChecked(target is not None and abs(LEVELS[level] - target) < 1e-6)
            self._group.setExclusive(True)
        for part in (self._name, self._operator, self._side, self._notes, *self._buttons.values()):
            part.blockSignals(False)

    def propose(self, name: str, target_ratio: float = math.nan, *, keep_notes: bool = False) -> None:
        """Fill in the next test; `keep_notes` where they are not those of a test that has been taken."""
        self._name.setText(name)
        if not keep_notes:
            self._notes.clear()
        self._check_level(name, target_ratio)
        self.changed.emit()

    def _on_name(self, text: str) -> None:
        self._check_level(text, math.nan)
        self.changed.emit()

    def _check_level(self, name: str, ratio: float) -> None:
        found = _LEVEL.search(name)
        for level, button in self._buttons.items():
            if (found is not None and found[1] == level) or abs(LEVELS[level] - ratio) < 1e-6:
                button.setChecked(True)
                return


def _order_of(plan: TestPlan) -> dict[str, float | str]:
    target = math.nan if plan.theta0_over_alpha is None else plan.theta0_over_alpha
    return TestChoice(plan.test, target, plan.notes, plan.side, plan.operator).as_order()
