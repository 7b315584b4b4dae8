"""What is wrong with the clock and stays wrong: told once while nothing is armed, and again in every run."""

from __future__ import annotations

from typing import Final

from daq_app.acquisition.messages.published import EventMessage

_SAME_RATE: Final = 1e-6
"""Relative difference up to which the rate that was read back counts as the planned one."""
_STANDING: Final = ("rate", "planned_rate", "drift")


class ClockWarnings:
    """The newest warning of each kind since sampling began."""

    def __init__(self) -> None:
        self._by_kind: dict[str, EventMessage] = {}

    def take(self, event: EventMessage) -> None:
        """Keep an event that tells of a clock that stays wrong; all others say nothing of later runs."""
        if event.kind == "clock" and event.data.get("clock") in _STANDING:
            self._by_kind[str(event.data["clock"])] = event

    def forget(self) -> None:
        """Sampling begins anew."""
        self._by_kind = {}

    @property
    def standing(self) -> tuple[EventMessage, ...]:
        """What the next run must say."""
        return tuple(self._by_kind.values())


def unplanned_rate(rate_hz: float, planned_hz: float) -> str:
    """What to say of a rate that is not the planned one; empty where it is, or where none was planned (0)."""
    if not planned_hz or abs(rate_hz / planned_hz - 1.0) <= _SAME_RATE:
        return ""
    return (
        f"The hardware samples at {rate_hz:g} Hz where {planned_hz:g} Hz were planned. Times "
        "use the rate that was read back. Check that the modules are the ones of the rig file"
    )
