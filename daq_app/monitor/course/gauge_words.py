"""What stands beside every gauge: the recorder's words, and the seconds that are still to be held."""

from __future__ import annotations

import math

from daq_app.acquisition.messages.published import Call, MotionMessage
from daq_app.monitor.data.session import Session


def countdown_s(session: Session) -> int | None:
    """Seconds that the wall is still to be held; None while nothing is counted."""
    judgement = session.judgement
    left_s = judgement.hold_s - judgement.held_s
    counts = judgement.call is Call.HOLD and judgement.held_s > 0 and left_s > 0
    return math.ceil(left_s) if counts else None


def gauge_words(session: Session) -> str:
    """The recorder's words, or that the rotation is not live."""
    return session.judgement.gauge if session.fresh(MotionMessage) else "The rotation is not live"
