"""What the window takes out of events, states and replies: whether to tell or show it, and its numbers."""

from __future__ import annotations

from typing import Final

from daq_app.acquisition.checks.check_model import SensorCheck, Verdict
from daq_app.acquisition.messages.published import RECORDING, EventMessage, State
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.state_look import look_of

_QUIET_EVENTS: Final = frozenset({"impact", "marker", "tare", "saved", "check", "result", *State})
"""Events that the pages show anyway, unless they are more than information."""

_END_IS_TOLD: Final = frozenset({"disk", "memory", "recorder", "travel", "overload", "check"})
"""Kinds of trouble whose end is an event of the same kind that only informs."""

MAY_BE_REFUSED: Final = frozenset({"tare", "check", "pull", "plan"})
"""Orders whose refusal is no error: the wall was not still, or the test is locked."""


def is_told(event: EventMessage) -> bool:
    """Whether the message line tells of it."""
    return event.kind not in _QUIET_EVENTS or event.severity != "info"


def brings_gauge(before: State | None, now: State) -> bool:
    """Whether a test begins, or this window has come (`before` None) while one is under way."""
    return now in RECORDING if before is None else now in (State.ARMED, State.RELEASED)


def trouble_of(event: EventMessage) -> str:
    """What a warning is about, where its end is told as well; empty for others."""
    if event.kind == "alarm":
        return f"alarm {event.data.get('alarm', '')}"
    if event.kind == "channel":
        return f"channel {event.data.get('channel', '')}"
    return event.kind if event.kind in _END_IS_TOLD else ""


def found_good(check: SensorCheck | None) -> list[str]:
    """The troubles that a check ends: those of the channels that it finds good."""
    channels = check.channels if check is not None else ()
    return [f"channel {channel.channel_id}" for channel in channels if channel.verdict is Verdict.GO]


def refusal(order: str, session: Session, *, may_command: bool) -> str:
    """What is said of an order whose key was pressed while it makes no sense."""
    if not may_command:
        return f"{order}: this window may watch, not command."
    return f"{order}: not now. {look_of(session.current_state, session.judgement).sentence}".strip()


def numbers(value: object) -> dict[str, float]:
    """Named numbers of a reply; none where it has none."""
    return {str(k): float(v) for k, v in value.items()} if isinstance(value, dict) else {}
