"""A whole test through reader, recorder, analyst and viewer, from preview to the saved run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.messages.published import (
    EstimateMessage,
    EventMessage,
    HealthMessage,
    State,
    StateMessage,
)
from daq_app.runfile import open_run, verify
from drivers import DriverError

Lives = Callable[..., Any]


def states_of(heard: list[Any]) -> list[State]:
    """The states in order, repetitions left out."""
    found: list[State] = []
    for message in heard:
        if isinstance(message, StateMessage) and (not found or found[-1] is not message.state):
            found.append(message.state)
    return found


def test_a_release_is_recorded_whole_and_by_itself(live: Lives, wall_test: Any) -> None:
    lab = live()
    journal = lab.zero_and_arm()
    lab.driver.let(wall_test.n_samples)
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    assert saved.state is State.SAVED, saved.text
    assert states_of(lab.heard) == [
        State.PREVIEWING,
        State.ARMED,
        State.HOLDING,
        State.RELEASED,
        State.ROCKING,
        State.AT_REST,
        State.SAVING,
        State.SAVED,
    ]
    assert not journal.exists(), "a journal goes once its run is proven"
    assert verify(saved.run_path).ok
    with open_run(Path(saved.run_path)) as run:
        assert run.header.test == "FR1-L3-1"
        assert run.gaps == ()
        first, end = run.first_sample, run.first_sample + run.n_samples
        assert first <= wall_test.release_sample - 5 * 4000, "at least 5 s before the release are kept"
        assert end >= wall_test.rest_sample + 0.5 * 4000
        assert np.array_equal(run.readings(), wall_test.readings[:, first:end]), "every sample, bit by bit"
        kinds = [event.kind for event in run.events]
        for kind in ("armed", "holding", "released", "impact", "rocking", "at_rest", "end"):
            assert kind in kinds, kinds
        (ended,) = [event for event in run.events if event.kind == "end"]
        assert ended.data["outcome"] == "complete"
        (released,) = [event for event in run.events if event.kind == "released"]
        assert abs(released.sample - wall_test.release_sample) < 40
    estimates = [message for message in lab.heard if isinstance(message, EstimateMessage)]
    assert estimates[-1].theta0_rad == pytest.approx(wall_test.theta0_rad, rel=0.005)
    assert estimates[-1].crt_mean == pytest.approx(0.7, abs=0.01)


def test_no_word_asks_for_a_pull_once_the_wall_is_let_go(live: Lives, wall_test: Any) -> None:
    """A release is known with certainty only after a third of the fall."""
    lab = live()
    lab.zero_and_arm(theta0_over_alpha=0.35)
    for end in range(lab.driver._allowed, wall_test.release_sample + 4000, 400):
        lab.driver.let(end)  # block by block, as on a quick machine
        lab.wait_for(lambda m, end=end: isinstance(m, HealthMessage) and m.sample >= end)
    lab.wait_for_state(State.ROCKING)
    states = [message for message in lab.heard if isinstance(message, StateMessage)]
    before = [m.judgement.gauge for m in states if m.sample <= wall_test.release_sample]
    after = [m.judgement for m in states if m.sample > wall_test.release_sample]
    assert any("mrad more" in gauge for gauge in before) and before[-1] == "Release"
    assert not [said for said in after if "mrad more" in said.gauge or "Pull" in said.do]
    assert "Going back" in [said.word for said in after]


def test_samples_come_in_small_pieces_only_while_the_wall_moves(live: Lives, wall_test: Any) -> None:
    """An r waits at most for the end of the block that its impact lies in."""
    lab = live()
    lab.zero_and_arm()

    def sizes_up_to(sample: int, since: int) -> set[int]:
        """What the reads in between gave, without the one that was waited for when it became otherwise."""
        lab.driver.let(sample)
        lab.wait_for(lambda message: isinstance(message, HealthMessage) and message.sample > sample - 400)
        return {size for first, size in lab.driver.sizes.items() if since + 400 <= first < sample - 400}

    moving, resting = wall_test.release_sample + 3200, wall_test.rest_sample + 6400
    assert sizes_up_to(moving, 0) == {400}
    lab.wait_for_state(State.RELEASED)
    assert sizes_up_to(moving + 4000, moving) == {80}
    lab.driver.let(resting)
    lab.wait_for_state(State.SAVING)
    assert sizes_up_to(wall_test.n_samples, resting) == {400}


def test_health_tells_what_is_on_disk(live: Lives, wall_test: Any) -> None:
    lab = live()
    lab.zero_and_arm()
    lab.driver.let(24_000)

    def all_safe(message: Any) -> bool:
        return isinstance(message, HealthMessage) and message.acknowledged_sample >= 24_000

    health = lab.wait_for(all_safe)
    assert health.recording
    assert health.sample >= 24_000
    assert health.lost_samples == 0
    assert health.free_bytes > 0
    assert health.file_bytes > 41 * 8 * 10_000
    assert health.block_to_disk_ms_p99 > 0.0


def test_an_aborted_arming_is_kept_and_burns_no_test(live: Lives) -> None:
    lab = live()
    lab.zero_and_arm("FR1-L1-1")
    lab.driver.let(16_000)
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.acknowledged_sample >= 16_000)
    assert lab.ask("abort").ok
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    with open_run(Path(saved.run_path)) as run:
        (ended,) = [event for event in run.events if event.kind == "end"]
        assert ended.data["outcome"] == "aborted"
        assert run.n_samples >= 4000
    # The same name can be armed again and gets a file of its own.
    again = lab.ask("arm", test="FR1-L1-1")
    assert again.ok, again.text
    lab.driver.let(18_000)
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.acknowledged_sample >= 18_000)
    assert lab.ask("abort").ok
    other = lab.wait_for_state(State.SAVED)
    assert other.run_path != saved.run_path
    assert Path(saved.run_path).exists() and Path(other.run_path).exists()


def test_an_arming_that_is_aborted_at_once_keeps_the_seconds_before_it(live: Lives, rig: Any) -> None:
    lab = live()
    lab.zero_and_arm("FR1-L1-1")
    assert lab.ask("abort").ok
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    assert saved.state is State.SAVED
    if saved.judgement.word != "Aborted":
        # Saving took longer than samples may be missing: it is said once there are samples again.
        assert saved.judgement.word == "No samples"
        lab.driver.let(lab.driver._allowed + 400)
        lab.wait_for(lambda m: isinstance(m, StateMessage) and m.judgement.word == "Aborted")
    with open_run(Path(saved.run_path)) as run:
        assert 0 < run.n_samples <= rig.acquisition.pre_trigger_s * 4000 + 800
    assert not list(lab.folder.glob("*.journal"))


def test_the_next_test_can_be_armed_while_the_last_is_still_being_saved(live: Lives) -> None:
    lab = live()
    lab.zero_and_arm("FR1-L1-1")
    lab.driver.let(12_000)
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.acknowledged_sample >= 12_000)
    assert lab.ask("stop").ok
    lab.wait_for_state(State.SAVING)
    reply = lab.ask("arm", test="FR1-L1-2")
    assert reply.ok, reply.text
    lab.wait_for_event("saved", test="FR1-L1-1")
    state = lab.wait_for(lambda m: isinstance(m, StateMessage))
    assert (state.state, state.test) == (State.ARMED, "FR1-L1-2")


def test_after_the_release_a_test_is_stopped_not_aborted(live: Lives, wall_test: Any) -> None:
    lab = live()
    lab.zero_and_arm()
    lab.driver.let(wall_test.release_sample + 5000)
    lab.wait_for_state(State.ROCKING)
    refused = lab.ask("abort")
    assert not refused.ok
    assert "stop" in refused.text
    assert lab.ask("stop").ok
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        assert [e.data["outcome"] for e in run.events if e.kind == "end"] == ["stopped"]


def test_a_wall_that_never_rests_ends_at_the_longest_duration(live: Lives, rig: Any, wall_test: Any) -> None:
    # The stage ends before 20 s after the release: shorten the limit instead.
    lab = live()
    quick = rig.acquisition.model_copy(update={"max_duration_s": 5.0, "post_rest_s": 60.0})
    lab.session.analyst._rig = rig.model_copy(update={"acquisition": quick})
    lab.zero_and_arm()
    # Stop before the rest is certain, then repeat motion samples: the wall rocks on and on.
    lab.driver._wall = _endless(wall_test)
    lab.driver.let(lab.driver._wall.n_samples)
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        assert [e.data["outcome"] for e in run.events if e.kind == "end"] == ["timeout"]


def _endless(wall_test: Any) -> Any:
    """The first half-cycles after the release, over and over."""
    release = wall_test.release_sample
    motion = wall_test.readings[:, release : release + 6000]
    there_and_back = np.concatenate([motion, motion[:, ::-1]], axis=1)
    readings = np.concatenate([wall_test.readings[:, :release], *[there_and_back] * 4], axis=1)
    return type(wall_test)(readings, release, wall_test.rest_sample, wall_test.theta0_rad)


def test_markers_and_notes_are_in_the_run(live: Lives) -> None:
    lab = live()
    lab.zero_and_arm()
    assert lab.ask("marker", text="cable checked").ok
    assert lab.ask("note", text="wind from the door").ok
    lab.driver.let(12_000)
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.acknowledged_sample >= 12_000)
    lab.ask("abort")
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        texts = {event.kind: event.text for event in run.events}
    assert texts["marker"] == "cable checked"
    assert texts["note"] == "wind from the door"


def test_the_zero_and_what_was_subtracted_are_in_the_run(live: Lives, wall_test: Any, rig: Any) -> None:
    lab = live()
    lab.zero_and_arm()
    lab.driver.let(12_000)
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.acknowledged_sample >= 12_000)
    lab.ask("abort")
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        tare, record = run.header.tare, run.header.tare_record
        start = int(record["first_sample"])
        row = rig.channel_ids.index("WP-1")
        mean = wall_test.readings[row, start : start + int(record["n_samples"])].mean()
        assert tare["WP-1"] + rig.channels[row].offset == pytest.approx(mean)
    assert set(tare) == set(rig.channel_ids)
    assert record["taken_utc"]


def test_a_zero_with_the_wall_pulled_is_refused_in_words(live: Lives) -> None:
    lab = live()
    lab.driver.let(26_000)  # pulled and held by now
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.sample == 26_000)
    import threading

    replies: list[Any] = []
    asking = threading.Thread(target=lambda: replies.append(lab._ask_apart("tare")))
    asking.start()
    while asking.is_alive():
        lab.driver.let(lab.driver._allowed + 400)
        asking.join(0.02)
    assert not replies[0].ok
    assert "leaning" in replies[0].text and "upright" in replies[0].text


@pytest.mark.parametrize("name", ["", "../evil", "a/b", "x" * 200, "FR1 L3", "con\n"])
def test_names_that_cannot_be_files_are_refused(live: Lives, name: str) -> None:
    lab = live()
    lab.driver.let(4000)
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.sample >= 4000)
    reply = lab.ask("arm", test=name)
    assert not reply.ok
    assert "name" in reply.text


def test_requests_that_do_not_fit_the_state_are_refused_in_words(live: Lives) -> None:
    lab = live()
    for name in ("stop", "abort"):
        reply = lab.ask(name)
        assert not reply.ok and "No test is being recorded" in reply.text
    lab.zero_and_arm()
    assert "already" in lab.ask("arm", test="FR1-L3-2").text
    assert "zero cannot change" in lab.ask("tare").text
    assert "no command" in lab.ask("dance").text


def test_events_reach_the_viewer_with_their_severity(live: Lives) -> None:
    lab = live()
    lab.zero_and_arm()
    message = lab.wait_for_event("armed")
    assert isinstance(message, EventMessage)
    assert message.severity == "info"


def test_the_second_recorder_runs_from_arming_to_the_end(live: Lives) -> None:
    lab = live()
    journal = lab.zero_and_arm()
    lab.driver.let(lab.driver._allowed + 800)
    assert f"{journal.stem}.tdms" in lab.wait_for_event("backup").text
    lab.ask("abort")
    lab.wait_for_state(State.SAVED)
    lab.driver.let(lab.driver._allowed + 800)
    lab.wait_for(lambda m: lab.driver.backups == [journal.stem, "stop"])


def test_a_second_recorder_that_fails_is_told_and_costs_the_first_nothing(live: Lives) -> None:
    lab = live()
    lab.driver.refuse_backup = DriverError("No such folder on the server", advice="Choose another")
    lab.zero_and_arm()
    lab.driver.let(16_000)
    told = lab.wait_for_event("backup")
    assert told.severity == "error" and "No such folder" in told.text
    lab.wait_for(lambda m: isinstance(m, HealthMessage) and m.acknowledged_sample >= 16_000)
