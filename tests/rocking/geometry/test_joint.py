"""The base joint from few LVDTs: the bad one is found, and a channel at its end does not turn the wall."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.rocking.geometry.joint import BaseJoint, Floats

ROW_M = (-0.6, -0.2, 0.2, 0.6)
THETA = np.linspace(0.0, 0.05, 200)


def _joint(height_m: float = 0.0) -> BaseJoint:
    places = [(x, y, height_m) for x in (-0.3, 0.3) for y in ROW_M]
    ids = tuple(f"LV-{face}{k}" for face in "AB" for k in range(4))
    return BaseJoint(
        ids, np.array(places), np.full(8, 1e-5), np.tile([-0.01, 0.05], (8, 1)), half_width_m=0.325
    )


def _openings(joint: BaseJoint, lift_per_rad: float = 0.3, twist: float = 0.0) -> Floats:
    x, y, z = joint.position_m.T
    return np.asarray(
        lift_per_rad * np.sin(THETA)
        - np.outer(x, np.sin(THETA))
        - np.outer(x * y, twist * THETA)
        - np.outer(z, 1.0 - np.cos(THETA))
    )


@pytest.mark.parametrize("bad", range(8))
def test_the_lvdt_that_is_off_is_left_out_wherever_it_stands_in_a_row_of_four(bad: int) -> None:
    joint = _joint()
    openings = _openings(joint)
    openings[bad] += 0.1 * np.sin(THETA)
    motion = joint.motion(openings)
    assert motion.suspects == (joint.ids[bad],)
    assert motion.rotation_rad == pytest.approx(THETA, abs=1e-9)


def test_points_above_the_joint_do_not_move_its_pivot() -> None:
    joint = _joint(height_m=0.05)
    motion = joint.motion(_openings(joint, twist=0.02))
    assert motion.neutral_axis_m[-1] == pytest.approx(0.3, abs=1e-9)
    assert motion.twist_rad_per_m == pytest.approx(0.02 * THETA, abs=1e-9)


def test_a_channel_at_the_end_of_its_range_is_left_out_only_while_it_is() -> None:
    joint = _joint()
    openings = _openings(joint)
    openings[0] = np.minimum(openings[0], 0.5 * openings[0].max())
    joint.ranges_m[0, 1] = openings[0].max()
    motion = joint.motion(openings)
    assert motion.clipped == (joint.ids[0],)
    assert motion.rotation_rad == pytest.approx(THETA, abs=1e-9)
