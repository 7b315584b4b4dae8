"""What a session does when the hardware fails under it: kept samples, counted gaps, clear words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.messages.published import (
    Call,
    EventMessage,
    HealthMessage,
    State,
    StateMessage,
)
from daq_app.acquisition.pipeline.reader import Patience
from daq_app.runfile import open_run, verify
from drivers import Block, DriverError

Lives = Callable[..., Any]


def overwritten() -> DriverError:
    return DriverError("Samples were overwritten", advice="Nothing to do", code=-200279, recoverable=True)


def gone(**more: Any) -> DriverError:
    return DriverError("The module is gone", advice="Plug it in", code=-201003, **more)


def test_lost_samples_are_a_gap_with_its_range_and_its_reason(live: Lives, wall_test: Any) -> None:
    lab = live()
    lab.zero_and_arm()
    lab.driver.fail_at(20_000, overwritten(), lose=1234)
    lab.driver.let(wall_test.n_samples)
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    with open_run(Path(saved.run_path)) as run:
        (gap,) = run.gaps
        assert (gap.first_sample, gap.n_samples) == (20_000, 1234)
        assert "overwritten" in gap.reason
        inside = run.readings(None, 20_000 - run.first_sample, 21_234 - run.first_sample)
        assert np.isnan(inside).all(), "a gap is never filled"
        after = run.readings(None, 21_234 - run.first_sample, 24_000 - run.first_sample)
        assert np.array_equal(after, wall_test.readings[:, 21_234:24_000])
        assert run.derived is not None
        assert run.derived.results["quality"]["verdict"] == "bad"
        assert "1234 samples are missing" in run.derived.results["quality"]["reasons"][0]
    assert verify(saved.run_path).lost_samples == 1234
    told = [m for m in lab.heard if isinstance(m, EventMessage) and m.kind == "gap"]
    assert told[0].severity == "error" and "1234 samples lost from sample 20000" in told[0].text
    last = [m for m in lab.heard if isinstance(m, HealthMessage) and m.recording][-1]
    assert (last.gaps, last.lost_samples) == (1, 1234)


def test_a_network_that_comes_back_costs_nothing_and_is_told(live: Lives, wall_test: Any) -> None:
    lab = live()
    lab.zero_and_arm()
    away = DriverError("The server cannot be reached", advice="Check the network", recoverable=True)
    lab.driver.fail_recovery(away, away, away)
    lab.driver.fail_at(20_000, away)
    lab.driver.let(wall_test.n_samples)
    saved = lab.wait_for_state(State.SAVED, State.FAILED)
    with open_run(Path(saved.run_path)) as run:
        assert run.gaps == ()
        texts = [event.text for event in run.events if event.kind == "driver"]
    assert "cannot be reached" in texts[0]
    assert "Reading goes on" in texts[1]


def test_an_armed_wall_is_not_to_be_released_while_no_samples_come(live: Lives, wall_test: Any) -> None:
    """The last rotation is an old one: it tells nobody how far to pull."""
    lab = live(patience=Patience(read_timeout_s=0.05))
    lab.zero_and_arm()
    lab.driver.let(wall_test.release_sample - 400)
    lab.wait_for_state(State.HOLDING)
    silent = lab.wait_for(
        lambda m: isinstance(m, StateMessage) and m.judgement.call is Call.DO_NOT_RELEASE and m.armed
    )
    assert "no samples" in silent.judgement.do and silent.judgement.ratio is None
    lab.driver.let(wall_test.n_samples)
    assert lab.wait_for_state(State.SAVED, State.FAILED).state is State.SAVED


@pytest.mark.parametrize("way", ["fatal", "never comes back"])
def test_a_device_that_is_gone_ends_the_run_with_all_that_was_read(
    live: Lives, wall_test: Any, plan: Any, way: str
) -> None:
    patience = Patience(read_timeout_s=0.05, reconnect_limit_s=0.1, retry_pause_s=0.01)
    lab = live(patience=patience)
    lab.zero_and_arm()
    last = Block(20_000, np.ascontiguousarray(wall_test.readings[:, 20_000:20_123]), 0, 0)
    if way == "fatal":
        lab.driver.fail_at(20_000, gone(partial=last))
    else:
        lab.driver.fail_recovery(*[gone(recoverable=True)] * 10_000)
        lab.driver.fail_at(20_000, gone(partial=last, recoverable=True))
    lab.driver.let(wall_test.n_samples)
    state = lab.wait_for_state(State.SAVED, State.FAILED)
    assert state.state is State.FAILED
    assert "The module is gone" in state.text and "Plug it in" in state.text
    with open_run(Path(state.run_path)) as run:
        end = run.first_sample + run.n_samples
        assert end == 20_123, "what had been read before the failure is kept, to the last sample"
        assert np.array_equal(run.readings(), wall_test.readings[:, run.first_sample : end])
        assert [e.data["outcome"] for e in run.events if e.kind == "end"] == ["failed"]
    assert lab.driver.closed == 1, "the hardware is given back"
    assert not lab.ask("arm", test="FR1-L3-2").ok


def test_after_a_failure_the_preview_starts_again(live: Lives, wall_test: Any) -> None:
    lab = live()
    lab.driver.fail_at(4000, gone())
    lab.driver.let(8000)
    assert "module is gone" in lab.wait_for_state(State.FAILED).text
    assert lab.ask("preview").ok
    lab.wait_for_state(State.PREVIEWING)
    assert lab.driver.opened == 2
    lab.zero_and_arm()
    lab.driver.let(wall_test.n_samples)
    assert lab.wait_for_state(State.SAVED, State.FAILED).state is State.SAVED


def test_silence_is_an_alarm_within_a_second_and_ends_when_samples_come(live: Lives) -> None:
    lab = live()
    lab.zero_and_arm()
    # The stage gives nothing more by itself. On a busy machine a silence may have begun and ended before.
    lab.wait_for_event("alarm", severity="error", alarm="silence")
    lab.driver.let(lab.driver._allowed + 4000)
    lab.wait_for_event("alarm", severity="info", alarm="silence")


def test_silence_for_too_long_ends_the_run_in_good_order(live: Lives) -> None:
    # Long enough for a busy machine to take a zero and an order to arm.
    lab = live(patience=Patience(read_timeout_s=0.02, silence_limit_s=5.0))
    lab.zero_and_arm()
    lab.driver.let(12_000)
    state = lab.wait_for_state(State.FAILED)
    assert "No samples for" in state.text
    assert verify(state.run_path).ok


def test_hardware_that_cannot_be_opened_is_told_and_can_be_tried_again(live: Lives) -> None:
    lab = live()
    lab.driver.refuse_to_open = gone()
    lab.driver.fail_at(0, gone())
    lab.driver.let(400)
    lab.wait_for_state(State.FAILED)
    assert lab.ask("preview").ok
    assert "module is gone" in lab.wait_for_state(State.FAILED).text
    lab.driver.refuse_to_open = None
    assert lab.ask("preview").ok
    lab.wait_for_state(State.PREVIEWING)


def test_the_same_error_without_any_progress_is_not_repeated_for_ever(live: Lives) -> None:
    lab = live()
    lab.zero_and_arm()
    for _ in range(100):
        lab.driver.fail_at(8000, overwritten())
    lab.driver.let(40_000)
    assert "overwritten" in lab.wait_for_state(State.FAILED).text


def test_what_saves_runs_is_loaded_once_the_device_is_open(
    live: Lives, finaliser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, it would take the processor from what the device waits for."""
    loads: list[str] = []
    monkeypatch.setattr(finaliser, "warm", lambda: loads.append("loads"))
    live(refusal=gone())
    assert loads == []
    live()
    assert loads == ["loads"]
