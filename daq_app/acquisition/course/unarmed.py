"""Releases that nobody armed: which events say so, and when such a recording gives way to the next test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from daq_app.acquisition.course.sequence import Sequence as Course
from daq_app.acquisition.messages.published import State
from daq_app.rocking.motion.phases import PhaseEvent

KEPT_BEFORE_S: Final = 60.0
"""How much lies before such a release in its run, as far as the rig's ring_s allows, s."""
SETTLE_S: Final = 2.0
"""Time within which the first impact follows a release from any level (half a second from 0.40 α), s."""


def from_the_release(events: Sequence[PhaseEvent], *, doubtful: bool) -> Sequence[PhaseEvent]:
    """The events from the one on that says that the wall was released; empty where none does.

    Beside a sensor that has just failed (`doubtful`) a leap of the rotation is no release yet: the first
    impact says that it was one, and the ring still has what came before.
    """
    for place, event in enumerate(events):
        if event.kind == "impact" or (event.kind == "release" and not doubtful):
            return events[place:]
    return ()


def gives_way(course: Course | None, sample: int, rate_hz: float) -> bool:
    """Whether a test may be armed: nothing is recorded, or what nobody armed and no impact followed."""
    if course is None:
        return True
    released = course.release_sample
    if course.armed or course.state is not State.RELEASED or released is None:
        return False
    return sample - released > SETTLE_S * rate_hz
