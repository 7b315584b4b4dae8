"""A release that nobody armed: it is recorded from before it, said aloud, and recovered after a kill."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.closing.finalise_worker import ring_job
from daq_app.acquisition.closing.finaliser import Finaliser, Finished
from daq_app.acquisition.messages.items import Arrived
from daq_app.acquisition.messages.published import Call, State
from daq_app.acquisition.pipeline.ring import Ring, ring_sessions
from daq_app.config import Scaling
from daq_app.rocking import RotationGeometry
from daq_app.runfile import RunHeader, open_run, verify
from drivers import Block

Lives = Callable[..., Any]
RATE_HZ = 4000


def zero(lab: Any) -> None:
    """Take the zero upright, without arming."""
    lab.driver.let(3200)
    asking = threading.Thread(target=lambda: lab._ask_apart("tare"))
    asking.start()
    while asking.is_alive():
        lab.driver.let(lab.driver._allowed + 400)
        asking.join(0.02)


def test_a_release_without_arming_is_a_run_of_its_own(live: Lives, wall_test: Any) -> None:
    lab = live()
    zero(lab)
    lab.driver.let(wall_test.n_samples)
    released = lab.wait_for_state(State.RELEASED)
    assert not released.armed
    assert "Nobody had armed" in released.judgement.do
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    assert saved.state is State.SAVED, saved.text
    assert any(getattr(m, "severity", "") == "error" and "nobody had armed" in m.text for m in lab.heard)
    assert Path(saved.run_path).name.startswith("unarmed_")
    assert verify(saved.run_path).ok
    with open_run(Path(saved.run_path)) as run:
        first, end = run.first_sample, run.first_sample + run.n_samples
        assert first <= wall_test.release_sample - 5 * RATE_HZ
        assert end >= wall_test.rest_sample
        assert np.array_equal(run.readings(), wall_test.readings[:, first:end]), "every sample, bit by bit"
        assert run.gaps == ()
        assert run.header.test_plan is None
        assert run.header.kept is not None and run.header.kept["ring"] == lab.session.ring.session
        assert run.header.tare, "with the zero that was in force"
        kinds = [event.kind for event in run.events]
        assert "released" in kinds and "at_rest" in kinds and "armed" not in kinds
        assert run.derived.results["analysis"]["estimates"]["crt"]["r"] == pytest.approx(0.7, abs=0.01)


def test_while_it_is_recorded_arming_is_refused_and_stop_ends_it(live: Lives, wall_test: Any) -> None:
    lab = live()
    zero(lab)
    lab.driver.let(wall_test.release_sample + 6000)
    lab.wait_for_state(State.ROCKING)
    assert "recorded already" in lab.ask("arm", test="FR1-L3-1").text
    assert lab.ask("stop").ok
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        assert [e.data["outcome"] for e in run.events if e.kind == "end"] == ["stopped"]


def test_an_order_to_arm_just_after_the_release_takes_the_whole_of_it(live: Lives, wall_test: Any) -> None:
    lab = live()
    zero(lab)
    lab.driver.let(wall_test.release_sample + 400)
    lab.wait_for(lambda m: getattr(m, "sample", 0) >= wall_test.release_sample)
    reply = lab.ask("arm", test="FR1-L3-1")
    assert reply.ok, reply.text
    lab.driver.let(wall_test.n_samples)
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        assert run.header.test == "FR1-L3-1"
        assert run.first_sample <= wall_test.release_sample - 4 * RATE_HZ
        assert {"released", "rocking", "at_rest"} <= {event.kind for event in run.events}


def armed_after_a_slip(lab: Any, wall_test: Any) -> Path:
    """The journal of a test armed after the rope slipped: the wall fell back a little, and is held."""
    slips = wall_test.readings[:, : wall_test.release_sample + 1500]
    held = wall_test.readings[:, wall_test.release_sample - 4 * RATE_HZ : wall_test.release_sample]
    caught = np.tile(held - held.mean(axis=1, keepdims=True), 2) + slips[:, -1:]
    lab.driver._wall = type(wall_test)(
        np.hstack([slips, caught]), wall_test.release_sample, wall_test.rest_sample, wall_test.theta0_rad
    )
    zero(lab)
    lab.driver.let(wall_test.release_sample + 4 * RATE_HZ)
    lab.wait_for_state(State.RELEASED)
    lab.wait_for(lambda m: getattr(m, "first_sample", 0) >= wall_test.release_sample + 3 * RATE_HZ)
    reply = lab.ask("arm", test="FR1-L3-1")
    assert reply.ok, reply.text
    return Path(str(reply.data["journal"]))


def test_what_looked_like_a_release_and_had_no_impact_gives_way_to_the_next_test(
    live: Lives, wall_test: Any
) -> None:
    lab = live()
    folder = armed_after_a_slip(lab, wall_test).parent
    assert lab.wait_for_state(State.ARMED, State.HOLDING).test == "FR1-L3-1"
    assert list(folder.glob("unarmed_*")), "what was recorded is kept"


def test_saved_is_said_of_the_test_that_is_over_and_not_of_one_before_it(
    live: Lives, wall_test: Any, finaliser: Finaliser, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run before is packed so slowly that the test is over first."""
    slow = threading.Event()
    submit = finaliser.submit

    def submit_slowly(job: dict[str, str], then: Callable[[Finished], None]) -> Future[Finished]:
        def told(finished: Finished) -> None:
            assert slow.wait(60.0)
            then(finished)

        return submit(job, told)

    monkeypatch.setattr(finaliser, "submit", submit_slowly)
    lab = live()
    journal = armed_after_a_slip(lab, wall_test)
    lab.driver.let(wall_test.release_sample + 5 * RATE_HZ)
    lab.wait_for(lambda m: getattr(m, "first_sample", 0) >= wall_test.release_sample + 4.5 * RATE_HZ)
    assert lab.ask("stop").ok
    lab.wait_for(lambda m: getattr(m, "state", None) is State.SAVING and m.test == "FR1-L3-1")
    slow.set()
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    assert Path(saved.run_path).stem == journal.stem
    before = [m for m in lab.heard if getattr(m, "kind", "") == "saved"]
    assert any("unarmed" in event.data["run"] for event in before), "the one before is told as an event"


