"""Half-cycles fitted with the p and α that the wall itself shows, and the speeds at impacts that they give.

The basis of a half-cycle holds p. Speeds are its slopes at both ends, beyond the points that it is fitted to:
p that is 1 % too large makes them 0.01 to 0.1 % too large, the fastest most, and peaks hardly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.families.body import SURVEY_P_SHARE, body_of
from daq_app.rocking.motion.swings import MotionTrack

Floats = NDArray[np.float64]

_P_SHARE: Final = 0.1
_ALPHA_SHARE: Final = 0.2
"""p and α by the half-cycles that are further from the survey's than this are no property of the wall."""
_STEP: Final = 0.01
"""Relative step of p for the derivative of speeds: their change is many times the noise of rounding."""


@dataclass(frozen=True, slots=True)
class OwnTrack:
    """The motion with the wall's own p and α; with the survey's where half-cycles tell none of a wall."""

    track: MotionTrack
    sigma_p_share: float
    """Relative standard uncertainty of the p that half-cycles are fitted with."""


@dataclass(frozen=True, slots=True)
class ImpactSpeeds:
    """Signed speeds at impacts, with standard uncertainties by noise, zero and p; arrays (impacts,)."""

    before_rad_s: Floats
    sigma_before_rad_s: Floats
    after_rad_s: Floats
    sigma_after_rad_s: Floats


def with_own_body(track: MotionTrack, time_s: Floats, rotation_rad: Floats) -> OwnTrack:
    """Half-cycles fitted with the p and α that they show; `time_s`, `rotation_rad` (n,) cover them."""
    body, nominal = body_of(track, 0.0), track.settings
    if (
        body is not None
        and abs(body.p_rad_s / nominal.p_rad_s - 1.0) < _P_SHARE
        and abs(body.alpha_rad / nominal.alpha_rad - 1.0) < _ALPHA_SHARE
    ):
        again = track.fitted_again(body.p_rad_s, body.alpha_rad, time_s, rotation_rad)
        return OwnTrack(again, body.sigma_p_rad_s / body.p_rad_s)
    return OwnTrack(track, SURVEY_P_SHARE)


def impact_speeds(track: MotionTrack, own: OwnTrack, time_s: Floats, rotation_rad: Floats) -> ImpactSpeeds:
    """Speeds by the wall's own p; by the survey's, which `track` has, where half-cycles tell p worse.

    `time_s`, `rotation_rad` (n,) cover the half-cycles. The error of α is left out: 1 % of it moves speeds by
    0.002 %.
    """
    known = own if own.sigma_p_share < SURVEY_P_SHARE else OwnTrack(track, SURVEY_P_SHARE)
    settings = known.track.settings
    other = known.track.fitted_again(
        settings.p_rad_s * (1.0 + _STEP), settings.alpha_rad, time_s, rotation_rad
    )
    by_p = known.sigma_p_share / _STEP
    before, after = (np.array(values) for values in _speeds(known.track))
    before_by_p, after_by_p = (np.array(values) for values in _speeds(other))
    return ImpactSpeeds(
        before,
        np.hypot(known.track.sigma_speeds_in_decay, by_p * (before_by_p - before)),
        after,
        np.hypot(known.track.sigma_speeds_after_rad_s, by_p * (after_by_p - after)),
    )


def _speeds(track: MotionTrack) -> tuple[list[float], list[float]]:
    return track.speeds_before_rad_s, track.speeds_after_rad_s
