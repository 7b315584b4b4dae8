"""What the mains and converters do to readings, as they are in a laboratory and not in a book."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.inspection.conditions import conditions_of, without_hum
from daq_app.gap.rocking_model.inspection.hum import hum_of
from daq_app.gap.rocking_model.study import prepare
from tests.support.gap.conditions import conditions_found
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)


@pytest.mark.parametrize("mains_hz", [49.97, 60.03])
def test_mains_beside_their_frequency_that_swell_are_taken_out(mains_hz: float) -> None:
    """Half a turn of phase is lost in 17 s, and the mains swell by a fifth within seconds."""
    amplitude_m = 1e-4
    for run in simulate({}, LEVELS):
        sound = run.channels.copy()
        time_s = np.arange(sound.shape[1]) / run.rate_hz
        wave = (1.0 + 0.2 * np.sin(2.0 * np.pi * time_s / 6.0)) * np.sin(
            2.0 * np.pi * mains_hz * time_s + 1.0
        )
        places = run.indices("lvdt")
        run.channels[places] += amplitude_m * wave
        cleaned = without_hum(run, conditions_of([run])[0]).channels
        left = np.sqrt(np.mean((cleaned[places] - sound[places]) ** 2, axis=1))
        assert np.max(left) < 0.05 * amplitude_m


def test_steps_that_are_coarser_than_those_of_the_converter_are_no_frozen_readings() -> None:
    """Between two of them the converter still goes to and fro by its own."""
    runs = simulate({}, LEVELS)
    rng = np.random.default_rng(3)
    for run in runs:
        place = run.place("WP-3")
        coarse = np.round(run.channels[place] / 1.17e-3) * 1.17e-3
        coarse += 4e-5 * rng.standard_normal(coarse.size)
        run.channels[place] = np.round(coarse / 1.25e-4) * 1.25e-4
    assert conditions_found(prepare(runs)[0]) == {"quantisation@WP-3"}


def test_knocks_that_leave_no_tenth_of_a_second_calm_hide_no_hum() -> None:
    """Every mean over 0.1 s then holds some of a knock: all of the record is used."""
    rate_hz, amplitude = 4000.0, 1.0
    time_s = np.arange(int(16.0 * rate_hz)) / rate_hz
    wave = amplitude * np.sin(2.0 * np.pi * 50.0 * time_s)
    values = wave + 0.05 * np.random.default_rng(8).standard_normal(time_s.size)
    values[:: round(0.075 * rate_hz)] += 8.0
    _, _, found = hum_of(values, rate_hz)
    assert found is not None
    assert np.max(np.abs(found - wave)) < 0.1 * amplitude
