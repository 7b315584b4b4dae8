"""When something must be heard: what an operator who looks at the wall would otherwise miss. Without Qt."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Final

from daq_app.acquisition.messages.published import RECORDING, Call, State
from daq_app.monitor.data.session import Session

REPEAT_S: Final = 3.0
"""What endangers wall or record is said again after so long, until it is over."""
_HELD: Final = frozenset({Call.HOLD, Call.RELEASE})
_FREE: Final = frozenset({State.RELEASED, State.ROCKING})


class Cue(StrEnum):
    """What is heard."""

    ON_TARGET = "on target"
    ALARM = "alarm"
    RELEASED = "released"
    AT_REST = "at rest"
    RECORDING_LOST = "recording lost"


class CueWatch:
    """Compares each look at a session with the one before."""

    def __init__(self) -> None:
        self._call: Call | None = None
        self._state: State | None = None
        self._was_on_disk = False
        """Samples of the run under way have reached the disk."""
        self._said_s: dict[Cue, float] = {}

    def look(self, session: Session) -> list[Cue]:
        """What is to be heard now, the most urgent first. Nothing at the first look: it is no change."""
        state, judgement = session.current_state, session.judgement
        first = self._state is None and self._call is None
        if state in RECORDING:
            self._was_on_disk |= session.recording_on_disk
        elif state is not None:
            self._was_on_disk = False
        lost = self._was_on_disk and not session.recording_on_disk
        cues = self._repeated(Cue.RECORDING_LOST, lost, session.clock())
        cues += self._repeated(Cue.ALARM, bool(judgement.alarm) and state not in _FREE, session.clock())
        if state is None:
            return cues
        if not first:
            if state in _FREE and self._state not in _FREE:
                cues.append(Cue.RELEASED)
            if state is State.AT_REST and self._state is not State.AT_REST:
                cues.append(Cue.AT_REST)
            on_target = judgement.call in _HELD and judgement.target is not None
            if on_target and self._call not in _HELD:
                cues.append(Cue.ON_TARGET)
        self._state, self._call = state, judgement.call
        return cues

    def _repeated(self, cue: Cue, holds: bool, now_s: float) -> list[Cue]:
        """The cue as it begins, and every `REPEAT_S` while it holds."""
        if not holds:
            self._said_s.pop(cue, None)
            return []
        if now_s - self._said_s.get(cue, -math.inf) < REPEAT_S:
            return []
        self._said_s[cue] = now_s
        return [cue]
