"""What the recording light says: it follows the disk, not a button."""

from __future__ import annotations

from dataclasses import dataclass

from daq_app.acquisition.messages.published import RECORDING, Call, HealthMessage, State
from daq_app.monitor.data.session import Session


@dataclass(frozen=True, slots=True)
class Light:
    """Sign, colour (a name of `Colours`) and words of the light."""

    shape: str
    tone: str
    word: str
    detail: str = ""


def recording_light(session: Session) -> Light:
    """The light of this moment."""
    state = session.current_state
    if session.recording_on_disk:
        return Light("disc", "bad", "Recording", f"{session.safe_s:.1f} s safe on disk")
    if state in RECORDING and session.fresh(HealthMessage) and session.safe_s > 0:
        return Light("triangle", "warning", "Disk is slow", f"{session.unsafe_s:.1f} s wait for the disk")
    if state in RECORDING:
        return Light("triangle", "warning", "Not confirmed", "no sample confirmed on disk")
    if state is State.SAVED and session.judgement.word == "Aborted":
        return Light("ring", "muted", "Not recording", "the aborted arming is kept")
    # "On disk" beside "Not armed" would be read as if the wall that is pulled now were recorded.
    if state is State.SAVED and session.judgement.call is Call.LOOK:
        return Light("tick", "good", "On disk", "checked and closed")
    return Light("ring", "muted", "Not recording")
