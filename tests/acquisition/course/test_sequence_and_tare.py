"""The course of a test as pure logic, and the zero: what is taken, what is refused and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.acquisition.course.sequence import Change, Sequence
from daq_app.acquisition.course.tare import NotSteady, take_tare
from daq_app.acquisition.messages.items import End
from daq_app.acquisition.messages.published import State
from daq_app.config import Rig
from daq_app.config.rig import Acquisition
from daq_app.rocking import PhaseEvent

RATE = 4000.0
SETTINGS = Acquisition(pre_trigger_s=5.0, post_rest_s=2.0, max_duration_s=10.0)
KINDS = ["hold", "hold_lost", "release", "caught", "impact", "rest"]


def event(kind: str, sample: float) -> PhaseEvent:
    return PhaseEvent(kind, sample, int(sample) + 20, 0.05, kind)


def run(*steps: tuple[str, float], until: float, release_within_s: float = 100.0) -> list[Change | End]:
    sequence = Sequence(SETTINGS, RATE, 0, release_within_s)
    found: list[Change | End] = []
    for kind, at_s in steps:
        found += sequence.advance([event(kind, at_s * RATE)], int(at_s * RATE))
    return found + sequence.advance([], int(until * RATE))


def outcome(found: list[Change | End]) -> str:
    (end,) = [item for item in found if isinstance(item, End)]
    assert found[-1] is end
    return end.outcome


def states(found: list[Change | End]) -> list[State]:
    return [item.state for item in found if isinstance(item, Change)]


def test_the_course_of_a_good_test() -> None:
    found = run(("hold", 3), ("release", 12), ("impact", 12.5), ("impact", 13), ("rest", 16), until=18)
    assert states(found) == [State.HOLDING, State.RELEASED, State.ROCKING, State.AT_REST]
    assert outcome(found) == "complete"


def test_the_end_waits_for_the_samples_after_the_rest() -> None:
    steps = [("hold", 3.0), ("release", 12.0), ("impact", 12.5), ("rest", 16.0)]
    assert not any(isinstance(item, End) for item in run(*steps, until=17.99))
    assert outcome(run(*steps, until=18.0)) == "complete"


def test_a_wall_let_down_again_stays_armed() -> None:
    found = run(("hold", 3), ("hold_lost", 9), ("hold", 20), ("release", 30), until=31)
    assert states(found) == [State.HOLDING, State.ARMED, State.HOLDING, State.RELEASED]


def test_a_wall_caught_in_its_fall_was_not_released() -> None:
    found = run(("hold", 3), ("release", 12), ("caught", 13), until=99)
    assert states(found)[-1] is State.ARMED
    assert not any(isinstance(item, End) for item in found)


def test_no_rest_within_the_longest_duration() -> None:
    assert outcome(run(("hold", 3), ("release", 12), ("impact", 13), until=22)) == "timeout"


def test_no_release_within_the_longest_wait_is_an_aborted_arming() -> None:
    assert outcome(run(("hold", 3), until=100)) == "aborted"


def test_a_release_too_soon_after_arming_is_told() -> None:
    found = run(("hold", 1), ("release", 4), until=4.1)
    (released,) = [item for item in found if isinstance(item, Change) and item.state is State.RELEASED]
    assert "only 4.0 s after arming" in released.text


@given(st.lists(st.tuples(st.sampled_from(KINDS), st.floats(0.01, 3.0)), max_size=30))
def test_whatever_the_detector_says_a_test_ends_once_and_in_time(steps: list[tuple[str, float]]) -> None:
    """Any order of events: at most one end, and one always comes."""
    sequence = Sequence(SETTINGS, RATE, 0, 100.0)
    ends: list[End] = []
    at_s = 0.0
    for kind, wait_s in [*steps, *[("nothing", 5.0)] * 40]:
        at_s += wait_s
        found = sequence.advance([event(kind, at_s * RATE)], int(at_s * RATE))
        ends += [item for item in found if isinstance(item, End)]
        if ends:
            break
    assert len(ends) == 1
    assert ends[0].outcome in ("complete", "timeout", "aborted")


# -- zero -------------------------------------------------------------------------------------------


@pytest.fixture
def upright(wall_test: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    return wall_test.readings[:, :4000].copy()


def test_the_zero_is_the_mean_beyond_the_certificate(rig: Rig, upright: Any) -> None:
    tare = take_tare(rig, upright, 100)
    for row, channel in enumerate(rig.channels):
        assert tare.readings[channel.id] + channel.offset == pytest.approx(upright[row].mean())
    assert tare.record["first_sample"] == 100 and tare.record["n_samples"] == 4000
    assert set(tare.record["scatter_si"]) == set(rig.channel_ids)


@pytest.mark.parametrize(
    ("channel", "change", "words"),
    [
        ("WP-1", lambda v, c: v + np.linspace(0, 10 * c.noise_si * gain(c), v.size), "drifts"),
        ("AC-3", lambda v, c: v + 40 * c.noise_si * gain(c) * np.sin(np.arange(v.size) / 13), "scatters"),
        ("LV-B05", lambda v, c: np.full(v.size, 9.99), "far from zero"),
        ("LV-A01", lambda v, c: np.full(v.size, np.nan), "no numbers"),
        ("TL-1X", lambda v, c: v + 0.03 * gain(c), "leaning"),
    ],
)
def test_each_reason_is_told_with_its_channel(
    rig: Rig, upright: Any, channel: str, change: Any, words: str
) -> None:
    row = rig.channel_ids.index(channel)
    upright[row] = change(upright[row], rig.channels[row])
    with pytest.raises(NotSteady) as caught:
        take_tare(rig, upright, 0)
    assert channel in str(caught.value) and words in str(caught.value)


def gain(channel: Any) -> float:
    return float(channel.sensitivity_reading_per_si)


def test_all_reasons_are_told_at_once(rig: Rig, upright: Any) -> None:
    for name in ("LV-A01", "LV-A02", "WP-3"):
        upright[rig.channel_ids.index(name)] = 9.99
    with pytest.raises(NotSteady) as caught:
        take_tare(rig, upright, 0)
    assert all(name in str(caught.value) for name in ("LV-A01", "LV-A02", "WP-3"))
