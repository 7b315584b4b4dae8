"""LVDTs across the base joint: where the wall turns, how long its contact is, and twist."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import known
from daq_app.gap.rocking_model.features.block import Block, regress
from daq_app.gap.rocking_model.features.differences import family_difference, of_shapes
from daq_app.gap.rocking_model.features.family import Scene, SensorFamily, Size
from daq_app.gap.rocking_model.features.pivots import pivots
from daq_app.gap.rocking_model.features.response import bessel, first_order
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import Term
from daq_app.gap.rocking_model.features.straightness import straightness
from daq_app.gap.rocking_model.motion.late_joint import in_step
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import Rotation, coarse
from daq_app.gap.rocking_model.records import GapRun, Survey
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, SKEW_S

FACE_SKEW = "face_skew"
"""Parameter by which the two faces are sampled apart: the face that opens is the one that tells the time."""


def _lift_block(
    run: GapRun, joint: Rotation, grid: Grid, pick: NDArray[np.bool_], own_zero: bool = False
) -> Block | None:
    """`own_zero`: the rotation is that of the LVDTs and the reference's is not, which rests elsewhere."""
    size = np.abs(grid.theta)
    expected = run.survey.half_base_m * np.sin(size)
    columns = {
        "zero": (np.ones_like(size), "m"),
        "pivot": (size, "m"),
        "pivot left against right": (grid.theta, "m"),
        "pivot with rotation": (size**2, "m/rad"),
        "pivot with rotation, left against right": (size * grid.theta, "m/rad"),
        "contact length": (np.sqrt(size), "m"),
        "drift": (grid.time_s, "m/s"),
    }
    if own_zero:
        columns["sides"] = (np.sign(grid.theta), "m")
    opened = coarse(joint.lift, run.rate_hz) - expected
    return regress("joint", opened, columns, pick & ~grid.near_impact, ("zero", "sides"))


def _twist_block(run: GapRun, joint: Rotation, grid: Grid, pick: NDArray[np.bool_]) -> Block | None:
    columns = {
        "zero": (np.ones_like(grid.theta), "rad/m"),
        "follows rotation": (grid.theta, "1/m"),
        "drift": (grid.time_s, "rad/m/s"),
    }
    return regress("twist", coarse(joint.twist, run.rate_hz), columns, pick, ("zero", "drift"))


