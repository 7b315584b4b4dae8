"""Wire potentiometers: the wall's rotation over its height, and the movement of its base."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import known
from daq_app.gap.rocking_model.features.block import Block, regress
from daq_app.gap.rocking_model.features.differences import (
    base_rotation,
    difference_of,
    face_gain,
    unit_coefficients,
)
from daq_app.gap.rocking_model.features.family import Scene, SensorFamily, Size, with_crosstalk
from daq_app.gap.rocking_model.features.oscillations.ring_response import (
    bent_form,
    bent_share,
    bent_wall,
    kicks_that_turn,
    turning_wave,
)
from daq_app.gap.rocking_model.features.pivots import travel
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import moment_shape, side_of, slip_shape, turn_shape
from daq_app.gap.rocking_model.features.turns import turn_share, turned_coefficients
from daq_app.gap.rocking_model.motion.crosstalk import crosstalk
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import (
    Wire,
    anchors_move,
    coarse,
    gridded,
    mean_rotation,
    straight_line,
    wall_rotation,
)
from daq_app.gap.rocking_model.records import GapRun, Survey
from daq_app.gap.rocking_model.tolerances import CALIBRATION, OTHER_WIRES

_TURNS = 8
"""Impacts at which a turn about the vertical is looked for: those with most speed."""


def _wire_block(scene: Scene) -> Block | None:
    run, joint, grid, reference = scene.run, scene.joint, scene.grid, scene.reference
    theta = mean_rotation(run)
    if theta is None:
        return None
    compared = coarse(theta, run.rate_hz) - (
        coarse(joint.theta, run.rate_hz) if reference == "wire" else grid.theta
    )
    columns = rotation_columns(grid, run.survey.alpha_rad)
    block = regress("wire", compared, columns, scene.in_range & grid.settled, ("zero",))
    if block is not None and len(wall_rotation(run)[1]) < len(run.indices("wire")):
        # Other wires than in the other runs: their mean has another calibration.
        block.covariance[block.names.index("gain"), block.names.index("gain")] += OTHER_WIRES**2
    return with_crosstalk(block, leaked_turn(run))


def leaked_turn(run: GapRun) -> FloatArray:
    """What a full crosstalk would add to the wires' mean rotation, (m,), rad."""
    _, chosen = wall_rotation(run)
    heights = run.positions(chosen)[:, 2]
    return np.asarray(heights @ crosstalk(run, chosen) / (heights @ heights))


def _beyond_rigid(run: GapRun, grid: Grid, chosen: Sequence[int]) -> FloatArray:
    """What wires show beyond those of a rigid wall on still edges, (k, m), m."""
    ideal = [Wire(run.sensors[i], run.survey.half_base_m).shortening(grid.theta) for i in chosen]
    return np.array([gridded(run, i) for i in chosen]) - np.array(ideal)


def rotation_columns(grid: Grid, alpha: float) -> dict[str, tuple[FloatArray, str]]:
    """Shapes in which two measures of the rotation can differ."""
    return {
        "zero": (np.ones_like(grid.theta), "rad"),
        "gain": (grid.theta, "1"),
        "lag": (-grid.omega, "s"),
        "even harmonic": (grid.theta**2, "1/rad"),
        "step with moment": (moment_shape(grid.theta, alpha), "rad"),
        "drift": (grid.time_s, "rad/s"),
    }


def _translation_block(scene: Scene) -> Block | None:
    """Movement of the base along x, from wires at several heights."""
    run, grid = scene.run, scene.grid
    _, chosen = wall_rotation(run)
    heights = run.positions(chosen)[:, 2]
    if len(set(np.round(heights, 2))) < 2 or len(chosen) < len(run.indices("wire")):
        return None  # what the base seems to do hangs on the calibration of each wire
    at_base = straight_line(heights)[0]
    moved = at_base @ _beyond_rigid(run, grid, chosen)
    columns = {
        "zero": (np.ones_like(grid.theta), "m"),
        "slip per speed": (slip_shape(grid), "m s/rad"),
        "follows rotation": (grid.theta, "m/rad"),
        "drift": (grid.time_s, "m/s"),
    }
    block = regress("base", moved, columns, scene.rocking, ("zero", "drift"))
    return with_crosstalk(block, at_base @ crosstalk(run, chosen))


def _turn_block(scene: Scene) -> Block | None:
    """Rotation about the vertical, from wires at both ends of the wall: what each of the first impacts turns.

    What the wires' calibration, times and anchors leave in it is fitted and dropped; a zero that walks is
    taken up by the next impact, so that each turn is measured over the half-cycles on either side of it. What
    goes to and fro with the side is play of a wire rather than turning: by least norm that one shape has it.
    """
    run, grid = scene.run, scene.grid
    _, chosen = wall_rotation(run)
    _, y, z = run.positions(chosen).T
    design = np.column_stack([np.ones_like(y), z, y])
    if len(chosen) < len(run.indices("wire")) or np.linalg.matrix_rank(design) < 3 or len(chosen) < 4:
        return None
    turned = -np.linalg.pinv(design)[2] @ _beyond_rigid(run, grid, chosen)
    theta, count = grid.theta, min(_TURNS, grid.impact_s.size - 1)
    absorbed = {
        "gain": (theta, "1"),
        "lag": (-grid.omega, "s"),
        "even": (theta**2, "1/rad"),
        "side": (np.abs(theta), "1"),
        "backlash": (side_of(theta), "rad"),
    }
    turns = {f"impact {k + 1}": (turn_shape(grid, k), "s") for k in range(count)}
    pick = scene.rocking & grid.settled & (grid.time_s < grid.impact_s[count])
    # A zero is no part of the shapes: least norm would give some of it to the turns, of which play is a sum.
    columns = {name: (shape - shape[pick].mean(), unit) for name, (shape, unit) in (absorbed | turns).items()}
    block = regress("turn", turned - turned[pick].mean(), columns, pick, tuple(absorbed))
    sides = {name: "+" if grid.approach[k] > 0.0 else "−" for k, name in enumerate(turns)}
    labels = {name: ("turn", f"turn per speed at impacts to {side}") for name, side in sides.items()}
    return block and replace(block, said=labels)


