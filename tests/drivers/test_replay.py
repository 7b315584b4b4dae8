"""The replay of a recording: its pace, its gaps, its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import TaskPlan, load_rig, plan_tasks
from drivers import DriverError, ReplayDriver


class Recording:
    """Every reading is its sample's index; `gaps` are NaN."""

    rate_hz = 4000.0

    def __init__(self, channel_ids: tuple[str, ...], n_samples: int, gaps: list[tuple[int, int]]) -> None:
        self.channel_ids = channel_ids
        self.n_samples = n_samples
        self._values = np.arange(float(n_samples))
        for first, end in gaps:
            self._values[first:end] = np.nan

    def readings(
        self, ids: tuple[str, ...] | None = None, start: int = 0, stop: int | None = None
    ) -> NDArray[np.float64]:
        return np.tile(self._values[start:stop], (len(ids or self.channel_ids), 1))


class Clock:
    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds


@pytest.fixture
def plan(configs: Path) -> TaskPlan:
    return plan_tasks(load_rig(configs / "fr1.toml"))


def replay(
    plan: TaskPlan, n_samples: int, gaps: list[tuple[int, int]], speed: float = 1.0
) -> tuple[ReplayDriver, Clock]:
    clock = Clock()
    driver = ReplayDriver(Recording(plan.channel_ids, n_samples, gaps), speed, clock=clock, sleep=clock.sleep)
    driver.open(plan)
    driver.start()
    return driver, clock


def read_to_the_end(driver: ReplayDriver) -> dict[int, float]:
    """Sample index → reading."""
    found: dict[int, float] = {}
    while True:
        try:
            block = driver.read(10.0)
        except DriverError as error:
            assert "ended" in error.message
            assert not error.retryable and not error.recoverable
            return found
        for offset, value in enumerate(block.readings[0]):
            assert block.first_sample + offset not in found
            found[block.first_sample + offset] = value


@pytest.mark.parametrize(
    "gaps", [[], [(500, 501)], [(0, 900)], [(399, 401), (800, 1200)], [(1900, 2050)], [(10, 20), (30, 2049)]]
)
def test_what_is_there_is_played_and_what_is_missing_stays_a_gap(
    plan: TaskPlan, gaps: list[tuple[int, int]]
) -> None:
    driver, _ = replay(plan, 2050, gaps)
    found = read_to_the_end(driver)
    missing = {index for first, end in gaps for index in range(first, end)}
    assert set(found) == set(range(2050)) - missing
    assert all(found[index] == index for index in found)


@pytest.mark.parametrize("speed", [0.5, 1.0, 20.0])
def test_the_pace_is_the_recordings_times_the_speed(plan: TaskPlan, speed: float) -> None:
    driver, clock = replay(plan, 8000, [], speed)
    read_to_the_end(driver)
    assert clock.time == pytest.approx(2.0 / speed, rel=1e-6)


def test_a_reader_that_was_late_finds_a_backlog(plan: TaskPlan) -> None:
    driver, clock = replay(plan, 8000, [])
    clock.time = 1.0
    assert driver.read(1.0).backlog_samples == 3600


def test_a_run_of_another_rig_is_refused_by_name(plan: TaskPlan) -> None:
    driver = ReplayDriver(Recording(plan.channel_ids[:-2], 100, []))
    with pytest.raises(DriverError) as caught:
        driver.open(plan)
    assert all(name in str(caught.value) for name in plan.channel_ids[-2:])


@pytest.mark.parametrize("speed", [0.0, -1.0])
def test_a_speed_that_is_none(plan: TaskPlan, speed: float) -> None:
    with pytest.raises(ValueError, match="speed"):
        ReplayDriver(Recording(plan.channel_ids, 100, []), speed)