def _predict_joint(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Opening at the middle of the base: u_z = (b/2 − a) sin|θ| and what the joint's effects make of it.

    The reference rotation carries the same calibration as the opening, so calibration cancels.
    """
    theta = run.grid.theta
    size = np.abs(theta)
    inwards, apart = pivots(run, values)
    curved = 0.5 * (values.get("rounded_edge.rho", 0.0) - values["mount_height"])
    opened: tuple[Term, ...] = (
        (inwards, "size", lambda: size),
        (apart, "theta", lambda: theta),
        (curved, "square", lambda: size**2),
        (0.5 * values.get("uneven_edges.rho", 0.0), "lopsided square", lambda: size * theta),
        (-2.0 * values["half_base"] * values["bed"], "root", lambda: np.sqrt(size)),
    )
    of_sensors: tuple[Term, ...] = (
        # The opening is told against |θ|, whose zero is where the wall came to rest: a wall that rests a
        # hundredth of a milliradian off upright makes a step from side to side of it.
        (-values["half_base"] * values["zero"], "sides", lambda: np.sign(theta)),
        (values.get("drift@lvdt.rate", 0.0), "time", lambda: run.grid.time_s - run.grid.rest_s),
    )
    coefficients = of_shapes(run, block, of_sensors)
    of_springs = _opened_by_springs(size, values) if "winkler.theta_c" in values else None
    if slow := _slow_effects(values) if block.undone_s else {}:
        beyond = np.sum([amount * shape() for amount, _, shape in opened], axis=0)
        beyond = beyond if of_springs is None else beyond + of_springs
        return coefficients + block.coefficients(_smeared_opening(run, block, values, beyond, slow))
    coefficients = coefficients + of_shapes(run, block, opened)
    return coefficients if of_springs is None else coefficients + block.coefficients(of_springs)


def _opened_by_springs(size: FloatArray, values: Mapping[str, float]) -> FloatArray:
    """What a joint of springs opens more than one of edges, m, at rotations of this size, rad; (m,) both."""
    theta_c, half = values["winkler.theta_c"], values["half_base"]
    opened = half * (theta_c - 2.0 * np.sqrt(theta_c * np.maximum(size, theta_c)))
    return np.where(size > theta_c, opened, -half * size)


def _slow_effects(values: Mapping[str, float]) -> dict[str, float]:
    """Effects of the LVDTs that smear what they show, each with its time constant or delay, s."""
    taus = {effect: values.get(f"{effect}@lvdt.tau", 0.0) for effect in ("slow_response", "filter_delay")}
    return {effect: tau for effect, tau in taus.items() if tau}


def _smeared_opening(
    run: RockingRun, block: Block, values: Mapping[str, float], beyond: FloatArray, slow: Mapping[str, float]
) -> FloatArray:
    """What slow LVDTs make of an opening beyond that of their own rotation, (m,), m, put in step.

    The opening goes with the size of the rotation: after an impact, where that has a corner, a response is
    still on its way down while the other face opens. `beyond` is what the true joint opens more than edges
    at the survey's places do, (m,), m; `slow` are the effects of `_slow_effects`.
    """
    theta, half = run.grid.theta, run.survey.half_base_m
    if (of_wires := family_difference(run, run.reference, values)) is not None:
        theta = theta - of_wires
    turned, opened = theta, half * np.abs(np.sin(theta)) + beyond
    for effect, tau in slow.items():
        response = first_order if effect == "slow_response" else bessel
        turned, opened = response(turned, tau), response(opened, tau)
    time_s = run.grid.time_s
    shown = opened - half * np.abs(np.sin(turned))
    return np.asarray(np.interp(time_s + block.undone_s, time_s, shown))


def _predict_twist(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    follow = values["twist_follow"] + values.get("twist.follow", 0.0)
    return of_shapes(run, block, [(follow, "theta", lambda: run.grid.theta)])


def _observe(scene: Scene) -> Iterator[Block | None]:
    run, joint, grid = scene.run, scene.joint, scene.grid
    if scene.reference == "lvdt":
        yield _lift_block(run, joint, grid, scene.in_range)
        yield _twist_block(run, joint, grid, scene.in_range)
    elif scene.late and joint.whole:
        stepped = in_step(joint, grid, run.rate_hz)
        lifted = _lift_block(run, stepped.joint, stepped.grid, scene.in_range & stepped.pick, True)
        yield lifted and replace(lifted, undone_s=stepped.late_s)
        yield _twist_block(run, stepped.joint, stepped.grid, scene.in_range & stepped.pick)


def _priors(survey: Survey) -> tuple[Parameter, ...]:
    faces = (("face_a", "x < 0"), ("face_b", "x > 0"))
    return (
        *(
            Parameter(
                name, 0.0, CALIBRATION / math.sqrt(12), "1", meaning=f"calibration of the LVDTs at {where}"
            )
            for name, where in faces
        ),
        *straightness(dict(faces)),
        Parameter(
            "faces",
            0.0,
            survey.half_base_tolerance_m / survey.half_base_m,
            "1",
            meaning="how much further apart the LVDTs stand than the survey says",
        ),
        known(FACE_SKEW, SKEW_S, "s", "how much later the LVDTs at x > 0 are sampled than those at x < 0"),
        known("twist_follow", 2e-3, "1/m", "twist from LVDT calibrations"),
        known(
            "mount_height",
            survey.mount_tolerance_m,
            "m",
            "error of the height of the LVDTs' points above the joint",
        ),
    )


FAMILY = SensorFamily(
    _observe,
    {"joint": _predict_joint, "twist": _predict_twist},
    {
        ("joint", "pivot"): Size(3e-4),
        ("joint", "pivot left against right"): Size(5e-5, 3e-4, "m"),
        ("joint", "pivot with rotation"): Size(5e-3),
        ("joint", "pivot with rotation, left against right"): Size(1e-3, 2e-3, "m/rad"),
        ("joint", "contact length"): Size(5e-5, 3e-5, "m"),
        ("joint", "drift"): Size(1e-6, 2e-6, "m/s"),
        ("twist", "follows rotation"): Size(1.5e-4),
    },
    _priors,
)
