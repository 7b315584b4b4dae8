"""What the effects on a whole sensor family add to the rotation that it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.family import CROSSTALK_SHARE
from daq_app.gap.rocking_model.features.response import effects_on, responded, slow_response
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import Term, moment_shape, side_of
from daq_app.gap.rocking_model.features.slips.impact_steps import slides, stepped
from daq_app.gap.rocking_model.motion.rotation import anchors_turn


def family_difference(run: RockingRun, family: str, values: Mapping[str, float]) -> FloatArray | None:
    """What a family's sensor effects add to the rotation it shows, (m,), rad; None for nothing.

    Several blocks ask for it: it is worked out once.
    """
    return run.cache.part(("shown by", family), values, partial(_family_difference, run, family))


def _family_difference(run: RockingRun, family: str, values: Mapping[str, float]) -> FloatArray | None:
    shown = run.grid.theta
    if family != run.reference:
        of_reference = family_difference(run, run.reference, values)
        shown = shown if of_reference is None else shown - of_reference
    if family == "wire" and family != run.reference:
        # A slip is a step to whatever the wires answer with.
        for form, size in slides(run, values).items():
            shown = shown + size / run.wire_height_m * stepped(run, form)
    total = _added(run, family, values, shown)
    if total is None or family != run.reference:
        return total
    # The grid's own rotation has the effect already: what is behind it is found by going back twice.
    for _ in range(2):
        total = _added(run, family, values, shown - total)
        assert total is not None
    return total


def _added(run: RockingRun, family: str, values: Mapping[str, float], theta: FloatArray) -> FloatArray | None:
    """What a family's sensor effects add to the rotation `theta`; None for nothing."""
    parts = [
        _added_by(effect, run, family, values, value, theta)
        for effect, value in effects_on(family, values).items()
    ]
    return np.asarray(np.sum(parts, axis=0)) if parts else None


def _added_by(
    effect: str,
    run: RockingRun,
    family: str,
    values: Mapping[str, float],
    value: float,
    theta: FloatArray,
) -> FloatArray:
    """What one effect of strength `value` adds to the rotation `theta` (n,) of a family, rad."""
    time_s = run.grid.time_s
    match effect:
        case "lag":
            return np.interp(time_s - value, time_s, theta) - theta
        case "drift":
            scale = {"wire": run.wire_height_m, "lvdt": np.inf}.get(family, 1.0)
            return value / scale * (time_s - run.grid.rest_s)
        case "wire_anchor":
            return anchors_turn(run.wires, theta, value)
        case "wire_cosine":
            return run.wire_bend_m * value * theta**2
    return responded(theta, effect, value, family, values) - theta


def difference_of(run: RockingRun, first: str, second: str, values: Mapping[str, float]) -> FloatArray | None:
    """What one family shows more than another because of sensor effects, (m,), rad; None for nothing."""
    a, b = family_difference(run, first, values), family_difference(run, second, values)
    if a is None:
        return None if b is None else -b
    return a if b is None else a - b


def face_gain(values: Mapping[str, float], face: str) -> float:
    """Relative error of what one face of the joint reads.

    LVDTs that stand further out read more of the same rotation. One is scanned after another of its own face,
    but for the first: what that leaves behind is gain.
    """
    return values[face] + values["faces"] + values[CROSSTALK_SHARE]


def own_gain(run: RockingRun, values: Mapping[str, float]) -> float:
    """Calibration of the reference family on average of both sides."""
    if run.reference != "lvdt":
        return values["cal_wire"]
    return 0.5 * (face_gain(values, "face_a") + face_gain(values, "face_b"))


def of_shapes(run: RockingRun, block: Block, terms: Iterable[Term]) -> FloatArray:
    """Coefficients, (k,), of a sum of fixed shapes, each of which the block is asked for once per run."""
    coefficients = np.zeros(len(block.names))
    for size, name, shape in terms:
        if size != 0.0:
            coefficients += size * run.cache.constant((block.family, name), partial(_unit, block, shape))
    return coefficients


def _unit(block: Block, shape: Callable[[], FloatArray]) -> FloatArray:
    return block.coefficients(shape())


def base_rotation(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """A base that gives way: in step with the reaction at the edge, or with the overturning moment.

    The reaction keeps its lever arm, the moment of gravity falls with the rotation; `fall` is the share
    of the second, which is the simulator's form (1 where it is not fitted).
    """
    theta, phi = run.grid.theta, values.get("compliance.phi", 0.0)
    fall = values.get("compliance.fall", 1.0)

    def seen(shape: FloatArray) -> FloatArray:
        return slow_response(shape, np.array(block.time_constants_s))

    return of_shapes(
        run,
        block,
        (
            (phi * fall, "moment", lambda: seen(moment_shape(theta, run.survey.alpha_rad))),
            (phi * (1.0 - fall), "reaction", lambda: seen(side_of(theta))),
        ),
    )
