"""Whether the wall goes back: at once from its hold, never in the sway of a pull."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from daq_app.acquisition.course.live import LiveView
from daq_app.config import Scaling
from daq_app.rocking import RotationGeometry, free_rocking
from drivers import Block

RATE_HZ = 4000.0
ALPHA_SHARE = 0.3


class Unheard:
    """A publisher whom nobody hears."""

    def send(self, *message: Any) -> None:
        """Nothing."""


@pytest.fixture
def goes_back(rig):
    """Whether the wall goes back after each tenth of a second of a rotation, rad."""

    def look(rotation: np.ndarray) -> list[bool]:
        si = np.random.default_rng(5).normal(size=(len(rig.channels), rotation.size))
        si *= np.array([channel.noise_si for channel in rig.channels])[:, None]
        wires = RotationGeometry.from_rig(rig).wires
        for name, shortening in zip(wires.ids, wires.shortening(rotation), strict=True):
            si[rig.channel_ids.index(name)] += shortening
        for row, channel in enumerate(rig.channels):
            if channel.family == "tiltmeter" and channel.axis == "x":
                si[row] += rotation
        readings = Scaling.of(rig.channels).to_readings(si)
        view = LiveView(rig, RATE_HZ, {}, Unheard())  # type: ignore[arg-type]
        said = []
        for first in range(0, rotation.size, 400):
            view.analyse(Block(first, readings[:, first : first + 400], 0, 0))
            said.append(view.goes_back)
        return said

    return look


def times(seconds: float) -> np.ndarray:
    return np.arange(round(seconds * RATE_HZ)) / RATE_HZ


def fall(rig, from_rad: float) -> np.ndarray:
    """The first 0.3 s of a release."""
    motion = free_rocking(from_rad, 0.9, rig.specimen.p_rad_s, rig.specimen.alpha0_rad)
    return np.asarray(motion.at(times(0.3))[0])


def test_a_pull_that_sways_does_not_go_back(rig, goes_back):
    """A jerky pull had been told to keep clear again and again."""
    pulled = ALPHA_SHARE * rig.specimen.alpha0_rad
    sway = 0.002 * np.sin(2 * np.pi * 4.0 * times(6.0))  # up to 0.05 rad/s
    pull = np.linspace(0.0, pulled, round(6 * RATE_HZ)) + sway
    assert np.min(np.diff(pull)) * RATE_HZ < -0.03, "it does move back for moments"
    assert not any(goes_back(np.concatenate([np.zeros(round(RATE_HZ)), pull])))


@pytest.mark.parametrize("held_s", [0.2, 4.0])
def test_a_wall_that_is_let_go_goes_back_before_a_fifth_of_a_second(rig, goes_back, held_s):
    """From a hold at once; from a pull that was not held, once no sway is as fast."""
    pulled = ALPHA_SHARE * rig.specimen.alpha0_rad
    pull = np.concatenate(
        [np.zeros(4000), np.linspace(0.0, pulled, 8000), np.full(times(held_s).size, pulled)]
    )
    pull = pull[: pull.size // 400 * 400]
    said = goes_back(np.concatenate([pull, fall(rig, pulled)]))
    assert not any(said[: pull.size // 400])
    assert said[pull.size // 400 + 1 :] == [True, True]


def test_a_wall_that_is_lowered_from_its_hold_goes_back_until_it_stands(rig, goes_back):
    pulled = ALPHA_SHARE * rig.specimen.alpha0_rad
    pull = np.concatenate([np.zeros(4000), np.linspace(0.0, pulled, 8000), np.full(16_000, pulled)])
    down = np.linspace(pulled, 0.6 * pulled, 4000)
    said = goes_back(np.concatenate([pull, down, np.full(4000, 0.6 * pulled)]))
    assert said[pull.size // 400 + 3 : (pull.size + down.size) // 400] == [True] * 7
    assert not any(said[(pull.size + down.size) // 400 + 1 :])
