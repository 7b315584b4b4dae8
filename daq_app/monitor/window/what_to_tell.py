"""What the window takes out of events and replies: whether to tell of it, what it is about, its numbers."""

from __future__ import annotations

from typing import Final

from daq_app.acquisition.messages.published import EventMessage, State

_QUIET_EVENTS: Final = frozenset({"impact", "marker", "tare", "saved", "check", "result", *State})
"""Events that the pages show anyway, unless they are more than information."""

MAY_BE_REFUSED: Final = frozenset({"tare", "check", "pull", "plan"})
"""Orders whose refusal is no error: the wall was not still, or the test is locked."""


def is_told(event: EventMessage) -> bool:
    """Whether the message line tells of it."""
    return event.kind not in _QUIET_EVENTS or event.severity != "info"


def trouble_of(event: EventMessage) -> str:
    """What a warning is about, where its end is told as well; empty for others."""
    if event.kind == "alarm":
        return f"alarm {event.data.get('alarm', '')}"
    return event.kind if event.kind in ("disk", "memory", "recorder") else ""


def numbers(value: object) -> dict[str, float]:
    """Named numbers of a reply; none where it has none."""
    return {str(k): float(v) for k, v in value.items()} if isinstance(value, dict) else {}
