"""The rotation that a pull is judged by: quick as the wires, true as the tiltmeters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq_app.acquisition.course.judged_rotation import JudgedRotation
from daq_app.config import load_rig

_BLOCK_S = 0.1
_TILT_S = 0.3


@pytest.fixture(scope="module")
def rig(configs):
    return load_rig(configs / "fr1.toml")


def _pulled(rig, drift_rad: float, speed_rad_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(true, judged, tiltmeters) block by block: upright, pulled, held; wires off by `drift_rad`."""
    upright, held = np.zeros(40), np.ones(40)
    pull = np.linspace(0.0, 1.0, max(2, round(0.05 / speed_rad_s / _BLOCK_S)))
    true = 0.05 * np.concatenate([upright, pull, held])
    judged, tilt, shown = JudgedRotation(rig), [], []
    level = 0.0
    for n, value in enumerate(true):
        level += (value - level) * -math.expm1(-_BLOCK_S / _TILT_S)
        speed = (value - true[n - 1]) / _BLOCK_S if n else 0.0
        tilt.append(level)
        shown.append(judged.of_block(value + drift_rad, speed, level, _BLOCK_S, free=False))
    return true, np.array(shown), np.array(tilt)


@given(drift_rad=st.floats(-2e-3, 2e-3), speed_rad_s=st.floats(5e-3, 5e-2))
def test_it_follows_a_pull_at_once_and_stands_on_the_tiltmeters_level(rig, drift_rad, speed_rad_s):
    true, shown, tilt = _pulled(rig, drift_rad, speed_rad_s)
    settled = slice(30, None)
    assert np.max(np.abs(shown[settled] - true[settled])) < 2e-4
    assert np.max(np.abs(tilt[settled] - true[settled])) > 5.0 * 2e-4, "the tiltmeters alone come late"


def test_the_level_is_left_alone_while_the_wall_rocks(rig):
    judged = JudgedRotation(rig)
    for _ in range(40):
        judged.of_block(0.0, 0.0, 0.0, _BLOCK_S, free=True)
        assert judged.of_block(0.01, 0.0, 0.03, _BLOCK_S, free=True) == pytest.approx(0.01)


def test_one_family_stands_in_for_the_other(rig):
    judged = JudgedRotation(rig)
    assert judged.of_block(math.nan, 0.0, 0.02, _BLOCK_S, free=False) == 0.02
    assert judged.of_block(0.02, 0.0, math.nan, _BLOCK_S, free=False) == 0.02
