"""Means over tests: exact cases, and the promise of the 95 % interval."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from daq_app.campaign.report.statistics import random_effects_mean, shared_scatter


def test_equal_values_have_no_scatter_and_the_error_of_the_mean() -> None:
    group = random_effects_mean([0.9] * 4, [0.002] * 4)
    assert group.mean == pytest.approx(0.9)
    assert group.scatter == 0.0
    assert group.standard_error == pytest.approx(0.001)
    assert group.tests == 4


def test_scatter_between_tests_is_found_and_widens_the_interval() -> None:
    group = random_effects_mean([0.88, 0.90, 0.92, 0.90, 0.91], [0.001] * 5)
    assert group.scatter == pytest.approx(np.std([0.88, 0.90, 0.92, 0.90, 0.91], ddof=1), rel=0.02)
    assert group.high95 - group.low95 > 0.03


def test_a_precise_test_outweighs_a_vague_one() -> None:
    group = random_effects_mean([0.90, 0.95], [0.001, 0.5])
    assert group.mean == pytest.approx(0.90, abs=1e-3)


def test_values_that_are_not_numbers_are_left_out_and_none_is_said_so() -> None:
    assert random_effects_mean([0.9, math.nan], [0.01, 0.01]).tests == 1
    empty = random_effects_mean([math.nan], [0.01])
    assert not empty.known
    assert math.isnan(empty.mean)


def test_unequal_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="2 values but 1"):
        random_effects_mean([0.9, 0.8], [0.1])


@pytest.mark.parametrize("scatter", [0.0, 0.004, 0.02])
def test_the_interval_covers_the_truth_as_often_as_it_says(scatter: float) -> None:
    rng = np.random.default_rng(7)
    covered = 0
    for _ in range(300):
        errors = rng.uniform(0.001, 0.008, 12)
        values = 0.9 + rng.normal(0.0, scatter, 12) + rng.normal(0.0, errors)
        group = random_effects_mean(values, errors)
        covered += group.low95 <= 0.9 <= group.high95
    assert 0.91 <= covered / 300 <= 0.995  # 0.942 to 0.98 over 2500 draws; 300 of them are known to 0.013


@pytest.mark.parametrize("scatter", [0.0, 0.002, 0.005])
def test_a_change_without_and_with_scatter_is_covered_as_often_as_it_says(scatter: float) -> None:
    """Three first tests and one repetition, beside six other tests of the wall."""
    rng = np.random.default_rng(3)
    covered = 0
    for _ in range(400):
        errors = [rng.uniform(0.0007, 0.0013, size).tolist() for size in (3, 3, 3, 1)]
        groups = [
            (0.9 + scatter * rng.standard_normal(len(s)) + np.array(s) * rng.standard_normal(len(s)), s)
            for s in errors
        ]
        shared = shared_scatter([(values.tolist(), s) for values, s in groups])
        error = math.hypot(*(shared.error_of_mean(s) for s in errors[2:]))
        change = groups[3][0].mean() - groups[2][0].mean()
        covered += abs(change) <= stats.t.ppf(0.975, shared.degrees_of_freedom) * error
    assert shared.degrees_of_freedom == 6
    # 0.955 to 0.991 over 1500 draws; 400 of them are known to 0.011.
    assert 0.92 <= covered / 400 <= 0.996


def test_groups_of_one_test_each_tell_no_scatter() -> None:
    shared = shared_scatter([([0.9], [0.001]), ([0.8], [0.001]), ([math.nan], [0.001])])
    assert (shared.scatter, shared.stretch, shared.degrees_of_freedom) == (0.0, 1.0, 0)
