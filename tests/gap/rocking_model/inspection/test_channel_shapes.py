"""One channel beside the others of its family: what of a difference is gain, and what is bend."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.channel_shapes import FURTHER, Others, deviation
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ

OPENING_M = 0.02


@pytest.mark.parametrize("bend_1_m", [-0.5, 0.0, 0.5])
def test_the_gain_of_an_lvdt_is_the_mean_slope_over_its_readings_however_it_bends(bend_1_m: float) -> None:
    """It stays closed for half of the time, as at one face of a wall that rocks."""
    time_s = np.arange(round(6.0 * GRID_HZ)) / GRID_HZ
    opening = OPENING_M * np.maximum(np.sin(2.0 * np.pi * 0.7 * time_s), 0.0) * np.exp(-0.2 * time_s)
    measured = 1.02 * opening + bend_1_m * opening**2
    everywhere = np.ones(opening.size, dtype=np.bool_)
    found = deviation(Others(measured, opening, everywhere, 1.0, further=FURTHER["lvdt"]))
    mean_slope = (measured @ opening) / (opening @ opening) - 1.0
    assert found.values[0] == pytest.approx(mean_slope, abs=1e-4)
    assert found.values[2] == pytest.approx(bend_1_m, abs=1e-3)
