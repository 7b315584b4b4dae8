"""How each state of the acquisition is drawn: a shape and a colour. Its words are the recorder's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from daq_app.acquisition.messages.published import Call, Judgement, State, StateMessage, Tone

Shape = Literal["ring", "eye", "triangle", "square", "diamond", "disc", "bar", "arrow", "tick", "cross"]

SHAPES: Final[dict[State, Shape]] = {
    State.IDLE: "ring",
    State.PREVIEWING: "eye",
    State.ARMED: "triangle",
    State.HOLDING: "square",
    State.RELEASED: "diamond",
    State.ROCKING: "disc",
    State.AT_REST: "bar",
    State.SAVING: "arrow",
    State.SAVED: "tick",
    State.FAILED: "cross",
}


@dataclass(frozen=True, slots=True)
class StateLook:
    """What is drawn for a state."""

    word: str
    sentence: str
    """What the operator does next."""
    shape: Shape
    tone: Tone


NO_TEST: Final = "No test chosen"
_AFTERWARDS: Final = frozenset({State.SAVING, State.SAVED, State.FAILED})

UNLINKED: Final = StateLook(
    "No link",
    "Nothing is heard from the recorder. A test under way goes on without this window: open it again on the "
    "same rig and folder.",
    "cross",
    "bad",
)


def look_of(state: State | None, judgement: Judgement) -> StateLook:
    """The look of a state with the recorder's words; None is a lost link."""
    if state is None:
        return UNLINKED
    shape: Shape = "cross" if judgement.alarm else SHAPES[state]
    if state is State.SAVED and judgement.call is not Call.LOOK and not judgement.alarm:
        shape = SHAPES[State.PREVIEWING]  # an arming that was given up is nothing to tick off
    return StateLook(judgement.word, judgement.do, shape, judgement.tone)


def name_of_test(message: StateMessage | None) -> str:
    """The test that the words are about: recorded now, or just recorded, else the one that is chosen."""
    if message is None:
        return NO_TEST
    just_recorded = message.state in _AFTERWARDS and message.judgement.call in (Call.WAIT, Call.LOOK)
    recorded = message.test if message.locked or just_recorded else ""
    return recorded or message.plan.test or NO_TEST
