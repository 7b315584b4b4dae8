"""One judgement of the moment: what the operator is told to do, and every word that goes with it.

The call is decided once, from the most urgent condition to the least; word, sentence, gauge and alarm are
written from the call, so that no two of them can contradict each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from daq_app.acquisition.messages.published import Call, Judgement, State, Tone
from daq_app.config.rig import Acquisition
from daq_app.config.wording import true_minus
from daq_app.runfile import TestPlan

PULLED: Final = 0.03
"""|θ|/α from which a wall counts as pulled: a zeroed wall leans by less than a hundredth of α."""
_MOVING: Final = frozenset({State.RELEASED, State.ROCKING})


@dataclass(frozen=True, slots=True)
class Situation:
    """All that a judgement is made from."""

    state: State
    sampling: bool
    armed: bool
    plan: TestPlan
    rotation_rad: float
    """From the tiltmeters; NaN where it is not known."""
    alpha_rad: float
    steady: bool
    """The wall is held still."""
    held_s: float
    """Since when, s."""
    disk_safe: bool
    """Samples of the run reach a disk."""
    opening: bool = False
    """Nothing is sampled yet: the device is being opened and started."""
    goes_back: bool = False
    """The wall moves back towards upright as one that is let go or lowered."""
    silent: bool = False
    """Samples should come in, and none has for a second: the rotation is an old one."""
    aborted: bool = False
    """The last arming was given up before its release."""
    text: str = ""
    """What the state says of itself; shown after a test and after a failure."""

    @property
    def on_target(self) -> bool:
        """Whether a target is planned and the rotation, which is known, lies within its tolerance."""
        band = self.plan.band
        return band is not None and band[0] <= abs(self.rotation_rad) / self.alpha_rad <= band[1]


def judge(situation: Situation, settings: Acquisition) -> Judgement:
    """The judgement of a situation."""
    if situation.silent:
        situation = replace(situation, rotation_rad=math.nan)
    ratio = abs(situation.rotation_rad) / situation.alpha_rad
    call = _call(situation, settings, ratio)
    band = situation.plan.band
    held_s = situation.held_s if call in (Call.HOLD, Call.RELEASE, Call.DO_NOT_RELEASE) else 0.0
    do = _sentence(call, situation, settings, held_s)
    return Judgement(
        call=call,
        word=_word(call, situation),
        do=do,
        tone=_tone(call, situation),
        gauge=_gauge(call, situation, ratio),
        alarm=do if call in _ALARMS else "",
        ratio=round(ratio, 5) if math.isfinite(ratio) else None,
        target=situation.plan.theta0_over_alpha,
        low=band[0] if band else None,
        high=band[1] if band else None,
        held_s=math.floor(10 * held_s) / 10,
        hold_s=settings.hold_s,
    )


_ALARMS: Final = frozenset({Call.STOP, Call.ARM_FIRST, Call.DO_NOT_RELEASE, Call.OTHER_SIDE})


def _call(now: Situation, settings: Acquisition, ratio: float) -> Call:
    if now.state in _MOVING:
        return Call.KEEP_CLEAR
    if now.state is State.AT_REST:
        return Call.WAIT
    if now.sampling and ratio >= settings.alarm_ratio:
        return Call.STOP
    if now.armed:
        return Call.DO_NOT_RELEASE if now.silent else _armed_call(now, settings, ratio)
    if now.sampling and ratio >= PULLED:
        return Call.ARM_FIRST
    if now.state is State.SAVING or _starts(now):
        return Call.WAIT
    if now.state in (State.SAVED, State.FAILED) and not now.aborted:
        return Call.LOOK
    if now.silent:
        return Call.WAIT
    return Call.PREPARE if now.sampling else Call.START


def _starts(now: Situation) -> bool:
    """Whether samples will come without anybody's order."""
    return now.opening and not now.sampling


def _armed_call(now: Situation, settings: Acquisition, ratio: float) -> Call:
    """Between arming and release."""
    band = now.plan.band
    if not math.isfinite(ratio):
        return Call.HOLD if now.steady else Call.PULL
    if ratio >= PULLED and not now.plan.side_of(now.rotation_rad):
        return Call.OTHER_SIDE
    if ratio < (band[0] if band else PULLED):
        # A fall is known to be a release only after a third of it; it is no wall to be pulled before.
        return Call.KEEP_CLEAR if now.goes_back else Call.PULL
    if band and ratio > band[1]:
        return Call.EASE_BACK
    if not now.disk_safe:
        return Call.DO_NOT_RELEASE
    return Call.RELEASE if now.steady and now.held_s >= settings.hold_s else Call.HOLD


_WORDS: Final[dict[State, str]] = {
    State.IDLE: "Idle",
    State.PREVIEWING: "Live view",
    State.ARMED: "Armed",
    State.HOLDING: "Holding",
    State.RELEASED: "Released",
    State.ROCKING: "Rocking",
    State.AT_REST: "At rest",
    State.SAVING: "Saving",
    State.SAVED: "Saved",
    State.FAILED: "Failed",
}


