"""Nothing is shown as live that is not: freshness, the recording light, the figures of a test."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.acquisition.messages.published import (
    BlockMessage,
    EstimateMessage,
    EventMessage,
    HealthMessage,
    MotionMessage,
    State,
    StateMessage,
)
from daq_app.monitor.data.session import Published, Session
from daq_app.monitor.look.labels import DASH, number, size_text
from daq_app.monitor.widgets.counters import tile_texts
from daq_app.monitor.window.health_bar import health_texts


@pytest.fixture
def session(clock, rig):
    session = Session(clock)
    session.set_rig(rig, 4000.0)
    return session


def test_a_value_is_live_for_half_a_second_and_then_a_dash(session, clock, stand_in, play):
    play(session, clock, stand_in, 3.0)
    assert tile_texts(session)["rotation"].value.endswith("mrad")
    clock.now += 0.49
    assert session.fresh(MotionMessage) and not session.data_missing
    clock.now += 0.02
    assert tile_texts(session)["rotation"].value == DASH
    assert tile_texts(session)["margin"].value == DASH
    assert session.data_missing
    assert math.isnan(session.overturning_margin)
    assert session.current_state is State.PREVIEWING
    clock.now += 3.0
    assert session.current_state is None


def test_the_figures_of_a_test_agree_with_the_motion(session, clock, stand_in, play, rig):
    play(session, clock, stand_in, stand_in.release_s + 4.0)
    texts = tile_texts(session)
    impacts = int(np.sum(stand_in.motion.impacts_s <= stand_in.release_s + 4.0))
    assert texts["impacts"].value == str(impacts)
    assert texts["peak"].value == "0.350"
    assert texts["elapsed"].value == "4.0 s"
    assert float(texts["eav"].value) == pytest.approx(0.895, abs=0.01)
    assert "r_max" in texts["crt"].detail
    theta = stand_in.rotation(np.array([session.trace.last_sample / 4000.0]))[0][0]
    assert session.rotation_rad == pytest.approx(theta, abs=1e-9)
    assert session.overturning_margin == pytest.approx(1 - abs(theta) / rig.specimen.alpha0_rad)


def test_before_a_zero_every_figure_is_made_from_the_same_rotation(session, clock, rig):
    """The wires alone, without a zero, stand 3 mrad beside the tiltmeters' level."""
    session.feed(Published(StateMessage(state=State.ARMED, armed=True), clock.now))
    motion = {"first_sample": 0, "step": 1, "rate_hz": 4000.0, "velocity_rad_s": [0.0]}
    moved = MotionMessage(**motion, rotation_rad=[0.033], judged_rad=0.030)
    session.feed(Published(moved, clock.now))
    texts = tile_texts(session)
    assert texts["rotation"].value == "30.0 mrad"
    assert session.judged_ratio == pytest.approx(0.030 / rig.specimen.alpha0_rad)
    assert session.overturning_margin == pytest.approx(1 - session.judged_ratio)
    assert session.peak_rotation_rad == pytest.approx(0.030)

    session.feed(Published(MotionMessage(**motion, rotation_rad=[0.033], judged_rad=math.nan), clock.now))
    texts = tile_texts(session)
    assert (texts["rotation"].value, texts["rotation"].detail) == (DASH, "not known")


def test_arming_forgets_the_estimate_of_the_last_test(session, clock, stand_in, play):
    play(session, clock, stand_in, stand_in.release_s + 2.0)
    session.feed(Published(StateMessage(state=State.SAVED), clock.now))
    assert session.estimate is not None
    session.feed(Published(StateMessage(state=State.ARMED, test="FR1-L3-3"), clock.now))
    assert session.estimate is None
    assert session.peak_rotation_rad == 0.0


@pytest.mark.parametrize("comes_later", [False, True])
def test_a_release_that_nobody_armed_counts_its_own_seconds(session, clock, comes_later):
    """Neither what is safe on disk nor the largest rotation is that of the test before."""
    session.adopt_past([EventMessage(kind="armed", sample=400, text="Armed for FR1-L3-3")])
    if not comes_later:
        session.feed(Published(StateMessage(state=State.ARMED, armed=True, since_sample=400), clock.now))
        moved = MotionMessage(
            first_sample=400, step=1, rate_hz=4000.0, rotation_rad=[0.1], velocity_rad_s=[0.0], judged_rad=0.1
        )
        session.feed(Published(moved, clock.now))
        session.feed(Published(StateMessage(state=State.SAVED), clock.now))
    for state in (State.RELEASED, State.ROCKING) if not comes_later else (State.ROCKING,):
        session.feed(Published(StateMessage(state=state, since_sample=800_000), clock.now))
    session.feed(Published(health(sample=812_000, acknowledged_sample=812_000), clock.now))
    assert session.safe_s == pytest.approx(3.0)
    assert session.peak_rotation_rad == 0.0


