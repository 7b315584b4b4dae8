"""What r is found from after a release that was no clean one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.theory.housner import free_rocking

RATE_HZ, RELEASE_S = 500.0, 0.6
P_RAD_S, ALPHA_RAD, THETA0_RAD, R = 2.2, 0.215, 0.065, 0.88


def slowly_released(impacts):
    """Half-cycles of a wall whose fall is said to be none from rest."""
    motion = free_rocking(THETA0_RAD, R, P_RAD_S, ALPHA_RAD, release_s=RELEASE_S, max_impacts=impacts)
    time = np.arange(round((motion.impacts_s[-1] + 0.1) * RATE_HZ)) / RATE_HZ
    rotation = motion.rotation(time) + 1e-5 * np.random.default_rng(0).standard_normal(time.size)
    first = int(np.searchsorted(time, motion.impacts_s[0] + 1e-3))
    settings = MotionSettings(RATE_HZ, P_RAD_S, ALPHA_RAD)
    track = MotionTrack.begin(settings, time[:first], rotation[:first], RELEASE_S, THETA0_RAD)
    track.add_impacts(motion.impacts_s.tolist(), time, rotation)
    return replace(track, release=replace(track.release, residual_rad=0.01 * THETA0_RAD))


@pytest.mark.parametrize(("impacts", "first"), [(7, 2), (6, 1)])
def test_eav_leaves_out_the_first_speed_where_four_points_are_left(impacts, first):
    track = slowly_released(impacts)

    points = track.eav_series().points

    assert not track.fell_freely
    assert min(point.first for point in points) == first
    assert len(points) == 4
