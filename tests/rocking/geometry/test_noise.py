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
    alike = np.ones((5, 1))
    moving = moving_noise(rows, alike, np.array([np.ones_like(time_s), travel_mm]), RATE_HZ)
    assert moving == pytest.approx(erring, rel=0.3)
    assert timing_noise(np.full(4000, rows[0, 0]), RATE_HZ) < 1e-9


def test_what_moves_all_wires_of_a_wall_together_is_no_noise() -> None:
    """A wall that rotates and rings by fifty times the noise, and wires with gains of their own."""
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, 8.0, 1.0 / RATE_HZ)
    height_m = np.array([0.6, 1.1, 1.6, 2.1, 2.6])
    rotation, ringing = np.sin(time_s), np.sin(75.0 * time_s)
    rows = np.outer(height_m * (1.0 + 0.003 * rng.standard_normal(5)), rotation)
    rows += 0.1 * np.outer(height_m**2, ringing) + 0.002 * rng.standard_normal(rows.shape)
    together = np.column_stack([height_m, height_m**2])
    assert moving_noise(rows, together, rotation[None, :], RATE_HZ) == pytest.approx(0.002, rel=0.15)
    assert moving_noise(rows, together[:, :1], rotation[None, :], RATE_HZ) > 0.02
    assert math.isnan(moving_noise(rows[:2], together[:2], rotation[None, :], RATE_HZ))