def test_a_wall_that_is_caught_goes_on_with_the_same_run(session, clock):
    for state, sample in ((State.ARMED, 400), (State.RELEASED, 40_000), (State.ARMED, 41_000)):
        session.feed(Published(StateMessage(state=state, armed=True, since_sample=sample), clock.now))
    session.feed(Published(health(sample=80_400, acknowledged_sample=80_400), clock.now))
    assert session.safe_s == pytest.approx(20.0)


def health(**changes):
    values = {
        "sample": 8000,
        "acknowledged_sample": 7600,
        "recording": True,
        "backlog_samples": 400,
        "buffer_samples": 80000,
        "gaps": 0,
        "lost_samples": 0,
        "free_bytes": 10**11,
    }
    return HealthMessage(**(values | changes))


@pytest.mark.parametrize(
    ("message", "age_s", "on_disk"),
    [
        (health(), 0.1, True),
        (health(), 0.6, False),
        (health(acknowledged_sample=0), 0.1, False),
        (health(recording=False), 0.1, False),
        (health(acknowledged_sample=1000), 0.1, False),
    ],
)
def test_the_recording_light_follows_the_disk_not_the_intention(session, clock, message, age_s, on_disk):
    session.feed(Published(StateMessage(state=State.ARMED), clock.now))
    session.feed(Published(message, clock.now))
    clock.now += age_s
    assert session.recording_on_disk is on_disk


def test_health_that_repeats_itself_goes_stale(session, clock):
    """A process whose reader hangs still says hello: the same sample number twice is no sign of life."""
    for _ in range(6):
        session.feed(Published(health(), clock.now))
        clock.now += 0.2
    assert not session.recording_on_disk


def test_restarted_tasks_start_the_plots_anew(session, clock, stand_in, play):
    play(session, clock, stand_in, 6.0)
    assert session.recent(1.0) is not None
    first = BlockMessage(first_sample=0, n_samples=400, n_channels=41, rate_hz=4000.0)
    session.feed(Published(first, clock.now, np.zeros((41, 400), dtype=np.float32)))
    assert session.recent(1.0) is None
    assert len(session.trace) == 0


def test_recent_data_never_spans_a_gap(session, clock):
    def block(first):
        heading = BlockMessage(first_sample=first, n_samples=400, n_channels=41, rate_hz=4000.0)
        session.feed(Published(heading, clock.now, np.full((41, 400), first, dtype=np.float32)))

    for first in (0, 400, 800, 1600, 2000):
        block(first)
    recent = session.recent(0.2)
    assert recent is not None and recent.shape == (41, 800)
    assert session.recent(0.25) is None


def test_margin_alarms_by_word_and_role(session, clock, rig):
    session.feed(Published(StateMessage(state=State.ARMED), clock.now))
    for ratio, role, word in ((0.3, "good", "alarm at"), (-0.55, "warning", "high"), (0.7, "bad", "ALARM")):
        theta = ratio * rig.specimen.alpha0_rad
        motion = MotionMessage(
            first_sample=round(clock.now * 4000),
            step=8,
            rate_hz=4000.0,
            rotation_rad=[theta],
            velocity_rad_s=[0.0],
            judged_rad=theta,
        )
        session.feed(Published(motion, clock.now))
        text = tile_texts(session)["margin"]
        assert (text.role, word in text.detail) == (role, True)
        clock.now += 0.1


def test_an_estimate_without_points_shows_no_r(session, clock):
    estimate = EstimateMessage(
        theta0_rad=0.07,
        release_sample=10,
        impact_samples=[20.0],
        peaks_rad=[0.07],
        impact_velocities_rad_s=[0.3],
        eav=[],
        crt=[],
        r_max=0.93,
    )
    session.feed(Published(estimate, clock.now))
    text = tile_texts(session)["eav"]
    assert (text.value, text.detail) == (DASH, "needs three impacts")


def test_health_figures_warn_in_words():
    bad = health(
        gaps=2, lost_samples=800, backlog_samples=60000, free_bytes=5 * 10**8, overloaded=("a", "b", "c")
    )
    texts = {text.caption: text for text in health_texts(bad, fresh=True)}
    assert (texts["Gaps"].value, texts["Gaps"].role) == ("2 (800 samples)", "bad")
    assert (texts["Buffer"].value, texts["Buffer"].role) == ("75 %", "bad")
    assert texts["Overload"].value == "a, b +1"
    assert texts["Free"].role == "bad"
    assert {text.value for text in health_texts(bad, fresh=False)} == {DASH}


def test_numbers_read_as_a_person_writes_them():
    assert number(-0.0004, 2) == "0.00"
    assert number(-1.256, 2, "mm") == "−1.26 mm"
    assert number(math.nan, 1) == DASH
    assert size_text(1.5e9) == "1.5 GB"