def test_a_wall_that_was_never_held_still_is_recorded_and_ended_too(live: Lives, wall_test: Any) -> None:
    """A rope that breaks during the pull."""
    held = slice(wall_test.release_sample - 5 * RATE_HZ - 2400, wall_test.release_sample)
    readings = np.delete(wall_test.readings, np.r_[held], axis=1)
    shift = held.stop - held.start
    broken = type(wall_test)(
        readings, wall_test.release_sample - shift, wall_test.rest_sample - shift, wall_test.theta0_rad
    )
    lab = live()
    lab.driver._wall = broken
    zero(lab)
    lab.driver.let(broken.n_samples)
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        kinds = [event.kind for event in run.events]
        assert "released" in kinds and "at_rest" in kinds
        assert run.first_sample + run.n_samples > broken.rest_sample


def test_a_pulled_wall_that_is_not_armed_is_said_and_nobody_is_told_to_release(
    live: Lives, wall_test: Any
) -> None:
    lab = live()
    zero(lab)
    plan = lab.ask("plan", test="FR1-L3-1", theta0_over_alpha=0.35)
    assert plan.ok, plan.text
    lab.driver.let(wall_test.release_sample - RATE_HZ)
    state = lab.wait_for(lambda m: getattr(getattr(m, "judgement", None), "call", None) is Call.ARM_FIRST)
    assert state.judgement.word == "Not armed"
    assert state.judgement.alarm
    assert "hold" not in state.judgement.gauge.lower()


def header(rig: Any, rig_text: str, run_id: str) -> RunHeader:
    return RunHeader(
        run_id=run_id,
        rig_text=rig_text,
        channel_ids=rig.channel_ids,
        reading_units=tuple(channel.reading_unit for channel in rig.channels),
        rate_hz=float(RATE_HZ),
        start_utc_ns=1_700_000_000_000_000_000,
    )


def left_ring(folder: Path, rig: Any, rig_text: str, readings: Any) -> Ring:
    """The ring of a recorder that was killed after these readings."""
    ring = Ring(folder, 60 * RATE_HZ, lambda run_id: header(rig, rig_text, run_id))
    ring.start()
    for first in range(0, readings.shape[1] - 399, 400):
        ring.put(Arrived(Block(first, readings[:, first : first + 400], 0, 0), 0.0))
    ring.close(keep=True)
    return ring


