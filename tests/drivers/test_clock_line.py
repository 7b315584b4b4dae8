"""Which sample a clock would have reached: through jitter, late samples, standstills and leaps."""

from __future__ import annotations

import numpy as np
import pytest

from drivers import ClockReading
from drivers.ni.clock_line import ClockLine

RATE_HZ = 4000.0


def fed(
    until_s: float,
    *,
    speed: float = 1.0,
    skip_at: float = 1e9,
    held: tuple[float, float] = (1e9, 1e9),
    seed: int = 1,
) -> tuple[ClockLine, float]:
    """A line after readings at 10 Hz; the device leaps 20 s ahead, its samples are held up at times."""
    rng = np.random.default_rng(seed)
    line = ClockLine(RATE_HZ)
    offset = 0.0
    for at in np.arange(0.1, until_s, 0.1):
        late = 0.5e-3 * (1 + rng.exponential()) + (0.2 if rng.random() < 0.02 else 0.0)
        asked = at + late * rng.random()
        offset = 20.0 if asked > skip_at else 0.0
        counted = held[0] if held[0] <= asked < held[1] else asked
        line.add(ClockReading(at, at + late, int(RATE_HZ * speed * (counted + offset))))
    return line, offset


@pytest.mark.parametrize("speed", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("skip_at", [1e9, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_sample_after_an_outage_is_known_as_well_as_it_says(
    speed: float, skip_at: float, seed: int
) -> None:
    line, offset = fed(60.0, speed=speed, skip_at=skip_at, seed=seed)
    for away_s in (0.1, 2.0, 20.0):
        at = 60.0 + away_s
        answer = line.sample_at(at, at + 2e-3)
        assert answer is not None
        sample, uncertain_s = answer
        assert uncertain_s < 0.25
        assert abs(sample - RATE_HZ * speed * (at + 1e-3 + offset)) <= RATE_HZ * speed * uncertain_s + 2


def test_samples_that_were_held_up_before_the_end_do_not_shorten_the_gap() -> None:
    """A chassis that falls off the network first delivers nothing, then its tasks are gone."""
    line, _ = fed(60.0, held=(59.0, 70.0))
    answer = line.sample_at(62.0, 62.001)
    assert answer is not None
    assert answer[0] == pytest.approx(62.0 * RATE_HZ, abs=RATE_HZ * answer[1] + 4)


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_leap_in_the_first_second_is_taken_for_no_rate(speed: float) -> None:
    line, offset = fed(12.0, speed=speed, skip_at=0.7)
    answer = line.sample_at(20.0, 20.002)
    assert answer is not None
    expected = RATE_HZ * speed * (20.001 + offset)
    assert answer[0] == pytest.approx(expected, abs=RATE_HZ * speed * answer[1] + 4)


def test_without_readings_nothing_is_claimed() -> None:
    assert ClockLine(RATE_HZ).sample_at(1.0, 1.1) is None


@pytest.mark.parametrize("late_s", [0.002, 0.010, 0.026, 0.2])
def test_a_last_count_that_was_held_up_makes_no_gap_too_short(late_s: float) -> None:
    """What a chassis says last before it goes away may be old; it says nothing of the time that passed."""
    line = ClockLine(4000.0)
    for tenth in range(100):
        now = 0.1 * tenth
        line.add(ClockReading(now, now + 0.001, round(4000 * (now + 0.0005))))
    line.add(ClockReading(10.0, 10.001, round(4000 * (10.0005 - late_s))))
    estimate = line.sample_at(10.2, 10.2006)
    assert estimate is not None
    sample, uncertain_s = estimate
    assert abs(sample - 4000 * 10.2003) <= 4000 * uncertain_s
    assert abs(sample - 4000 * 10.2003) <= 4000 * 0.002


def test_a_clock_that_stood_still_for_a_moment_is_followed_and_the_doubt_before_is_said() -> None:
    line = ClockLine(4000.0)
    for tenth in range(150):
        now = 0.1 * tenth
        true = now + 0.0005 - (0.02 if now > 10.0 else 0.0)
        line.add(ClockReading(now, now + 0.001, round(4000 * true)))
        estimate = line.sample_at(now + 0.05, now + 0.051)
        assert estimate is not None
        assert abs(estimate[0] - 4000 * (true + 0.05)) <= 4000 * estimate[1] + 1
    assert estimate[1] < 0.002
