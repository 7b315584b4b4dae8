"""The gain of a mean of sensors is stated as well known as it is in laboratories that differ."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.rocking.families.gain_error import CALIBRATION_SHARE, gain_sigma_of_mean

LABORATORIES = 20_000


def test_one_sensor_alone_has_the_calibration_that_is_assumed():
    assert gain_sigma_of_mean(np.zeros(1), np.ones(1), 0.0) == pytest.approx(CALIBRATION_SHARE)


@pytest.mark.parametrize("sensors", [2, 3, 5])
def test_errors_of_the_mean_gain_are_as_large_as_stated_in_laboratories_of_a_tenth_to_three_tenths(sensors):
    rng = np.random.default_rng(sensors)
    calibration = rng.uniform(0.001, 0.003, (LABORATORIES, 1))
    gains = calibration * rng.standard_normal((LABORATORIES, sensors))
    weights = np.full(sensors, 1.0 / sensors)

    errors = gains.mean(axis=1)
    stated = [gain_sigma_of_mean(row - row.mean(), weights, sensors - 1.0) for row in gains]

    off = errors / np.array(stated)
    assert math.sqrt(np.mean(off**2)) == pytest.approx(1.0, abs=0.05)
    assert np.mean(np.abs(off) < 1.96) == pytest.approx(0.95, abs=0.01)
