"""What a run says of itself: as planned or to be repeated; and sensors at the end of their travel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.closing.derive import derive
from daq_app.acquisition.course.sensors.channel_watch import ChannelWatch
from daq_app.acquisition.course.sensors.overload import OverloadWatch
from daq_app.config import Scaling
from daq_app.runfile import CheckRecord, JournalWriter, RunHeader, TestPlan, read_journal
from drivers import Block

Judged = Callable[[TestPlan | None], dict[str, Any]]


@pytest.fixture
def judged(tmp_path: Path, rig: Any, rig_text: str, wall_test: Any) -> Judged:
    """The verdict on the staged test, released at θ0/α = 0.35 towards +x, under a plan."""

    def judge(plan: TestPlan | None) -> dict[str, Any]:
        header = RunHeader(
            run_id="x",
            rig_text=rig_text,
            channel_ids=rig.channel_ids,
            reading_units=tuple(channel.reading_unit for channel in rig.channels),
            rate_hz=4000.0,
            test_plan=plan,
        )
        path = tmp_path / "x.journal"
        with JournalWriter(path, header) as writer:
            for start in range(0, wall_test.n_samples, 4000):
                writer.append_block(start, wall_test.readings[:, start : start + 4000])
            writer.append_event("released", wall_test.release_sample, "released")
            writer.append_event("end", wall_test.n_samples, "done", {"outcome": "complete"})
        with read_journal(path) as contents:
            derived, said = derive(contents)
        path.unlink()
        assert derived is not None, said
        return dict(derived.results["quality"])

    return judge


def test_a_test_as_planned_is_good(judged: Judged) -> None:
    check = CheckRecord(verdict="go")
    zero = "2026-11-25T09:00:00+00:00"
    plan = TestPlan(test="FR1-L3-1", theta0_over_alpha=0.35, side="+x", check=check, zero_utc=zero)
    found = judged(plan)
    assert found["verdict"] == "good"
    left_out = ("planned", "checked", "no zero")
    assert not any(word in reason for reason in found["reasons"] for word in left_out)


@pytest.mark.parametrize(
    ("plan", "reason"),
    [
        (TestPlan(theta0_over_alpha=0.15), "planned 0.150 within 5 %"),
        (TestPlan(theta0_over_alpha=0.38), "planned 0.380 within 5 %"),
        (TestPlan(theta0_over_alpha=0.35, side="-x"), "planned towards −x"),
    ],
)
def test_another_test_than_was_planned_is_repeated_with_the_reason(
    judged: Judged, plan: TestPlan, reason: str
) -> None:
    found = judged(plan)
    assert found["verdict"] == "repeat"
    assert reason in found["reasons"][0]


def test_a_check_or_zero_that_was_overruled_or_left_out_is_noted(judged: Judged) -> None:
    no_go = CheckRecord(verdict="no-go", summary="2 of 41 channels must be mended.", overruled=True)
    found = judged(TestPlan(theta0_over_alpha=0.35, check=no_go))
    assert found["verdict"] == "good"
    assert any("in spite of" in reason and "2 of 41" in reason for reason in found["reasons"])
    left_out = " ".join(judged(TestPlan())["reasons"])
    assert "not checked" in left_out and "no zero was taken" in left_out


def test_a_sensor_at_the_end_of_its_travel_is_called_so_and_not_stuck(rig: Any) -> None:
    row = next(n for n, channel in enumerate(rig.channels) if channel.family == "lvdt")
    channel = rig.channels[row]
    si = at_rest(rig, 8000)
    si[row, 2000:] = channel.range_si[1]
    ranges = {channel.id: channel.input_range_v for channel in rig.channels}
    watch = ChannelWatch(rig, 4000.0, ranges)
    told, at_end = told_of(rig, si)
    readings = Scaling.of(rig.channels).to_readings(si)
    doubts = []
    for first, ends in zip(range(0, 8000, 400), at_end, strict=True):
        block = Block(first, readings[:, first : first + 400], 0, 0)
        doubts += watch.check(block, moving=False, at_end=ends)
    low, high = (f"{1e3 * end:g}".replace("-", "−") for end in channel.range_si)
    assert [(news.kind, news.severity) for news in told] == [("travel", "warning")]
    assert told[0].text.startswith(f"End of travel: {channel.id} ({low} to {high} mm)")
    assert not [doubt for doubt in doubts if doubt.name == "stuck"]


def test_a_sensor_that_is_back_within_its_travel_is_told_so_once_it_stays_there(rig: Any) -> None:
    """A wall that rocks brings it to its stop again and again: one warning, and one end of it."""
    row = next(n for n, channel in enumerate(rig.channels) if channel.family == "wire")
    channel = rig.channels[row]
    si = at_rest(rig, 40_000)
    for stop in range(4000, 16_000, 4000):
        si[row, stop : stop + 2000] = channel.range_si[0]
    told, _ = told_of(rig, si)
    assert [(news.kind, news.severity) for news in told] == [("travel", "warning"), ("travel", "info")]
    assert channel.id in told[1].text and "-" not in told[0].text.replace(channel.id, "")


def test_a_new_run_says_again_who_stands_at_the_end_of_its_travel(rig: Any) -> None:
    row = next(n for n, channel in enumerate(rig.channels) if channel.family == "lvdt")
    si = at_rest(rig, 8000)
    si[row] = rig.channels[row].range_si[1]
    told, _ = told_of(rig, si, forget_at=4000)
    assert [news.severity for news in told] == ["warning", "warning"]


def at_rest(rig: Any, n_samples: int) -> Any:
    """Noise of every channel, SI."""
    si = np.random.default_rng(1).normal(size=(len(rig.channels), n_samples))
    return si * np.array([channel.noise_si for channel in rig.channels])[:, None]


def told_of(rig: Any, si: Any, forget_at: int = -1) -> tuple[list[Any], list[Any]]:
    """What the watch tells of these quantities, and who is at its end in each block of 400 samples."""
    ranges = {channel.id: channel.input_range_v for channel in rig.channels}
    watch = OverloadWatch(rig.channels, ranges, 4000.0)
    readings = Scaling.of(rig.channels).to_readings(si)
    told, at_end = [], []
    for first in range(0, si.shape[1], 400):
        if first == forget_at:
            watch.forget()
        watch.check(Block(first, readings[:, first : first + 400], 0, 0))
        told += watch.news()
        at_end.append(watch.at_end)
    return told, at_end
