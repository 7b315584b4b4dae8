"""Shares, calibration and ranks of the blind check, against known numbers."""

from __future__ import annotations

import math

import pytest

from daq_app.gap.blind.scoring.statistics import (
    auroc,
    calibration_error,
    calibration_error_by_chance,
    reliability,
    share,
)


def test_wilson_and_calibration_against_known_numbers() -> None:
    nine_of_ten = share([True] * 9 + [False])
    assert (nine_of_ten.low, nine_of_ten.high) == pytest.approx((0.5958, 0.9821), abs=1e-4)
    assert calibration_error([0.95] * 100, [True] * 95 + [False] * 5) == pytest.approx(0.0, abs=1e-12)
    assert calibration_error([0.95] * 100, [True] * 60 + [False] * 40) == pytest.approx(0.35)
    assert [bar.found.n for bar in reliability([0.1, 0.9, 1.0], [True, True, False])] == [1, 2]
    assert auroc([2.0, 3.0], [1.0, 2.0]) == pytest.approx(0.875)
    assert math.isnan(auroc([], [1.0]))


@pytest.mark.parametrize("count", [1, 24, 200])
def test_an_interval_of_none_or_all_ends_there(count: int) -> None:
    assert share([False] * count).low == 0.0
    assert share([True] * count).high == 1.0
    assert share([False] * count).high == pytest.approx(1.0 - share([True] * count).low)


def test_few_answers_are_off_by_chance_however_well_calibrated_they_are() -> None:
    one = calibration_error_by_chance([0.5])  # right or wrong, it is off by a half
    hundred = calibration_error_by_chance([0.95] * 100)  # mean absolute deviation of a binomial share
    assert one.value == pytest.approx(0.5)
    assert hundred.value == pytest.approx(math.sqrt(2 / math.pi * 0.95 * 0.05 / 100), rel=0.1)
    assert hundred.low < hundred.value < hundred.high
