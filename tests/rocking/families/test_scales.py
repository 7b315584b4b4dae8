"""Signs and units of whole families, from what they show while nothing moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.rocking.families.scales import wrong_scales

RATE_HZ = 400.0
HELD_RAD = 0.03
FACTORS = (-1.0, 0.1, 10.0, -25.4, 180.0 / math.pi, 1e3)


def shown(*, bent_share: float = 0.0, ring_rad: float = 0.0) -> dict[str, np.ndarray]:
    """A hold of 1.5 s, 4 s of rocking and a rest of 1.5 s, shape (n,), rad, as three families show them.

    Wires and tiltmeters, high up, rest off by a share of the hold and ring on at 4.6 Hz.
    """
    time = np.arange(round(7.0 * RATE_HZ)) / RATE_HZ
    rocking = (time >= 1.5) & (time < 5.5)
    base = np.where(time < 1.5, HELD_RAD, 0.0)
    base[rocking] = HELD_RAD * np.cos(2 * np.pi * (time[rocking] - 1.5)) * (5.5 - time[rocking]) / 4.0
    above = (
        base
        + bent_share * HELD_RAD * (time >= 5.5)
        + ring_rad * np.sin(2 * np.pi * 4.6 * time) * (time >= 1.5)
    )
    noise = np.random.default_rng(1).normal(0.0, 2e-5, (3, time.size))
    return dict(zip(("wires", "LVDTs", "tiltmeters"), np.stack([above, base, above]) + noise, strict=True))


@pytest.mark.parametrize("wall", [{}, {"bent_share": 0.18}, {"ring_rad": 1.5e-3}])
@pytest.mark.parametrize("family", ["wires", "LVDTs", "tiltmeters"])
@pytest.mark.parametrize("factor", FACTORS)
def test_a_wrong_factor_is_found_though_the_wall_rings_or_stands_bent(wall, family, factor):
    rotations = shown(**wall)
    rotations[family] = rotations[family] * factor
    assert wrong_scales(rotations, RATE_HZ) == {family: factor}


@pytest.mark.parametrize("wall", [{}, {"bent_share": 0.18}, {"bent_share": -0.2}, {"ring_rad": 1.5e-3}])
def test_families_of_a_wall_that_bends_are_not_wrong(wall):
    assert wrong_scales(shown(**wall), RATE_HZ) == {}


def test_of_two_families_nobody_knows_which_is_wrong():
    rotations = shown()
    two = {"wires": -rotations["wires"], "LVDTs": rotations["LVDTs"]}
    assert wrong_scales(two, RATE_HZ) == {}
