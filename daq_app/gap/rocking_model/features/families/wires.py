"""Wire potentiometers: the wall's rotation over its height, and the movement of its base."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import known
from daq_app.gap.rocking_model.features.block import Block, regress
from daq_app.gap.rocking_model.features.differences import (
    base_rotation,
    difference_of,
    face_gain,
    of_shapes,
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
from daq_app.gap.rocking_model.features.response import electronics
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import (
    Term,
    moment_shape,
    play_shape,
    side_of,
    stepped_shape,
    top_shape,
    turn_shape,
    turning_shape,
)
from daq_app.gap.rocking_model.features.slips.base_slip import beyond_rigid, shown_of_base
from daq_app.gap.rocking_model.features.slips.impact_steps import slides, step_terms, turn_share, turns
from daq_app.gap.rocking_model.motion.crosstalk import crosstalk
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import (
    anchors_move,
    coarse,
    mean_rotation,
    straight_line,
    wall_rotation,
    wire_height,
)
from daq_app.gap.rocking_model.records import GapRun, Survey
from daq_app.gap.rocking_model.tolerances.motion import AROUND_TEST_S
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, OTHER_WIRES, PLAY_RAD
from daq_app.gap.rocking_model.tolerances.walls import (
    BENDING_OF_MEAN,
    FEWEST_WIRES,
    SLIP_SCATTER,
    TURN_SCATTER_S,
)

Columns = dict[str, tuple[FloatArray, str]]
"""Shapes of a regression, (m,) each, with the units of their coefficients."""

SLIDE, STEADY = "slide", "steady"
"""Blocks of which a run keeps one: drift of the wires beside steps at impacts, and as if there were none."""
_ON = "slip per speed to one side"
_PARTS = 3
"""Parts of a test, over each of which steps of all wires at impacts are added up: a slide goes on through all
of them, and slips are uneven, which averages out over several impacts."""
_FEWEST_IMPACTS = 4 * _PARTS
"""Impacts from which each part has some to either side."""
_TURNS = 8
"""Impacts at which a turn about the vertical is looked for: those with most speed."""
_TURN_LEVER_1_M = math.sqrt(2.0)
"""Turn that a pair of wires a metre apart shows, over what one of them steps by."""


def _rotation_block(scene: Scene, family: str, absorbed: tuple[str, ...]) -> Block | None:
    """How the wires' rotation differs from that of the other family; the shapes `absorbed` are dropped."""
    run, joint, grid, reference = scene.run, scene.joint, scene.grid, scene.reference
    theta = mean_rotation(run)
    if theta is None:
        return None
    compared = coarse(theta, run.rate_hz) - (
        coarse(joint.theta, run.rate_hz) if reference == "wire" else grid.theta
    )
    columns = rotation_columns(grid, run.survey.alpha_rad)
    block = regress(family, compared, columns, scene.in_range & grid.settled, ("zero", *absorbed))
    if block is None:
        return None
    if "gain" in block.names and len(wall_rotation(run)[1]) < len(run.indices("wire")):
        # Other wires than in the other runs: their mean has another calibration.
        block.covariance[block.names.index("gain"), block.names.index("gain")] += OTHER_WIRES**2
    return with_crosstalk(block, leaked_turn(run))


