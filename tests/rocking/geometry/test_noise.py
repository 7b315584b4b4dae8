"""Noise that is read from records themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.rocking.geometry.noise import moving_noise, timing_noise

RATE_HZ = 4000.0


def test_windings_of_potentiometers_are_noise_while_they_move_and_none_at_rest() -> None:
    """Readings in steps of 0.1 mm, each wire with a zero of its own."""
    time_s = np.arange(15_960) / RATE_HZ
    travel_mm = 3.3 * time_s
    zeros = np.random.default_rng(4).uniform(-0.05, 0.05, (5, 1))
    rows = 0.1 * np.round((travel_mm + zeros) / 0.1) - zeros
    errors_of_means = (rows - travel_mm).reshape(5, -1, 60).mean(axis=2)
    erring = errors_of_means.std() * math.sqrt(60.0)
    moving = moving_noise(rows, np.array([np.ones_like(time_s), travel_mm]), RATE_HZ)
    assert math.sqrt(np.mean(moving**2)) == pytest.approx(erring, rel=0.3)
    assert timing_noise(np.full(4000, rows[0, 0]), RATE_HZ) < 1e-9


def test_white_noise_of_moving_records_comes_out_with_its_size() -> None:
    """Each with its own: two of them are ten times as noisy as the others."""
    rng = np.random.default_rng(5)
    travel = np.sin(np.arange(0.0, 8.0, 1.0 / RATE_HZ))
    gain = travel[None, :]
    sizes = np.array([0.02, 0.002, 0.02, 0.002, 0.002])
    rows = travel + sizes[:, None] * rng.standard_normal((5, travel.size))
    assert moving_noise(rows, gain, RATE_HZ) == pytest.approx(sizes, rel=0.25, abs=0.002)
    assert np.isnan(moving_noise(rows[:2], gain, RATE_HZ)).all()
