"""Where the test begins in a record: shortly before the wall leaves the rotation at which it is held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from daq_app.gap.core import CannotDiagnose
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, Rotation, coarse, joint_rotation
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.motion import AFTER_PULL_S, AT_ROTATION, MAY_BE_HELD, STILL_PULLED

BEFORE_RELEASE_S = 2.0
"""Longest part of the hold that belongs to the test."""


def from_hold(run: GapRun) -> tuple[GapRun, Rotation]:
    """The record from two seconds before the release on, and its joint: the pull is no part of the test.

    Raises `CannotDiagnose` where the LVDTs show no motion.
    """
    joint = joint_rotation(run)
    step = max(round(run.rate_hz / GRID_HZ), 1)
    turned = coarse(joint.theta, run.rate_hz)
    theta = np.abs(turned)
    if not theta.any():
        raise CannotDiagnose(
            f"Run {run.name}: the LVDTs read nothing but their zero.",
            "Check their wiring and supply; the rotation of the joint is read from them.",
        )
    # Until the wall first passes upright: on unequal edges it may rise further on the other side.
    begun = int(np.argmax(theta > 0.5 * theta.max()))
    passed = np.flatnonzero(turned[begun:] * turned[begun] < 0.0)
    largest = float(theta[: begun + int(passed[0]) if passed.size else theta.size].max())
    below = np.flatnonzero(theta < 0.5 * largest)
    # The release ends the first stay near the largest rotation.
    after = below[below > np.flatnonzero(theta > AT_ROTATION * largest)[0]]
    fall = int(after[0]) if after.size else theta.size
    # A wall that is pulled quickly overshoots and sways about the rotation at which it is then held.
    near = np.flatnonzero(theta[:fall] > MAY_BE_HELD * largest)
    plateau = float(np.median(theta[near]))
    release = int(near[theta[near] > AT_ROTATION * plateau][-1])
    # The pull must not be taken for the hold: at most as long as the wall has been held still.
    pulled = np.flatnonzero(theta[:release] < STILL_PULLED * plateau)
    still = release - int(pulled[-1]) if pulled.size else release
    wanted = min(BEFORE_RELEASE_S * run.rate_hz, max(still * step - AFTER_PULL_S * run.rate_hz, run.rate_hz))
    start = int(release * step - wanted)
    if start < 0.5 * run.rate_hz:
        return run, joint
    return replace(run, channels=np.ascontiguousarray(run.channels[:, start:])), joint.from_sample(start)
