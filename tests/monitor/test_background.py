"""Work off the window's thread: who asked is answered, unless it has gone."""

from __future__ import annotations

import threading

import shiboken6
from PySide6.QtWidgets import QLabel

from daq_app.monitor.data.background import Background


class _Page(QLabel):
    def __init__(self, answers: list[object]) -> None:
        super().__init__()
        self._answers = answers

    def take(self, answer: object) -> None:
        self.setText(str(answer))
        self._answers.append(answer)


def test_a_page_that_was_closed_meanwhile_is_not_answered(qtbot) -> None:
    background, go, answers = Background(), threading.Event(), []
    closed, open_ = _Page(answers), _Page(answers)
    qtbot.addWidget(open_)
    background.run(lambda: go.wait(60.0) and "late", closed.take, closed.take)
    background.run(lambda: "late", lambda answer: closed.take(answer), closed.take)
    background.run(lambda: "soon", open_.take, open_.take)
    shiboken6.delete(closed)
    with qtbot.captureExceptions() as raised:
        go.set()
        qtbot.waitUntil(lambda: not background.busy, timeout=60_000)
    assert answers == ["soon"] and open_.text() == "soon"
    assert not raised
