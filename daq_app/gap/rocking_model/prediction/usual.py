"""What any wall has of some effects: a lean, unequal sides, an r that changes a little, a bed that gives.

A cause counts as far as it exceeds that.
"""

from __future__ import annotations

import math
from functools import partial

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.prediction.vector import half_cycle_table, kernel_vector
from daq_app.gap.rocking_model.tolerances.walls import BED_ROOT, LEAN_RAD, SIDES_R, SLOPE_S_RAD
from sim_hardware.dynamics import parameters as par

BED = "bed"
"""Parameter of what a bed of mortar gives: √θ_c, √rad, of the rotation at which its joint begins to open."""
USUAL = (
    Parameter(
        "r_slope",
        0.0,
        SLOPE_S_RAD,
        "s/rad",
        meaning="slope of r over the speed",
        usual_of="restitution_slope",
    ),
    Parameter(
        "r_sides",
        0.0,
        SIDES_R,
        "1",
        meaning="half the difference of r between the sides",
        usual_of="restitution_asymmetry",
    ),
    Parameter("lean", 0.0, LEAN_RAD, "rad", meaning="lean", usual_of="base_tilt"),
    Parameter(
        "uneven",
        0.0,
        LEAN_RAD,
        "rad",
        meaning="half the difference of α between the sides",
        usual_of="alpha_asymmetry",
    ),
    Parameter(
        BED,
        0.0,
        BED_ROOT,
        "√rad",
        0.0,
        meaning="root of the rotation at which the bed begins to open",
        starts=(0.0,),
        usual_of="winkler",
    ),
)


def of_bed(run: RockingRun) -> FloatArray:
    """What a bed adds to the table of half-cycles per √θ_c, (n, 5 + 2F): its moment lacks ⅔ √(θ_c/θ).

    To first order, which such a bed does not leave, for the wall of the survey.
    """
    return run.cache.constant("bed", partial(_of_bed, run))


def _of_bed(run: RockingRun) -> FloatArray:
    survey = run.survey
    block = {"alpha": survey.alpha_rad, "p": survey.p_rad_s, "half_base": survey.half_base_m, "omega0": 0.0}
    vector = kernel_vector(run, block | {"lean": 0.0, "uneven": 0.0})
    peaks, levels = run.swings.peak_rad, run.swings.levels
    stiff = half_cycle_table(run, vector, peaks, levels)
    vector[par.WINKLER] = BED_ROOT**2
    return (half_cycle_table(run, vector, peaks, levels) - stiff) / math.sqrt(vector[par.WINKLER])