def test_a_release_in_the_ring_of_a_killed_recorder_becomes_a_run(
    tmp_path: Path, rig: Any, rig_text: str, wall_test: Any
) -> None:
    end = wall_test.release_sample + 4000
    left_ring(tmp_path, rig, rig_text, wall_test.readings[:, :end])
    (place,) = ring_sessions(tmp_path)
    done = ring_job(place, tmp_path)
    assert done.ok and "nobody had armed" in done.text, done.text
    with open_run(Path(done.path)) as run:
        assert run.first_sample + run.n_samples == end
        assert np.array_equal(run.readings(), wall_test.readings[:, run.first_sample : end])
        assert "released" in [event.kind for event in run.events]
    assert not ring_sessions(tmp_path)
    assert not list(tmp_path.glob("*.journal"))


def test_a_ring_without_a_release_leaves_nothing(
    tmp_path: Path, rig: Any, rig_text: str, wall_test: Any
) -> None:
    left_ring(tmp_path, rig, rig_text, wall_test.readings[:, : wall_test.release_sample - 8000])
    (place,) = ring_sessions(tmp_path)
    done = ring_job(place, tmp_path)
    assert (done.ok, done.text) == (True, "")
    assert not list(tmp_path.rglob("*"))


def test_a_lowered_wall_is_no_release(tmp_path: Path, rig: Any, rig_text: str, wall_test: Any) -> None:
    """Pulled, held, and let down by hand over two seconds."""
    held = wall_test.readings[:, wall_test.release_sample - 16_000 : wall_test.release_sample]
    upright = wall_test.readings[:, :8000]
    down = np.linspace(0.0, 1.0, 8000)
    lowering = held[:, -8000:] * (1.0 - down) + upright * down
    pulling = wall_test.readings[:, 16_000 : wall_test.release_sample - 16_000]
    left_ring(tmp_path, rig, rig_text, np.concatenate([upright, pulling, held, lowering, upright], axis=1))
    (place,) = ring_sessions(tmp_path)
    assert ring_job(place, tmp_path).text == ""


def test_a_release_that_a_run_has_already_is_not_made_twice(
    tmp_path: Path, rig: Any, rig_text: str, wall_test: Any
) -> None:
    end = wall_test.release_sample + 4000
    readings = wall_test.readings[:, :end]
    left_ring(tmp_path, rig, rig_text, readings)
    (place,) = ring_sessions(tmp_path)
    copy = {path.name: path.read_bytes() for path in place.iterdir()}
    assert ring_job(place, tmp_path).text
    place.mkdir(parents=True)
    for name, content in copy.items():
        (place / name).write_bytes(content)
    assert ring_job(place, tmp_path).text == ""
    assert len(list(tmp_path.glob("unarmed_*.h5"))) == 1


def test_plan_check_and_zero_are_in_the_run_and_locked_while_armed(live: Lives, rig: Any) -> None:
    lab = live()
    given = {"test": "FR1-L3-1", "level": "L3", "theta0_over_alpha": 0.35, "side": "+x", "operator": "Ada"}
    assert lab.ask("plan", **given).ok
    lab.zero_and_arm("FR1-L3-1")
    refused = lab.ask("plan", test="FR1-L4-1", theta0_over_alpha=0.40)
    assert not refused.ok and "locked" in refused.text
    state = lab.wait_for(lambda m: getattr(m, "locked", False))
    assert (state.plan.theta0_over_alpha, state.plan.operator) == (0.35, "Ada")
    assert state.judgement.target == 0.35
    assert lab.ask("abort").ok
    saved = lab.wait_for_state(State.SAVED)
    with open_run(Path(saved.run_path)) as run:
        plan = run.header.test_plan
        assert plan is not None
        assert (plan.level, plan.side, plan.specimen) == ("L3", "+x", rig.specimen.name)
        assert plan.zero_utc == run.header.tare_record["taken_utc"]
        assert json.loads(run.header.model_dump_json())["test_plan"]["check"] is None


def test_the_geometry_of_the_staged_wall_is_what_these_tests_think(rig: Any, wall_test: Any) -> None:
    wires = RotationGeometry.from_rig(rig).wires
    row = rig.channel_ids.index(wires.ids[0])
    si = Scaling.of(rig.channels).to_si(wall_test.readings)[row]
    assert abs(si[wall_test.release_sample - 400]) > 20 * abs(si[:4000]).max()