def _predict_wire(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    coefficients = values["cal_wire"] * unit_coefficients(run, block, "theta", lambda: theta)
    coefficients = coefficients - face_gain(values, "face_a") * unit_coefficients(
        run, block, "positive", lambda: np.maximum(theta, 0.0)
    )
    coefficients = coefficients - face_gain(values, "face_b") * unit_coefficients(
        run, block, "negative", lambda: np.minimum(theta, 0.0)
    )
    coefficients = coefficients + values["wire_even"] * unit_coefficients(
        run, block, "even", lambda: theta**2
    )
    if "compliance.phi" in values:
        coefficients = coefficients + base_rotation(run, block, values)
    if "sliding.c" in values:
        coefficients = coefficients + values["sliding.c"] / run.wire_height_m * unit_coefficients(
            run, block, "slip", partial(slip_shape, run.grid)
        )
    coefficients = (
        coefficients + travel(run, block, values, of_base=False) + _bent(run, block, values, of_base=False)
    )
    coefficients = coefficients + turn_share(run, of_base=False) * turned_coefficients(run, block, values)
    series = difference_of(run, "wire", "lvdt", values)
    return coefficients if series is None else coefficients + block.coefficients(series)


def _bent(run: RockingRun, block: Block, values: Mapping[str, float], of_base: bool) -> FloatArray | float:
    """What a wall that bends adds to the wires' mean rotation or to the base."""
    share = bent_share(run, of_base=of_base)
    coefficients: FloatArray | float = 0.0
    for form, size in bent_wall(run, values).items():
        coefficients = coefficients + size * share * unit_coefficients(
            run, block, form, partial(bent_form, run, form)
        )
    return coefficients


def _predict_base(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    follow = values["base_follow"] * run.base_lever
    following = follow * unit_coefficients(run, block, "theta", lambda: run.grid.theta)
    coefficients: FloatArray = following + values.get("sliding.c", 0.0) * unit_coefficients(
        run, block, "slip", partial(slip_shape, run.grid)
    )
    coefficients = (
        coefficients + travel(run, block, values, of_base=True) + _bent(run, block, values, of_base=True)
    )
    coefficients = coefficients + turn_share(run, of_base=True) * turned_coefficients(run, block, values)
    if "wire_cosine@wire.kappa" in values:
        bend = values["wire_cosine@wire.kappa"] * run.base_bend_m2
        coefficients = coefficients + bend * unit_coefficients(
            run, block, "square", lambda: run.grid.theta**2
        )
    if higher := values.get("wire_anchor@wire.height", 0.0):
        coefficients = coefficients + block.coefficients(anchors_move(run.wires, run.grid.theta, higher))
    return coefficients


def _predict_turn(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Turns that stay, and what a wall that rings about the vertical or twists shows beside them."""
    coefficients = turned_coefficients(run, block, values)
    for key, kick in kicks_that_turn(run, values).items():
        coefficients = coefficients + kick * unit_coefficients(run, block, key, partial(_rung, run, key))
    return coefficients


def _rung(run: RockingRun, key: str) -> FloatArray:
    """Rotation about the vertical that all wires together show of a kick of one to yaw or twist."""
    wave = turning_wave(run)
    if key == "yaw.kick":
        return wave
    places = np.array([wire.sensor.position_m[1:] for wire in run.wires])
    design = np.column_stack([np.ones(len(places)), places[:, 1], places[:, 0]])
    return np.asarray(-np.linalg.pinv(design)[2] @ (places[:, 0] * places[:, 1]) * wave)


def _observe(scene: Scene) -> Iterator[Block | None]:
    yield _wire_block(scene)
    yield _translation_block(scene)
    yield _turn_block(scene)


def _priors(survey: Survey) -> tuple[Parameter, ...]:
    return (
        Parameter("cal_wire", 0.0, CALIBRATION / math.sqrt(5), "1", meaning="calibration of the wires"),
        known("base_follow", 4e-3, "1", "translation from wire calibrations"),
        known("wire_even", 5e-3, "1/rad", "even part from wire anchors"),
    )


FAMILY = SensorFamily(
    _observe,
    {"wire": _predict_wire, "base": _predict_base, "turn": _predict_turn},
    {
        ("wire", "gain"): Size(1e-4),
        ("wire", "lag"): Size(2e-5, 2e-4, "s"),
        ("wire", "even harmonic"): Size(3e-3),
        ("wire", "step with moment"): Size(3e-6, 4e-6, "rad"),
        ("wire", "drift"): Size(2e-6, 5e-6, "rad/s"),
        ("base", "slip per speed"): Size(5e-5, 1e-4, "m s/rad"),
        ("base", "follows rotation"): Size(3e-4),
        **{("turn", f"impact {k + 1}"): Size(1e-4) for k in range(_TURNS)},
    },
    _priors,
    {"wire": ("sensor", 5), "base": ("contact", 2), "turn": ("structure", _TURNS)},
)
