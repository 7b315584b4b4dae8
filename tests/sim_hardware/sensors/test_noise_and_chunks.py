"""Noise that is a function of time, and the same volts in whatever pieces they are asked for."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numba as nb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import kstest

from daq_app.config import load_rig
from daq_app.config.rig import Rig
from sim_hardware.sensors import SensorChain
from sim_hardware.sensors.noise import deviate, key_of
from sim_hardware.virtual_rig import VirtualRig

RATE = 4000.0
FAULTY = {
    "lag@wire": {"tau": 0.02},
    "dropout@LV-A03": {"share": 0.05},
    "clock@LV-A04": {"error": 0.01},
    "wire_inertia@WP-2": {"frequency": 20.0},
    "hum@lvdt": {"amplitude": 1e-4},
}


@pytest.fixture(scope="module")
def rig(configs: Path) -> Rig:
    return load_rig(configs / "fr1.toml")


@pytest.fixture(scope="module")
def wall(rig: Rig) -> VirtualRig:
    return VirtualRig.from_rig(rig, seed=11, effects=FAULTY)


@pytest.fixture(scope="module")
def terminals(rig: Rig) -> tuple[str, ...]:
    return tuple(channel.physical_channel for channel in rig.channels)


@nb.njit
def deviates(key: np.uint64, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """A kernel: Python cannot call its part."""
    values = np.empty(times.size)
    for n in range(times.size):
        values[n] = deviate(key, times[n])
    return values


def test_a_part_of_a_kernel_refuses_python_in_words() -> None:
    with pytest.raises(TypeError, match="deviate is a part of kernels"):
        deviate(key_of(1, "LV-A01"), 0.0)


def test_deviates_are_normal_white_and_independent() -> None:
    n = 40_000
    times = np.arange(n) / RATE
    a, b = (deviates(key_of(1, name), times) for name in ("LV-A01", "LV-A02"))
    assert kstest(a, "norm").pvalue > 0.01
    assert a.std() == pytest.approx(1.0, abs=0.015)
    assert np.abs(a).max() > 3.5
    assert abs(np.corrcoef(a[1:], a[:-1])[0, 1]) < 0.02
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.02


@settings(max_examples=25)
@given(cuts=st.lists(st.integers(1, 31_999), max_size=6), start=st.integers(0, 60_000))
def test_pieces_make_the_same_volts_as_the_whole(
    wall: VirtualRig, terminals: tuple[str, ...], cuts: list[int], start: int
) -> None:
    times = (start + np.arange(32_000)) / RATE
    whole = wall.volts(terminals, times)
    edges = [0, *sorted(set(cuts)), 32_000]
    pieces = [wall.volts(terminals, times[a:b]) for a, b in pairwise(edges)]
    assert np.array_equal(whole, np.concatenate(pieces, axis=1))


def test_any_terminals_in_any_order_and_a_new_rig_give_the_same_volts(
    rig: Rig, wall: VirtualRig, terminals: tuple[str, ...]
) -> None:
    times = 13.5 + np.arange(8000) / RATE
    whole = wall.volts(terminals, times)
    again = VirtualRig.from_rig(rig, seed=11, effects=FAULTY)
    for i in (40, 0, 27, 30):
        assert np.array_equal(again.volts((terminals[i],), times)[0], whole[i])
    assert np.array_equal(again.volts(terminals[::-1], times[::-1][::-1]), whole[::-1])
    other = VirtualRig.from_rig(rig, seed=12, effects=FAULTY)
    assert not np.any(other.volts(terminals, times) == whole)


def test_noise_has_the_certificates_rms(rig: Rig, terminals: tuple[str, ...]) -> None:
    wall = VirtualRig.from_rig(rig, seed=4, scripted=False)
    times = 1.0 + np.arange(8000) / RATE
    noisy = wall.volts(terminals, times)
    quiet = wall.chain.volts(wall.scene, terminals, times, noisy=False)
    for i, channel in enumerate(rig.channels):
        rms = (noisy[i] - quiet[i]).std() / channel.sensitivity_v_per_si
        assert rms == pytest.approx(channel.noise_si, rel=0.05)
        assert np.ptp(quiet[i]) == 0.0


def test_offsets_differ_by_sensor_and_seed_with_the_stated_spread(
    rig: Rig, terminals: tuple[str, ...]
) -> None:
    spread = []
    for seed in range(20):
        chain = SensorChain(rig, seed)
        wall = VirtualRig.from_rig(rig, seed=seed, scripted=False)
        volts = chain.volts(wall.scene, terminals, np.array([0.5]), noisy=False)[:, 0]
        for i, channel in enumerate(rig.channels):
            full = channel.range_si[1] - channel.range_si[0]
            spread.append((volts[i] - channel.offset) / channel.sensitivity_v_per_si / full)
    assert np.std(spread) == pytest.approx(rig.simulation.offset_scatter, rel=0.1)


def test_a_terminal_with_nothing_on_it_floats_near_zero(wall: VirtualRig) -> None:
    volts = wall.volts(("cDAQ1Mod4/ai31", "Elsewhere/ai0"), np.arange(4000) / RATE)
    assert np.all(np.abs(volts) < 0.02)
    assert volts.std() > 1e-4


def test_no_samples_give_an_empty_answer(wall: VirtualRig, terminals: tuple[str, ...]) -> None:
    assert wall.volts(terminals, np.empty(0)).shape == (41, 0)
