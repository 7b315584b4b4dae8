"""A wall that bends is told from its two rotations, and from nothing that else sets them apart."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from daq_app.rocking.motion.bending import Bending, find_bending
from daq_app.rocking.theory.housner import free_rocking

Floats = NDArray[np.float64]

RATE_HZ = 2000.0
TIME_S = np.arange(round(4.5 * RATE_HZ)) / RATE_HZ
MOTION = free_rocking(0.07, 0.9, 2.2, 0.215, release_s=0.3, smallest_peak_rad=1e-3)
THETA_RAD = MOTION.at(TIME_S)[0]


def seen(values: Floats, seed: int) -> Floats:
    return np.asarray(values + np.random.default_rng(seed).normal(0.0, 4e-5, values.size))


def bending(wires_rad: Floats, lvdts_rad: Floats) -> Bending | None:
    return find_bending(TIME_S, wires_rad, lvdts_rad, MOTION.impacts_s.tolist())


def ringing(frequency_hz: float, amplitude_rad: float) -> Floats:
    """Begins anew at every impact, against the turn of the wall, and dies out."""
    wave = np.zeros_like(TIME_S)
    for time_s, speed in zip(MOTION.impacts_s, MOTION.speeds_before_rad_s, strict=True):
        since = np.maximum(TIME_S - time_s, 0.0)
        wave += speed * np.exp(-0.3 * since) * np.sin(2.0 * np.pi * frequency_hz * since)
    return amplitude_rad * wave / wave.std()


@pytest.mark.parametrize("frequency_hz", [3.5, 4.6, 11.0])
@pytest.mark.parametrize("rms_rad", [1e-4, 1e-3])
def test_wires_that_ring_about_the_lvdts_show_frequency_and_size_of_the_bending(frequency_hz, rms_rad):
    found = bending(seen(THETA_RAD + ringing(frequency_hz, rms_rad), 1), seen(THETA_RAD, 2))

    assert found is not None
    assert found.frequency_hz == pytest.approx(frequency_hz, rel=0.1)
    assert found.rms_rad == pytest.approx(rms_rad, rel=0.1)


def test_lvdts_that_ring_about_the_wires_are_no_wall_that_bends():
    assert bending(seen(THETA_RAD, 1), seen(THETA_RAD + ringing(4.6, 5e-4), 2)) is None


def slow(values: Floats) -> Floats:
    keep = float(np.exp(-1.0 / RATE_HZ / 0.02))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])


@pytest.mark.parametrize(
    "change",
    [
        lambda values: values,
        slow,
        lambda values: np.roll(values, 40),
        lambda values: 1.05 * values,
        lambda values: values + 3e-4 * TIME_S,
        lambda values: values + 2e-4 * np.tanh(values / 1e-3),
        lambda values: values + 3e-4 * np.sin(2.0 * np.pi * 50.0 * TIME_S),
        lambda values: values + 3e-4 * np.sin(100.0 * np.pi * TIME_S) + 3e-5 * np.sin(88.0 * np.pi * TIME_S),
    ],
    ids=["sound", "slow", "late", "gain", "drift", "yields at its base", "hum", "hum with a side band"],
)
def test_what_else_sets_wires_and_lvdts_apart_is_no_bending(change: Callable[[Floats], Floats]):
    assert bending(seen(change(THETA_RAD), 1), seen(THETA_RAD, 2)) is None


def test_lvdts_that_know_a_part_of_the_motion_tell_no_bending():
    lvdts = seen(THETA_RAD, 2)
    lvdts[: lvdts.size // 10] = np.nan

    assert bending(seen(THETA_RAD + ringing(4.6, 5e-4), 1), lvdts) is None