_WAITS: Final[dict[State, str]] = {
    State.AT_REST: "Leave the wall alone: its rest is being recorded.",
    State.SAVING: "The record is being checked and written.",
}
"""States that end by themselves."""
_LOOK_AT: Final = "Look at the chassis, its power and its network."


def _word(call: Call, now: Situation) -> str:
    if call is Call.ARM_FIRST:
        return "Not armed"
    if call is Call.STOP:
        return "Stop"
    if call is Call.KEEP_CLEAR and now.state not in _MOVING:
        return "Going back"
    if now.state in _MOVING and not now.armed:
        return f"{_WORDS[now.state]}, not armed"
    if now.state is not State.SAVING and _starts(now):
        return "Starting"
    if call is Call.WAIT and now.silent and now.state not in _WAITS:
        return "No samples"
    if now.aborted and now.state is State.SAVED:
        return "Aborted"
    return _WORDS[now.state]


_SENTENCES: Final[dict[Call, str]] = {
    Call.START: "No sensor is read. Start the live view (F4).",
    Call.PREPARE: "Nothing is recorded but the ring of the last minutes. Choose, zero, check, then arm (F5).",
    Call.EASE_BACK: "Too far: ease the wall back into the band.",
    Call.STOP: "STOP: near overturning. Ease the wall back.",
    Call.DO_NOT_RELEASE: "Do not release: nothing reaches the disk now.",
    Call.ARM_FIRST: "Not armed. Do not release: arm first (F5), or lower the wall.",
}
"""The calls whose sentence is the same in every situation."""


def _sentence(call: Call, now: Situation, settings: Acquisition, held_s: float) -> str:
    match call:
        case Call.OTHER_SIDE:
            return f"Wrong side: this test is planned towards {true_minus(now.plan.side)}. Lower the wall."
        case Call.PULL if now.plan.band is None:
            return "Pull the wall as far as this test asks: no target is planned."
        case Call.PULL:
            return "Pull the wall to its target rotation."
        case Call.HOLD:
            left_s = math.ceil(max(0.0, settings.hold_s - held_s))
            hold = "On target: hold still" if now.on_target else "Hold still"
            return f"{hold}{f', {left_s} s more' if now.steady and left_s else ''}."
        case Call.RELEASE:
            return "Held still on target. Release." if now.on_target else "Held still. Release."
        case Call.KEEP_CLEAR if now.state not in _MOVING:
            return "The wall goes back: keep clear until it stands."
        case Call.KEEP_CLEAR if not now.armed:
            return "Keep clear. Nobody had armed: this release is kept from the ring."
        case Call.KEEP_CLEAR:
            return "Keep clear. The recording ends by itself."
        case Call.WAIT if now.state is not State.SAVING and _starts(now):
            return "The sensors are being started: wait for the live view."
        case Call.WAIT if now.state in _WAITS:
            return _WAITS[now.state]
        case Call.WAIT:
            return f"No samples come in. {_LOOK_AT}"
        case Call.DO_NOT_RELEASE if now.silent:
            return f"Do not release: no samples come in. {_LOOK_AT}"
        case Call.LOOK:
            return now.text or "Look at the result, then take the next test (F6)."
    return _SENTENCES[call]


def _tone(call: Call, now: Situation) -> Tone:
    if call is Call.LOOK:
        return "bad" if now.state is State.FAILED else "good"
    tones: dict[Call, Tone] = {
        Call.START: "muted",
        Call.PREPARE: "accent",
        Call.PULL: "text",
        Call.EASE_BACK: "warning",
        Call.OTHER_SIDE: "bad",
        Call.STOP: "bad",
        Call.HOLD: "good",
        Call.DO_NOT_RELEASE: "bad",
        Call.RELEASE: "good",
        Call.ARM_FIRST: "bad",
        Call.KEEP_CLEAR: "bad" if not now.armed else "warning",
        Call.WAIT: "accent",
    }
    return tones[call]


_GAUGE_WORDS: Final[dict[Call, str]] = {
    Call.OTHER_SIDE: "Wrong side",
    Call.STOP: "STOP: ease back",
    Call.DO_NOT_RELEASE: "Hold: do not release",
    Call.RELEASE: "Release",
    Call.ARM_FIRST: "Not armed",
}


def _gauge(call: Call, now: Situation, ratio: float) -> str:
    """Beside the gauge's figure: how far, in words that go with the call."""
    band, alpha = now.plan.band, now.alpha_rad
    missing_mrad = 1e3 * alpha * ((now.plan.theta0_over_alpha or 0.0) - ratio)
    match call:
        case Call.PULL if not math.isfinite(ratio):
            return "The rotation is not known"
        case Call.PULL if band:
            return f"Pull {missing_mrad:.1f} mrad more"
        case Call.PULL:
            return "No target is planned"
        case Call.EASE_BACK:
            return f"{-missing_mrad:.1f} mrad too far: ease back"
        case Call.HOLD:
            return "On target: hold" if now.on_target else "Hold still"
        case Call.KEEP_CLEAR if now.state not in _MOVING:
            return "Going back"
    return _GAUGE_WORDS.get(call, "")
