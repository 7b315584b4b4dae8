"""The contact engine of the study of yielding edges: a block on points that press and give way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.rocking.theory.housner import exact_quarter_period
from daq_app.rocking.theory.yielding_edge import YieldingEdge
from sim_hardware.dynamics import Body
from sim_hardware.dynamics import parameters as par
from studies.restitution.contact_strip import StripWall, contact_motion, stiffness_of

BODY = Body(0.2135, 2.2, 1.53, 1.0)
WIDTH_M, LIFT_RAD = 0.003, 0.0045
STIFFNESS_1_S2 = stiffness_of(WIDTH_M, LIFT_RAD)
THETA0_RAD = 0.06
GRAVITY_M_S2 = 9.81


@pytest.mark.parametrize("theta_rad", [0.001, 0.003, 0.02, 0.06])
def test_the_weight_rests_where_the_law_of_the_strip_has_it(theta_rad):
    wall = StripWall(BODY, WIDTH_M, STIFFNESS_1_S2)
    turning_rad_s2 = wall.slopes(0.0, wall.held_at(theta_rad))[5]

    lever_m = -turning_rad_s2 * BODY.gyration_squared_m2 / GRAVITY_M_S2
    inside_m = BODY.r0_m * math.sin(BODY.alpha_rad - theta_rad) - lever_m

    law = YieldingEdge(WIDTH_M / 2.0 / BODY.r0_m, LIFT_RAD)
    assert inside_m == pytest.approx(BODY.r0_m * float(law.shortening(theta_rad)), abs=1.2e-4)


def test_a_wall_on_single_points_moves_as_a_block_on_sharp_edges_with_the_r_that_is_asked_for():
    vector = par.base_vector(BODY)
    vector[par.THETA0], vector[par.RESTITUTION] = THETA0_RAD, 0.88
    motion = contact_motion(vector, np.empty(0), width_m=0.0, stiffness_1_s2=STIFFNESS_1_S2)

    peaks = np.abs(motion.peak_rotation_rad[:4])
    halves_s = 2.0 * exact_quarter_period(peaks[1:], BODY.p_rad_s, BODY.alpha_rad)
    assert np.diff(motion.impact_time_s[:4]) == pytest.approx(halves_s, abs=5e-4)
    r = np.abs(motion.velocity_after_rad_s / motion.velocity_before_rad_s)[:8]
    assert r == pytest.approx(0.88, abs=0.003)
    assert motion.ending == "at rest"
