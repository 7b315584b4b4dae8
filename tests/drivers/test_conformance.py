"""One suite over every driver: what `drivers.protocol.Driver` promises, each of them keeps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from daq_app.config import TaskPlan
from drivers import Block, Driver, DriverError, ReplayDriver, open_driver

KINDS = ("fr1", "fr1-iepe", "fr1-pxie", "replay")


class Recorded:
    """A recording whose samples tell their channel and their index."""

    def __init__(self, channel_ids: tuple[str, ...], rate_hz: float, n_samples: int) -> None:
        self.channel_ids = channel_ids
        self.rate_hz = rate_hz
        self.n_samples = n_samples

    def readings(
        self, ids: tuple[str, ...] | None = None, start: int = 0, stop: int | None = None
    ) -> NDArray[np.float64]:
        rows = [self.channel_ids.index(name) for name in ids or self.channel_ids]
        stop = self.n_samples if stop is None else stop
        return np.array([[0.01 * (row + 1)] for row in rows]) + 0.01 * np.arange(start, stop) / self.rate_hz


@dataclass
class Subject:
    """A driver under test and what its readings must be."""

    driver: Driver
    plan: TaskPlan
    expect: Callable[[int, NDArray[np.int_]], NDArray[np.float64]]
    """(row, sample indices) → reading."""
    tolerance: Callable[[int], float]


@pytest.fixture(params=KINDS)
def subject(request: pytest.FixtureRequest, laboratory: Callable[[str], Any]) -> Iterator[Subject]:
    kind: str = request.param
    lab = laboratory("fr1" if kind == "replay" else kind)
    channels = lab.rig.channels
    planned = {item.rig_index: item for task in lab.plan.tasks for item in task.channels}

    def volts_per_reading(row: int) -> float:
        # IEPE and native LVDT channels are scaled by NI: to m/s², and to m (volts per volt of excitation).
        return 1.0 if channels[row].measurement == "voltage" else channels[row].sensitivity_v_per_si

    def expect(row: int, samples: NDArray[np.int_]) -> NDArray[np.float64]:
        time_s = samples / lab.plan.rate_hz + planned[row].time_offset_s
        return (0.01 * (row + 1) + 0.01 * time_s) / volts_per_reading(row)

    def tolerance(row: int) -> float:
        return 4e-4 / volts_per_reading(row)  # a step of a 16-bit converter over ±10 V, and a little

    if kind == "replay":
        clock = FakeClock()
        recording = Recorded(lab.rig.channel_ids, lab.plan.rate_hz, 40_000)
        driver: Driver = ReplayDriver(recording, 1.0, clock=clock.now, sleep=clock.sleep)
        yield Subject(
            driver,
            lab.plan,
            lambda row, samples: 0.01 * (row + 1) + 0.01 * samples / lab.plan.rate_hz,
            lambda row: 1e-12,
        )
    else:
        driver = open_driver(lab.connection)
        yield Subject(driver, lab.plan, expect, tolerance)
    driver.close()


class FakeClock:
    """Time that passes only by sleeping."""

    def __init__(self) -> None:
        self._now = 0.0

    def now(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += seconds


def read_blocks(driver: Driver, count: int) -> list[Block]:
    return [driver.read(5.0) for _ in range(count)]


def test_opening_tells_what_the_hardware_made_of_the_plan(subject: Subject) -> None:
    opened = subject.driver.open(subject.plan)
    assert opened.rate_hz == pytest.approx(subject.plan.rate_hz, rel=1e-9)
    assert set(opened.ranges) == set(subject.plan.channel_ids)
    assert all(low < high for low, high in opened.ranges.values())
    assert opened.buffer_samples >= 2 * subject.plan.read_samples
    assert opened.driver


def test_blocks_follow_each_other_without_a_hole(subject: Subject) -> None:
    subject.driver.open(subject.plan)
    subject.driver.start()
    expected = 0
    for block in read_blocks(subject.driver, 12):
        assert block.first_sample == expected
        assert block.readings.shape[0] == subject.plan.n_channels
        assert block.n_samples >= subject.plan.read_samples
        assert block.readings.dtype == np.float64
        assert block.readings.flags.c_contiguous
        assert block.backlog_samples >= 0
        expected += block.n_samples


def test_short_reads_lose_nothing_and_bring_no_more_than_asked_for(subject: Subject) -> None:
    subject.driver.open(subject.plan)
    subject.driver.start()
    short = subject.plan.read_samples // 4
    expected, sizes = subject.driver.read(5.0).n_samples, []
    while sizes.count(short) < 3:
        block = subject.driver.read(5.0, short)
        samples = expected + np.arange(block.n_samples)
        assert block.first_sample == expected
        assert np.abs(block.readings[0] - subject.expect(0, samples)).max() <= subject.tolerance(0)
        expected += block.n_samples
        sizes.append(block.n_samples)
        assert len(sizes) < 100, sizes  # more at once only where samples have piled up
    assert subject.driver.read(5.0).n_samples >= subject.plan.read_samples


def test_every_row_holds_its_own_channel_at_its_own_time(subject: Subject) -> None:
    subject.driver.open(subject.plan)
    subject.driver.start()
    blocks = read_blocks(subject.driver, 3)
    readings = np.concatenate([block.readings for block in blocks], axis=1)
    samples = np.arange(readings.shape[1])
    for row in range(subject.plan.n_channels):
        wrong = np.abs(readings[row] - subject.expect(row, samples)).max()
        assert wrong <= subject.tolerance(row), (subject.plan.channel_ids[row], wrong)


def test_a_time_out_can_be_repeated_and_loses_nothing(subject: Subject) -> None:
    subject.driver.open(subject.plan)
    subject.driver.start()
    got = 0
    time_outs = 0
    while got < 4 * subject.plan.read_samples:
        try:
            block = subject.driver.read(0.03)  # a read period is 0.1 s
        except DriverError as error:
            assert error.retryable
            assert error.advice
            time_outs += 1
            assert time_outs < 100
            if error.partial is None:
                continue
            block = error.partial
        assert block.first_sample == got
        samples = got + np.arange(block.n_samples)
        assert np.abs(block.readings[0] - subject.expect(0, samples)).max() <= subject.tolerance(0)
        got += block.n_samples
    assert time_outs > 0


def test_stop_and_start_begin_again_at_sample_zero(subject: Subject) -> None:
    subject.driver.open(subject.plan)
    subject.driver.start()
    read_blocks(subject.driver, 2)
    subject.driver.stop()
    subject.driver.start()
    assert subject.driver.read(5.0).first_sample == 0


def test_closing_is_safe_at_any_time_and_twice(subject: Subject) -> None:
    subject.driver.close()
    subject.driver.close()


def test_reading_before_opening_is_an_error_that_says_so(subject: Subject) -> None:
    with pytest.raises(DriverError) as caught:
        subject.driver.read(0.1)
    assert not caught.value.retryable
    assert "open" in str(caught.value)
