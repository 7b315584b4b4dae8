"""What stands beside every gauge: the recorder's words, the target, and the seconds still to be held."""

from __future__ import annotations

import math

from daq_app.acquisition.messages.published import Call, MotionMessage
from daq_app.monitor.data.session import Session
from daq_app.monitor.look.state_look import name_of_test


def countdown_s(session: Session) -> int | None:
    """Seconds that the wall is still to be held; None while nothing is counted."""
    judgement = session.judgement
    left_s = judgement.hold_s - judgement.held_s
    counts = judgement.call is Call.HOLD and judgement.held_s > 0 and left_s > 0
    return math.ceil(left_s) if counts else None


def gauge_words(session: Session) -> str:
    """The recorder's words, or that the rotation is not live."""
    return session.judgement.gauge if session.fresh(MotionMessage) else "The rotation is not live"


def target_words(session: Session) -> str:
    """The target of the plan with its band, empty without one; it says so if it is the next test's.

    After a test the plan is already that of the next one, while state and name are still of the last.
    """
    message, judgement = session.state, session.judgement
    if message is None or judgement.target is None or judgement.low is None or judgement.high is None:
        return ""
    words = f"target {judgement.target:.2f}  ({judgement.low:.3f} to {judgement.high:.3f})"
    of_the_next = message.plan.test and message.plan.test != name_of_test(message)
    return f"next test {message.plan.test}: {words}" if of_the_next else words
