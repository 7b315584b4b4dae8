"""One voice: whatever the situation, no two words that the recorder says contradict each other."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq_app.acquisition.course.voice.judgement import PULLED, Situation, judge
from daq_app.acquisition.messages.published import Call, Judgement, State
from daq_app.config.rig import Acquisition
from daq_app.runfile import TestPlan

ALPHA = 0.215
SETTINGS = Acquisition()
plans = st.builds(
    TestPlan,
    theta0_over_alpha=st.one_of(st.none(), st.floats(0.05, 0.95)),
    tolerance=st.floats(0.005, 0.2),
    side=st.sampled_from(["", "+x", "-x"]),
)
situations = st.builds(
    Situation,
    state=st.sampled_from(State),
    sampling=st.booleans(),
    armed=st.booleans(),
    plan=plans,
    rotation_rad=st.one_of(st.floats(-ALPHA, ALPHA), st.just(math.nan)),
    alpha_rad=st.just(ALPHA),
    steady=st.booleans(),
    held_s=st.floats(0.0, 20.0),
    disk_safe=st.booleans(),
    aborted=st.booleans(),
    opening=st.booleans(),
    silent=st.booleans(),
    goes_back=st.booleans(),
)


def situation(**changed: object) -> Situation:
    known: dict[str, object] = {
        "state": State.ARMED,
        "sampling": True,
        "armed": True,
        "plan": TestPlan(test="FR1-L3-1", theta0_over_alpha=0.35, tolerance=0.05),
        "rotation_rad": 0.35 * ALPHA,
        "alpha_rad": ALPHA,
        "steady": True,
        "held_s": 10.0,
        "disk_safe": True,
    }
    return Situation(**{**known, **changed})  # type: ignore[arg-type]


def says(judgement: Judgement) -> str:
    return " ".join((judgement.word, judgement.do, judgement.gauge, judgement.alarm)).lower()


@settings(max_examples=1500, deadline=None)
@given(situations)
def test_no_two_words_contradict_each_other(now: Situation) -> None:
    judgement = judge(now, SETTINGS)
    said = says(judgement)
    ratio = abs(now.rotation_rad) / ALPHA
    moving = now.state in (State.RELEASED, State.ROCKING)
    told_to_release = said.replace("do not release", "").replace("this release", "")
    told_to_release = told_to_release.replace("released", "").count("release") > 0
    if moving:
        assert not re.search(r"\b(pull|hold|ease)\b", said)
        assert not judgement.gauge
    if told_to_release:
        assert now.armed and now.disk_safe and now.steady and not moving and not now.silent
        assert now.held_s >= SETTINGS.hold_s
        assert not judgement.alarm and "stop" not in said and "not armed" not in said
        if now.plan.band is not None and math.isfinite(ratio):
            assert now.plan.band[0] <= ratio <= now.plan.band[1]
        assert now.plan.side_of(now.rotation_rad) or not math.isfinite(ratio)
    if "stop" in said:
        assert not re.search(r"\b(pull|hold|holding|on target)\b", said)
    if "on target" in said:
        assert now.armed and not judgement.alarm
        assert now.plan.band is not None and now.plan.band[0] <= ratio <= now.plan.band[1]
        assert "pull" not in said and "ease back" not in said
    if now.goes_back and not now.silent and math.isfinite(ratio):
        assert not re.search(r"\bpull\b", said), "a wall that falls is not to be pulled"
    if now.plan.band is None:
        assert "target rotation" not in said
    pulled = now.sampling and not now.silent and ratio >= PULLED
    if not now.armed and now.state in (State.PREVIEWING, State.SAVED) and pulled:
        assert judgement.alarm, "a wall in the air that nobody armed is always an alarm"
    assert (judgement.target, judgement.low) == (
        now.plan.theta0_over_alpha,
        now.plan.band[0] if now.plan.band else None,
    )


def test_a_wall_held_on_its_target_long_enough_is_released() -> None:
    assert judge(situation(), SETTINGS).call is Call.RELEASE
    waiting = judge(situation(held_s=1.2), SETTINGS)
    assert (waiting.call, waiting.do) == (Call.HOLD, "On target: hold still, 2 s more.")


@pytest.mark.parametrize(
    ("changed", "call"),
    [
        ({"rotation_rad": 0.2 * ALPHA}, Call.PULL),
        ({"rotation_rad": 0.32 * ALPHA, "goes_back": True}, Call.KEEP_CLEAR),
        ({"rotation_rad": 0.42 * ALPHA}, Call.EASE_BACK),
        ({"rotation_rad": 0.7 * ALPHA}, Call.STOP),
        ({"disk_safe": False}, Call.DO_NOT_RELEASE),
        ({"silent": True}, Call.DO_NOT_RELEASE),
        ({"silent": True, "armed": False, "state": State.PREVIEWING}, Call.WAIT),
        ({"armed": False, "state": State.SAVED}, Call.ARM_FIRST),
        ({"armed": False, "state": State.SAVED, "rotation_rad": 0.0}, Call.LOOK),
        (
            {"plan": TestPlan(theta0_over_alpha=0.35, side="-x")},
            Call.OTHER_SIDE,
        ),
        ({"state": State.ROCKING, "rotation_rad": 0.9 * ALPHA}, Call.KEEP_CLEAR),
    ],
)
def test_the_most_urgent_condition_decides(changed: dict[str, object], call: Call) -> None:
    assert judge(situation(**changed), SETTINGS).call is call


def test_an_aborted_arming_is_not_called_saved() -> None:
    judgement = judge(situation(armed=False, state=State.SAVED, aborted=True, rotation_rad=0.001), SETTINGS)
    assert judgement.word == "Aborted"
    assert judgement.tone != "good"


def test_without_samples_no_old_rotation_is_judged() -> None:
    armed = judge(situation(silent=True), SETTINGS)
    assert armed.ratio is None and "no samples" in armed.alarm.lower() and "target" not in says(armed)
    idle = judge(situation(silent=True, armed=False, state=State.PREVIEWING), SETTINGS)
    assert (idle.word, idle.ratio) == ("No samples", None)
    assert judge(situation(silent=True, armed=False, state=State.SAVING), SETTINGS).word == "Saving"


def test_a_device_that_is_being_started_is_waited_for_without_a_key() -> None:
    idle = {"armed": False, "sampling": False, "rotation_rad": math.nan}
    for state in (State.IDLE, State.FAILED):
        starting = judge(situation(**idle, state=state, opening=True), SETTINGS)
        assert (starting.word, starting.call) == ("Starting", Call.WAIT)
        assert "F4" not in starting.do and "wait" in starting.do
    assert "F4" in judge(situation(**idle, state=State.IDLE), SETTINGS).do
    assert judge(situation(**idle, state=State.SAVING, opening=True), SETTINGS).word == "Saving"


def test_a_wall_that_falls_from_its_hold_is_never_told_to_be_pulled() -> None:
    """Until the detector is sure of the release the state is that of the hold."""
    going = judge(situation(state=State.HOLDING, rotation_rad=0.3 * ALPHA, goes_back=True), SETTINGS)
    assert (going.word, going.gauge) == ("Going back", "Going back")
    assert "keep clear" in going.do and not going.alarm
