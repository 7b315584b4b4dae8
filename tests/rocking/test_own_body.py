"""Speeds at impacts of a wall whose p is not the survey's, and how far their stated errors go."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.rocking.analysis.own_body import impact_speeds, with_own_body
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.theory.housner import free_rocking

RATE_HZ, RELEASE_S, R = 1000.0, 0.6, 0.88
SURVEY_P_RAD_S, ALPHA_RAD, THETA0_RAD = 2.2, 0.215, 0.065
NOISE_RAD = 3e-5
"""What half-cycles are judged by: it hides the misfit of a wrong p. The motion itself is exact."""


@pytest.fixture
def rocked():
    """Makes motion and followed half-cycles of a wall whose p is `share` larger than the survey's."""

    def make(share, impacts):
        motion = free_rocking(
            THETA0_RAD, R, SURVEY_P_RAD_S * (1.0 + share), ALPHA_RAD, release_s=RELEASE_S, max_impacts=impacts
        )
        time = np.arange(round((motion.impacts_s[-1] + 0.1) * RATE_HZ)) / RATE_HZ
        rotation = motion.rotation(time)
        first = int(np.searchsorted(time, motion.impacts_s[0] + 1e-3))
        settings = MotionSettings(RATE_HZ, SURVEY_P_RAD_S, ALPHA_RAD, slow_noise_rad=NOISE_RAD)
        track = MotionTrack.begin(settings, time[:first], rotation[:first], RELEASE_S, THETA0_RAD)
        track.add_impacts(motion.impacts_s.tolist(), time, rotation)
        return motion, track, time, rotation

    return make


def errors(motion, before, after):
    """Relative errors of speeds before and after impacts; the last half-cycle is not complete."""
    return np.concatenate(
        [
            np.abs(before) / motion.speeds_before_rad_s - 1.0,
            np.abs(after[:-1]) / motion.speeds_after_rad_s[: len(after) - 1] - 1.0,
        ]
    )


@pytest.mark.parametrize("share", [-0.01, 0.01])
def test_speeds_do_not_hang_on_the_surveys_p(rocked, share):
    motion, track, time, rotation = rocked(share, impacts=9)

    own = with_own_body(track, time, rotation)
    speeds = impact_speeds(track, own, time, rotation)

    by_survey = errors(motion, np.array(track.speeds_before_rad_s), np.array(track.speeds_after_rad_s))
    by_own = errors(motion, speeds.before_rad_s, speeds.after_rad_s)
    assert np.abs(by_survey).max() > 4e-4
    assert np.abs(by_own).max() < 1.5e-4


def test_speeds_hold_the_error_of_the_surveys_p_where_half_cycles_tell_none(rocked):
    """Its standard uncertainty, 0.7 %, adds as much as a p that is 0.7 % off makes speeds wrong."""
    motion, track, time, rotation = rocked(0.007, impacts=3)

    own = with_own_body(track, time, rotation)
    speeds = impact_speeds(track, own, time, rotation)

    sigmas = np.concatenate([speeds.sigma_before_rad_s, speeds.sigma_after_rad_s[:-1]])
    by_noise = np.concatenate([track.sigma_speeds_before_rad_s, track.sigma_speeds_after_rad_s[:-1]])
    sizes = np.abs(np.concatenate([speeds.before_rad_s, speeds.after_rad_s[:-1]]))
    by_p = np.sqrt(sigmas**2 - by_noise**2) / sizes
    off = np.abs(errors(motion, speeds.before_rad_s, speeds.after_rad_s))
    np.testing.assert_allclose(by_p, off, rtol=0.25)
