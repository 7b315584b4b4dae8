"""A running test in the terminal: what it says beside an r that rests on no zero."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from daq_app.acquisition.messages.published import EventMessage, State, StateMessage
from daq_app.cli.record.view import RunView


def said(about, *messages):
    text = io.StringIO()
    with RunView(Console(file=text, width=200), "FR1-L3-1", about) as view:
        for message in messages:
            view.take(message)
    return text.getvalue()


RELEASED = StateMessage(state=State.RELEASED, text="released", since_sample=4000, sample=4000)


@pytest.mark.parametrize("about", [{}, {"tare": {}}])
def test_a_release_without_a_zero_is_told_once(about):
    text = said({"rate_hz": 4000.0, **about}, RELEASED, RELEASED)
    assert text.count("No zero has been taken: r on screen is off by about 3 %") == 1


@pytest.mark.parametrize(
    ("about", "before"),
    [({"tare": {"LV-A01": 0.1}}, ()), ({}, (EventMessage(kind="tare", sample=9, text="Zero taken"),))],
)
def test_with_a_zero_nothing_is_told(about, before):
    assert "No zero" not in said({"rate_hz": 4000.0, **about}, *before, RELEASED)
