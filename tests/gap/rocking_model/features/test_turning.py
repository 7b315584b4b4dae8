"""What wires at both ends of the wall show of its turning about the vertical."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.run_features import extract
from daq_app.gap.rocking_model.records import GapRun
from tests.support.simulated_wall import simulate

TURN_S = 2e-3


@pytest.fixture(scope="module")
def plain() -> GapRun:
    (run,) = simulate({}, (0.35,))
    return run


def _turns(run: GapRun) -> np.ndarray:
    (block,) = [block for block in extract(run).blocks if block.family == "turn"]
    return np.asarray(block.values)


def _with(run: GapRun, wire: str, moved_m: np.ndarray) -> GapRun:
    changed = run.channels.copy()
    changed[next(i for i, sensor in enumerate(run.sensors) if sensor.id == wire)] += moved_m
    return replace(run, channels=changed)


def test_impacts_of_one_side_that_turn_the_wall_a_little_are_seen(plain: GapRun) -> None:
    seen = extract(plain)
    time_s = np.arange(plain.channels.shape[1]) / plain.rate_hz - seen.swings.release_s
    turned = np.zeros_like(time_s)
    for at_s, speed in zip(seen.grid.impact_s, seen.grid.approach, strict=True):
        if speed < 0.0:
            turned[time_s > at_s] += TURN_S * abs(speed)
    run = plain
    for sensor in plain.sensors:
        if sensor.family == "wire" and sensor.position_m[1]:
            run = _with(run, sensor.id, -sensor.position_m[1] * turned)
    assert np.mean(_turns(run)) == pytest.approx(TURN_S / 2.0, rel=0.15)
    assert abs(np.mean(_turns(plain))) < 0.05 * TURN_S


def test_play_of_a_wire_and_a_zero_that_walks_are_no_turning(plain: GapRun) -> None:
    seen = extract(plain)
    time_s = np.arange(plain.channels.shape[1]) / plain.rate_hz - seen.swings.release_s
    side = np.zeros_like(time_s)
    for at_s, speed in zip(seen.grid.impact_s, seen.grid.approach, strict=True):
        side[time_s > at_s] = np.sign(speed)
    played = _turns(_with(plain, "WP-5", 3e-4 * side))
    assert abs(np.mean(played)) < 0.05 * TURN_S
    walked = _turns(_with(plain, "WP-5", 2e-5 * np.maximum(time_s, 0.0)))
    assert abs(np.mean(walked)) < 0.05 * TURN_S


def test_a_wall_with_wires_in_one_plane_says_nothing_of_its_turning(plain: GapRun) -> None:
    ends = tuple(s.id for s in plain.sensors if s.family == "wire" and s.position_m[1])
    assert not [block for block in extract(plain.excluding(ends)).blocks if block.family == "turn"]
