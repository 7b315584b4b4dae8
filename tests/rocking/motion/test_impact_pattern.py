"""What a change of r with speed, as the impacts of a test show it, adds to the stated error of r."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.rocking.families.block_checks import weaker_change_by_speed
from daq_app.rocking.families.verdict import with_change_by_speed
from daq_app.rocking.motion.impact_pattern import Coefficient, ImpactPattern, impact_pattern
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.theory.housner import free_rocking

P, ALPHA, RATE = 2.2, 0.215, 1000.0
SETTINGS = MotionSettings(RATE, P, ALPHA)


def pattern(change: float, sigma: float, chance: float, impacts: int = 20) -> ImpactPattern:
    by_speed = Coefficient(change / 0.9, sigma / 0.9, chance)
    return ImpactPattern(by_speed, None, None, None, math.nan, 0.9 - change / 2, 0.9 + change / 2, impacts)


def test_a_change_that_is_there_for_sure_counts_as_a_rectangular_distribution():
    assert pattern(0.02, 1e-6, 1e-12).sigma_r_by_speed == pytest.approx(0.02 / math.sqrt(12.0), rel=1e-3)


def test_a_change_that_scatter_often_makes_counts_with_the_chance_that_it_is_none():
    """By the Bayesian information criterion at even odds: √n e^(−z²/2) to one that there is no change."""
    sure, perhaps, hardly = (pattern(0.01, 0.005, chance) for chance in (1e-12, 0.05, 0.5))

    assert perhaps.sigma_r_by_speed == pytest.approx(0.604 * sure.sigma_r_by_speed, rel=2e-3)
    assert hardly.sigma_r_by_speed == pytest.approx(0.219 * sure.sigma_r_by_speed, rel=2e-3)


def test_the_same_change_counts_for_less_the_more_impacts_were_asked():
    few, many = (pattern(0.01, 0.005, 0.05, impacts) for impacts in (10, 40))

    assert many.sigma_r_by_speed < few.sigma_r_by_speed


def test_a_change_within_its_error_or_not_known_adds_nothing():
    assert pattern(0.004, 0.005, 0.4).sigma_r_by_speed == 0.0
    assert ImpactPattern(None, None, None, None, math.nan, math.nan, math.nan).sigma_r_by_speed == 0.0


@pytest.mark.parametrize(("change", "severity"), [(0.006, "info"), (0.02, "warning")])
def test_a_change_that_scatter_may_make_is_a_warning_from_what_it_adds_to_the_error_on(change, severity):
    (told,) = weaker_change_by_speed(pattern(change, 0.002, 0.02))

    assert (told.kind, told.severity) == ("speed", severity)


def test_intervals_of_r_that_scatters_hold_the_share_that_they_promise():
    """The regression on speed finds a change beyond its error by chance in every third of such tests."""
    rng = np.random.default_rng(3)
    tests, held = 150, []
    for _ in range(tests):
        r = 0.9 * np.exp(rng.normal(0.0, 0.004, 40))
        motion = free_rocking(0.35 * ALPHA, r, P, ALPHA, release_s=0.6, smallest_peak_rad=3e-3)
        time_s = np.arange(round((motion.impacts_s[-1] + 0.1) * RATE)) / RATE
        rotation_rad = motion.at(time_s)[0] + rng.normal(0.0, 2e-5, time_s.size)
        first = np.searchsorted(time_s, motion.impacts_s[0] + 1e-3)
        track = MotionTrack.begin(
            SETTINGS, time_s[:first], rotation_rad[:first], 0.6, float(motion.peaks_rad[0])
        )
        track.add_impacts(motion.impacts_s.tolist(), time_s, rotation_rad)
        added = impact_pattern(track).sigma_r_by_speed
        low, high = with_change_by_speed(track.eav(), added).interval95()
        held.append(low <= 0.9 <= high)
    assert 0.93 * tests <= sum(held) <= 0.975 * tests