def _slide_block(scene: Scene) -> Block | None:
    """Drift that all wires share beside the rotation of the LVDTs, and what their steps at impacts add up to.

    Over the whole record: while the wall is held and after it rests a drift goes on, and steps do not. Every
    impact has its own step, for no base slides evenly. The shapes of the wires' rotation are fitted and
    dropped.
    """
    run, joint, grid = scene.run, scene.joint, scene.grid
    theta, count = mean_rotation(run), grid.impact_s.size
    if theta is None or count <= _FEWEST_IMPACTS:
        return None
    lvdts = coarse(joint.theta, run.rate_hz)
    shapes, height_m = rotation_columns(grid, run.survey.alpha_rad), wire_height(run)
    steps = {f"impact {k + 1}": (turn_shape(grid, k) / height_m, "m s/rad") for k in range(count)}
    # From the last impact that is told from others on, smaller ones follow: what they add up to is one step.
    followed = (grid.time_s > grid.impact_s[-1]) & (grid.time_s < grid.rest_s + AROUND_TEST_S)
    absorbed = (*(name for name in shapes if name != "drift"), f"impact {count}")
    pick = grid.valid & grid.settled & ~followed
    block = regress(SLIDE, coarse(theta, run.rate_hz) - lvdts, shapes | steps, pick, absorbed)
    if block is None:
        return None
    summed = _summed(grid.approach[:-1])
    names = ("drift", *(f"slip {part + 1}" for part in range(_PARTS)))
    block = replace(
        block,
        names=names,
        units=("rad/s", *["m s/rad"] * _PARTS),
        values=summed @ block.values,
        covariance=summed @ block.covariance @ summed.T,
        projection=summed @ block.projection,
        said={name: ("wire", _ON if name != "drift" else name) for name in names},
    )
    return with_crosstalk(replace(block, covariance=_as_wires_agree(block, scene, lvdts)), leaked_turn(run))


def _summed(approach: FloatArray) -> FloatArray:
    """Weights, (1 + parts, 1 + k), of the drift and of steps per speed at k impacts of these speeds, rad/s.

    The drift, and the mean slip per speed over as many parts of the test, in which the wall comes down by the
    same sum of speeds. The weights are those next to the speeds in which steps to and fro cancel, whether
    they go with the speed or not: bases that give way, wires with play or sides make such.
    """
    speeds, sides = np.abs(approach), np.sign(approach)
    part = np.minimum((np.cumsum(speeds) - 0.5 * speeds) / speeds.sum() * _PARTS, _PARTS - 1).astype(int)
    summed = np.zeros((1 + _PARTS, 1 + speeds.size))
    summed[0, 0] = 1.0
    for k in range(_PARTS):
        inside = part == k
        shares = speeds[inside] / speeds[inside].sum()
        rules = np.array([np.ones(shares.size), sides[inside], sides[inside] / speeds[inside]])
        wanted = np.array([1.0, 0.0, 0.0])
        summed[1 + k, 1:][inside] = shares + np.linalg.pinv(rules) @ (wanted - rules @ shares)
    return summed


def _as_wires_agree(block: Block, scene: Scene, theta: FloatArray) -> FloatArray:
    """Covariance of the coefficients, (k, k), as single wires have them about their mean.

    Each wire's zero walks by itself. A base that slides unevenly is a walk as well, which all wires share.
    `theta`: rotation of the LVDTs, (m,), rad.
    """
    run = scene.run
    _, chosen = wall_rotation(run)
    if len(chosen) < FEWEST_WIRES:
        return block.covariance
    weights = run.positions(chosen)[:, 2] / run.positions(chosen)[:, 2].sum()
    each = beyond_rigid(run, theta, chosen)[:, block.pick] @ block.projection.T / wire_height(run)
    apart = each - weights @ each
    scatter = (weights * apart.T) @ apart / (1.0 - float(weights @ weights))
    # A wall that bends moves the mean of its wires further than it moves them apart, however many there are.
    # Few wires tell correlations badly: half of each is kept.
    return np.asarray(BENDING_OF_MEAN**2 * 0.5 * (scatter + np.diag(np.diag(scatter))))


