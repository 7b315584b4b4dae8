"""How each state of the acquisition is told: a word, a sentence, a shape and a colour's role."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from daq_app.acquisition.messages.published import State

Shape = Literal["ring", "eye", "triangle", "square", "diamond", "disc", "bar", "arrow", "tick", "cross"]
Tone = Literal["muted", "accent", "warning", "bad", "good"]


@dataclass(frozen=True, slots=True)
class StateLook:
    """What is drawn for a state."""

    word: str
    sentence: str
    """What the operator does next."""
    shape: Shape
    tone: Tone


LOOKS: Final[dict[State, StateLook]] = {
    State.IDLE: StateLook("Idle", "No task runs. Start the live view to see the sensors.", "ring", "muted"),
    State.PREVIEWING: StateLook(
        "Live view", "Sensors are read; nothing is recorded. Check, zero, then arm.", "eye", "accent"
    ),
    State.ARMED: StateLook("Armed", "Pull the wall to the target rotation.", "triangle", "warning"),
    State.HOLDING: StateLook(
        "Holding", "The wall is held still at its rotation. Release when ready.", "square", "warning"
    ),
    State.RELEASED: StateLook("Released", "The wall moves. Keep clear.", "diamond", "bad"),
    State.ROCKING: StateLook("Rocking", "Keep clear; recording stops by itself.", "disc", "bad"),
    State.AT_REST: StateLook("At rest", "Recording the wall at rest for the end zero.", "bar", "good"),
    State.SAVING: StateLook(
        "Saving", "The record is checked and written. Do not switch off.", "arrow", "accent"
    ),
    State.SAVED: StateLook("Saved", "Look at the result, then take the next test.", "tick", "good"),
    State.FAILED: StateLook("Failed", "The test did not end as it should. Read the message.", "cross", "bad"),
}

UNLINKED: Final = StateLook("No link", "Nothing is heard from the acquisition.", "cross", "bad")


def look_of(state: State | None) -> StateLook:
    """The look of a state; None is a lost link."""
    return UNLINKED if state is None else LOOKS[state]
