"""From any state of the window to the next armed test, by the keys of the manual's table."""

from __future__ import annotations

import re

import pytest

from daq_app.acquisition.messages.published import RECORDING, State
from daq_app.acquisition.viewers.launcher import AcquisitionProcess

pytestmark = pytest.mark.heavy
LIMIT_MS = 300_000
"""Limit of one wait: for a hang, not for a slow machine."""


@pytest.fixture
def keys_of(configs) -> dict[str, list[str]]:
    """The manual's table: where the operator is → the keys."""
    manual = (configs.parent / "docs" / "tutorial" / "operator-manual.md").read_text(encoding="utf-8")
    table = manual.split("<!-- actions -->")[1].split("<!-- actions: end -->")[0]
    rows = re.findall(r"^\| (?!where|-)(.+?) \| (.+?) \| (\d+) \|$", table, re.MULTILINE)
    found = {where: [key for key in keys.split(", ") if key != "none"] for where, keys, _ in rows}
    assert [len(keys) for keys in found.values()] == [int(count) for _, _, count in rows]
    return found


@pytest.fixture
def acquisition(configs, tmp_path):
    process = AcquisitionProcess(
        ["--rig", str(configs / "fr1.toml"), "--out", str(tmp_path / "runs"), "--speed", "2"]
    )
    yield process
    process.kill()


class Hands:
    """An operator at the keyboard of one window after the other."""

    def __init__(self, qtbot, acquisition, settings, plan) -> None:
        self._qtbot, self._acquisition, self._settings, self._plan = qtbot, acquisition, settings, plan
        self.open()

    def open(self) -> None:
        from daq_app.monitor.window.app import open_window

        window = open_window(
            self._acquisition.address, self._acquisition.token, self._settings, plan=self._plan
        )
        self._qtbot.addWidget(window)
        window.show()
        window.activateWindow()
        self.window = window
        self.until(lambda: window.campaign.status is not None and window.session.sampling)

    def until(self, condition) -> None:
        self._qtbot.waitUntil(condition, timeout=LIMIT_MS)

    def reach(self, state: State) -> None:
        self.until(lambda: self.window.session.current_state is state)

    def press(self, keys: list[str]) -> None:
        from PySide6.QtGui import QKeySequence
        from PySide6.QtTest import QTest

        for key in keys:
            self.until(self._ready(key))
            QTest.keySequence(self.window, QKeySequence(key))
            self.until(self._answered(key))

    def _ready(self, key: str):
        window = self.window
        buttons = {
            "F5": window.actions_bar.buttons["arm"],
            "F6": window.actions_bar.buttons["next"],
            "F8": window.actions_bar.buttons["abort"],
            "Ctrl+0": window.prepare.tare_button,
            "F2": window.prepare.check_button,
            "Ctrl+R": window.result.buttons["bad"],
        }
        return buttons[key].isEnabled

    def _answered(self, key: str):
        window = self.window
        answers = {
            "F6": lambda: bool(window.prepare.card.choice.name),
            "Ctrl+0": lambda: bool(window.prepare.zero.readings),
            "F2": lambda: window.prepare.check is not None,
        }
        return answers.get(key, lambda: True)


def test_the_keys_of_the_manual_lead_from_any_state_to_the_next_armed_test(
    qtbot, acquisition, settings, configs, keys_of
):
    hands = Hands(qtbot, acquisition, settings, configs / "campaigns" / "costa.toml")

    def give_up() -> None:
        hands.press(["F8", "F8"])
        hands.until(lambda: hands.window.session.current_state not in RECORDING)

    def let_go() -> None:
        wall = hands.window.prepare.wall
        wall.order("pull")
        hands.until(lambda: abs(hands.window.session.rotation_rad) > 0.01)
        hands.reach(State.HOLDING)
        wall.order("release")
        hands.reach(State.SAVED)
        hands.until(lambda: hands.window.result.result is not None)

    def arm_from(where: str) -> None:
        hands.press(keys_of.pop(where))
        hands.reach(State.ARMED)

    arm_from("the window has just been opened, nothing is zeroed or checked")
    give_up()
    arm_from("an arming was given up")
    hands.window.close()
    hands.open()
    arm_from("the window was closed or lost while armed, and is open again")
    give_up()
    hands.window.show_page(hands.window.campaign)
    arm_from("any other page, the test is chosen")
    let_go()
    arm_from("the result of a good test is shown")
    give_up()
    hands.window.show_page(hands.window.result)
    arm_from("the result of a test that must be repeated is shown")
    hands.window.close()
    assert not keys_of, "each row of the manual is tried"