def leaked_turn(run: GapRun) -> FloatArray:
    """What a full crosstalk would add to the wires' mean rotation, (m,), rad."""
    _, chosen = wall_rotation(run)
    heights = run.positions(chosen)[:, 2]
    return np.asarray(heights @ crosstalk(run, chosen) / (heights @ heights))


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
    moved = at_base @ beyond_rigid(run, grid.theta, chosen)
    columns = {
        "zero": (np.ones_like(grid.theta), "m"),
        "slip per speed": (stepped_shape(grid, alternating=True), "m s/rad"),
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
    design = shown_of_base(y, z)
    if (
        len(chosen) < len(run.indices("wire"))
        or np.linalg.matrix_rank(design) < 3
        or len(chosen) < FEWEST_WIRES
    ):
        return None
    weights = -np.linalg.pinv(design)[2]
    turned = weights @ beyond_rigid(run, grid.theta, chosen)
    theta, count = grid.theta, min(_TURNS, grid.impact_s.size - 1)
    absorbed = {
        "gain": (theta, "1"),
        "lag": (-grid.omega, "s"),
        "even": (theta**2, "1/rad"),
        "side": (np.abs(theta), "1"),
        "backlash": (side_of(theta), "rad"),
        "turning on": (turning_shape(grid, alternating=False), "s"),
        "turning back": (turning_shape(grid, alternating=True), "s"),
    }
    turns = {f"impact {k + 1}": (turn_shape(grid, k), "s") for k in range(count)}
    pick = scene.rocking & grid.settled & (grid.time_s < grid.impact_s[count])
    columns = absorbed | turns
    block = _regress_about_mean(turned, columns, pick, tuple(absorbed))
    sides = {name: "+" if grid.approach[k] > 0.0 else "−" for k, name in enumerate(turns)}
    labels = {name: ("turn", f"turn per speed at impacts to {side}") for name, side in sides.items()}
    if block is None:
        return None
    # Without one wire of a pair the turn hangs on a longer lever, and with it on what every wire steps by.
    lever = float(weights @ weights) / _TURN_LEVER_1_M**2
    steps = max(lever - 1.0, 0.0) * TURN_SCATTER_S**2 * np.eye(count)
    tops = {f"top {k + 1}": (top_shape(grid, k), "s") for k in range(count)}
    at_tops = _regress_about_mean(turned, columns | tops, pick, tuple(columns))
    covariance = block.covariance
    if at_tops is not None and at_tops.values.size:
        covariance = covariance * _beyond_stated(at_tops)
    return replace(block, said=labels, covariance=covariance + steps)


def _regress_about_mean(
    series: FloatArray, columns: Columns, pick: NDArray[np.bool_], absorbed: tuple[str, ...]
) -> Block | None:
    """The regression without zeros: least norm would give some to the turns, of which play is a sum."""
    level = {name: (shape - shape[pick].mean(), unit) for name, (shape, unit) in columns.items()}
    return regress("turn", series - series[pick].mean(), level, pick, absorbed)


def _beyond_stated(at_tops: Block) -> float:
    """Variance over the stated one of turns at the tops of half-cycles, where no wall turns; at least 1.

    Noise with a spectrum of 1/f varies more over a half-cycle than white noise and a walk do. The stated
    variance has the weight of as many turns as are seen, for eight of them tell a variance to a half.
    """
    seen = float(np.mean(at_tops.values**2 / np.diag(at_tops.covariance)))
    return max(1.0, 0.5 * (seen + 1.0))


def _predict_wire(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    shapes: tuple[Term, ...] = (
        (values["cal_wire"], "theta", lambda: theta),
        (-face_gain(values, "face_a"), "positive", lambda: np.maximum(theta, 0.0)),
        (-face_gain(values, "face_b"), "negative", lambda: np.minimum(theta, 0.0)),
        (values["wire_even"], "even", lambda: theta**2),
        (values["wire_play"], "play", lambda: play_shape(theta)),
        (-values[electronics("wire")], "later", lambda: run.grid.omega),
        *step_terms(run, slides(run, values), 1.0 / run.wire_height_m),
        *_moved_apart(run, values, of_base=False),
    )
    coefficients = of_shapes(run, block, shapes)
    coefficients += travel(run, block, values, of_base=False) + base_rotation(run, block, values)
    series = difference_of(run, "wire", "lvdt", values)
    return coefficients if series is None else coefficients + block.coefficients(series)


def _moved_apart(run: RockingRun, values: Mapping[str, float], of_base: bool) -> Iterator[Term]:
    """What a wall that bends or turns adds to the wires' mean rotation or to the base."""
    bent = bent_share(run, of_base=of_base)
    for form, size in bent_wall(run, values).items():
        yield size * bent, form, partial(bent_form, run, form)
    yield from step_terms(run, turns(run, values), turn_share(run, of_base=of_base))


def _predict_base(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    shapes: tuple[Term, ...] = (
        (values["base_follow"] * run.base_lever, "theta", lambda: theta),
        *step_terms(run, slides(run, values)),
        (values.get("wire_cosine@wire.kappa", 0.0) * run.base_bend_m2, "square", lambda: theta**2),
        *_moved_apart(run, values, of_base=True),
    )
    coefficients = of_shapes(run, block, shapes) + travel(run, block, values, of_base=True)
    if higher := values.get("wire_anchor@wire.height", 0.0):
        coefficients += block.coefficients(anchors_move(run.wires, theta, higher))
    return coefficients


def _predict_turn(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Turns that stay, and what a wall that rings about the vertical or twists shows beside them."""
    kicks = kicks_that_turn(run, values).items()
    rung = ((kick, key, partial(_rung, run, key)) for key, kick in kicks)
    return of_shapes(run, block, (*step_terms(run, turns(run, values)), *rung))


def _rung(run: RockingRun, key: str) -> FloatArray:
    """Rotation about the vertical that all wires together show of a kick of one to yaw or twist."""
    wave = turning_wave(run)
    if key == "yaw.kick":
        return wave
    y, z = np.array([wire.sensor.position_m[1:] for wire in run.wires]).T
    return np.asarray(-np.linalg.pinv(shown_of_base(y, z))[2] @ (y * z) * wave)


def _observe(scene: Scene) -> Iterator[Block | None]:
    yield _rotation_block(scene, "wire", ("drift",))
    steady = _rotation_block(scene, STEADY, ("gain", "lag", "even harmonic", "step with moment"))
    yield None if steady is None else replace(steady, said={"drift": ("wire", "drift")})
    yield _slide_block(scene)
    yield _translation_block(scene)
    yield _turn_block(scene)


def _priors(survey: Survey) -> tuple[Parameter, ...]:
    return (
        Parameter("cal_wire", 0.0, CALIBRATION / math.sqrt(5), "1", meaning="calibration of the wires"),
        known("base_follow", 4e-3, "1", "translation from wire calibrations"),
        known("wire_even", 5e-3, "1/rad", "even part from wire anchors"),
        Parameter("wire_play", 0.0, PLAY_RAD, "rad", meaning="play of the wires' drums"),
    )


FAMILY = SensorFamily(
    _observe,
    {
        "wire": _predict_wire,
        STEADY: _predict_wire,
        SLIDE: _predict_wire,
        "base": _predict_base,
        "turn": _predict_turn,
    },
    {
        ("wire", "gain"): Size(1e-4),
        ("wire", "lag"): Size(2e-5, 2e-4, "s"),
        ("wire", "even harmonic"): Size(3e-3),
        ("wire", "step with moment"): Size(3e-6, 4e-6, "rad"),
        (STEADY, "drift"): Size(2e-6, 5e-6, "rad/s"),
        (SLIDE, "drift"): Size(5e-6, 5e-6, "rad/s"),
        **{(SLIDE, f"slip {part + 1}"): Size(SLIP_SCATTER, 1e-4, "m s/rad") for part in range(_PARTS)},
        ("base", "slip per speed"): Size(5e-5, 1e-4, "m s/rad"),
        ("base", "follows rotation"): Size(3e-4),
        **{("turn", f"impact {k + 1}"): Size(TURN_SCATTER_S) for k in range(_TURNS)},
    },
    _priors,
)
