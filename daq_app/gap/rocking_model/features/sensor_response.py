"""What sensor effects and the wall's deformations do to each family's coefficients."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, partial

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features import extra_response as extra
from daq_app.gap.rocking_model.features.memo import Memo, any_of
from daq_app.gap.rocking_model.features.repeatability import bias_names, repeatability, unequal_name
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.sensor_blocks import (
    Block,
    first_order,
    moment_shape,
    side_of,
    slip_shape,
)
from daq_app.gap.rocking_model.motion.rotation import anchors_off, pivots_off
from daq_app.gap.rocking_model.records import GRAVITY_M_S2

_FAMILY_EFFECTS = (
    ("gain", "error"),
    ("lag", "tau"),
    ("slow_response", "tau"),
    ("filter_delay", "tau"),
    ("drift", "rate"),
    ("wire_cosine", "kappa"),
    ("wire_anchor", "height"),
    ("wire_inertia", "frequency"),
)
"""Effects on a whole family, and the parameter that says that they are there."""


def block_coefficients(run: RockingRun, values: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Predicted coefficients of all blocks of a run, and the unit of their scatter, each (k,)."""
    if not run.blocks:
        return np.zeros(0), np.zeros(0)
    if "units" not in run.cache:
        units = [np.array([repeatability(block, i) for i in range(len(block.names))]) for block in run.blocks]
        run.cache["units"] = units, np.concatenate(units)
    whole: FloatArray
    units, whole = run.cache["units"]
    memos: list[Memo] = run.cache.setdefault("memos", [Memo() for _ in run.blocks])
    predicted = [
        memo.of(values, partial(_coefficients, run, block, unit))
        for block, unit, memo in zip(run.blocks, units, memos, strict=True)
    ]
    return np.concatenate(predicted), whole


def _coefficients(run: RockingRun, block: Block, unit: FloatArray, values: Mapping[str, float]) -> FloatArray:
    coefficients = _PREDICT[block.rule](run, block, values)
    for i, name in bias_names(block.family, block.names):
        coefficients[i] += values.get(name, 0.0)
    if block.unequal is not None:
        coefficients = coefficients + values.get(unequal_name(block.family), 0.0) * block.unequal
    if f"free_{block.family}.c0" in values:
        free = [values.get(f"free_{block.family}.c{i}", 0.0) for i in range(unit.size)]
        coefficients = coefficients + 3.0 * unit * np.array(free)
    return coefficients


@cache
def _family_keys(family: str) -> dict[str, None]:
    """Parameters that say which effects there are on a family."""
    return dict.fromkeys(f"{name}@{family}.{parameter}" for name, parameter in _FAMILY_EFFECTS)


def _family_difference(run: RockingRun, family: str, values: Mapping[str, float]) -> FloatArray | None:
    """What a family's sensor effects add to the rotation it shows, on the grid; None for nothing."""
    shown = run.grid.theta
    if family == "wire" and family != run.reference and "sliding.c" in values:
        # A slip is a step to whatever the wires answer with.
        if "slips" not in run.cache:
            run.cache["slips"] = slip_shape(run.grid) / run.wire_height_m
        shown = shown + values["sliding.c"] * run.cache["slips"]
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
    if not any_of(values, _family_keys(family)):
        return None
    time_s = run.grid.time_s
    parts: list[FloatArray] = []
    for name, parameter in _FAMILY_EFFECTS:
        value = values.get(f"{name}@{family}.{parameter}")
        if value is None:
            continue
        match name:
            case "gain":
                parts.append(value * theta)
            case "lag":
                parts.append(np.interp(time_s - value, time_s, theta) - theta)
            case "slow_response":
                parts.append(first_order(theta, value) - theta)
            case "filter_delay":
                parts.append(extra.bessel(theta, value) - theta)
            case "wire_inertia":
                zeta = values.get(f"wire_inertia@{family}.zeta", 0.2)
                parts.append(extra.resonator(theta, 2.0 * np.pi * value, zeta) - theta)
            case "drift":
                scale = {"wire": run.wire_height_m, "lvdt": np.inf}.get(family, 1.0)
                parts.append(value / scale * (time_s - (run.swings.rest_s - run.swings.release_s)))
            case "wire_anchor":
                parts.append(anchors_off(run.wires, theta, value)[0])
            case "wire_cosine":
                parts.append(run.wire_bend_m * value * theta**2)
    total: FloatArray = np.sum(parts, axis=0)
    return total


def _difference_of(
    run: RockingRun, first: str, second: str, values: Mapping[str, float]
) -> FloatArray | None:
    """What one family shows more than another because of sensor effects; None for nothing."""
    a, b = _family_difference(run, first, values), _family_difference(run, second, values)
    if a is None:
        return None if b is None else -b
    return a if b is None else a - b


def _own_gain(run: RockingRun, values: Mapping[str, float]) -> float:
    """Calibration of the reference family on average of both sides."""
    return 0.5 * (values["face_a"] + values["face_b"]) if run.reference == "lvdt" else values["cal_wire"]


def _unit(run: RockingRun, block: Block, name: str, shape: Callable[[], FloatArray]) -> FloatArray:
    """Coefficients of a fixed shape, worked out once per run."""
    key = (block.family, name)
    if key not in run.cache:
        run.cache[key] = block.coefficients(shape())
    found: FloatArray = run.cache[key]
    return found


def _base_rotation(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """A base that gives way: in step with the reaction at the edge, or with the overturning moment.

    The reaction keeps its lever arm, the moment of gravity falls with the rotation; `fall` is the share
    of the second, which is the simulator's form (1 where it is not fitted).
    """
    theta, fall = run.grid.theta, values.get("compliance.fall", 1.0)
    slow = 0.3 if block.family == "tiltmeter" else 0.0

    def seen(shape: FloatArray) -> FloatArray:
        return first_order(shape, slow)

    moment = _unit(run, block, "moment", lambda: seen(moment_shape(theta, run.survey.alpha_rad)))
    reaction = _unit(run, block, "reaction", lambda: seen(side_of(theta)))
    found: FloatArray = values["compliance.phi"] * (fall * moment + (1.0 - fall) * reaction)
    return found


def _wire(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    found = values["cal_wire"] * _unit(run, block, "theta", lambda: theta)
    found = found - values["face_a"] * _unit(run, block, "positive", lambda: np.maximum(theta, 0.0))
    found = found - values["face_b"] * _unit(run, block, "negative", lambda: np.minimum(theta, 0.0))
    found = found + values["wire_even"] * _unit(run, block, "even", lambda: theta**2)
    if "compliance.phi" in values:
        found = found + _base_rotation(run, block, values)
    if "sliding.c" in values:
        found = found + values["sliding.c"] / run.wire_height_m * _unit(
            run, block, "slip", partial(slip_shape, run.grid)
        )
    found = found + _travel(run, block, values, of_base=False)
    series = _difference_of(run, "wire", "lvdt", values)
    return found if series is None else found + block.coefficients(series)


def _tiltmeter(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    found = values["cal_tiltmeter"] * _unit(run, block, "theta", lambda: first_order(theta, 0.3))
    # Each face of the joint has its own calibration: the slow response makes their difference a drift.
    first, second = ("face_a", "face_b") if run.reference == "lvdt" else ("cal_wire", "cal_wire")
    positive = _unit(run, block, "positive", lambda: first_order(np.maximum(theta, 0.0), 0.3))
    negative = _unit(run, block, "negative", lambda: first_order(np.minimum(theta, 0.0), 0.3))
    found = found - values[first] * positive - values[second] * negative
    if "compliance.phi" in values:
        found = found + _base_rotation(run, block, values)
    series = _difference_of(run, "tiltmeter", run.reference, values)
    if series is not None:
        found = found + block.coefficients(first_order(series, 0.3))
    # A clock that is off shows the time constant as another one.
    response = values["tilt_response"] + 0.3 / (1.0 + values.get("clock.error", 0.0)) - 0.3

    def slower() -> FloatArray:
        difference: FloatArray = (first_order(theta, 0.31) - first_order(theta, 0.29)) / 0.02
        return difference

    return found + response * _unit(run, block, "response", slower)


def _accelerometer(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    own = values["cal_accelerometer"] + values.get("gain@accelerometer.error", 0.0)
    name = run.reference
    reference = _own_gain(run, values) + values.get(f"gain@{name}.error", 0.0)
    clock = 1.0 + values.get("clock.error", 0.0)
    ratio = (1.0 + own) / (1.0 + reference)
    gains = {"gain of gravity": ratio - 1.0, "gain of inertia": ratio / clock**2 - 1.0}
    found = np.array([gains.get(name, 0.0) for name in block.names])
    # The base turns slowly: of its rotation the accelerometers show gravity alone, as in the simulator.
    return found - GRAVITY_M_S2 * _base_rotation(run, block, values) if "compliance.phi" in values else found


def _impact_timing(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Accelerometers against the reference rotation: their own delay less that of the reference."""
    late = extra.delay("accelerometer", values) - extra.delay(run.reference, values)
    return np.array([values["onset"] + late])


def _swing_timing(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """The same between impacts, whose form does not matter there."""
    return np.array([extra.delay("accelerometer", values) - extra.delay(run.reference, values)])


def _edges(run: RockingRun, values: Mapping[str, float]) -> tuple[float, float]:
    """(distance of the pivots from the middle beyond the survey's, half its difference right to left), m."""
    half, alpha = values["half_base"], values["alpha"]
    tall = half / np.tan(alpha)
    wear = values.get("crushing.loss", 0.0) * 0.01 * run.impacts_before
    worn = half - tall * np.tan(alpha * (1.0 - wear))
    inwards = half - run.survey.half_base_m - values.get("pivot_shift.a", 0.0) - worn
    inwards -= values.get("rounded_edge.rho", 0.0)
    return inwards, values.get("alpha_asymmetry.delta", 0.0) * tall / np.cos(alpha) ** 2


def _travel(run: RockingRun, block: Block, values: Mapping[str, float], of_base: bool) -> FloatArray:
    """What pivots that are not where the survey has them make of the wires' rotation (rad) or base (m).

    The base travels along x by Δu (1 − cos θ), and the wall rises by Δu sin|θ|, which a wire shows as far
    as it slopes by then: left out, a shifted pivot looks like some sliding and a gain of the wires.
    """
    theta = run.grid.theta
    inwards, apart = _edges(run, values)
    if "pivots" not in run.cache:
        run.cache["pivots"] = pivots_off(run.wires, theta)
    each: FloatArray = run.cache["pivots"][of_base]
    found = inwards * _unit(run, block, "travel", lambda: each)
    found = found + apart * _unit(run, block, "lopsided travel", lambda: side_of(theta) * each)
    if "winkler.theta_c" in values:
        root = np.sqrt(values["winkler.theta_c"] / np.maximum(np.abs(theta), values["winkler.theta_c"]))
        found = found + block.coefficients(-2.0 * values["half_base"] * root * each)
    return found


def _joint(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Opening at the middle of the base: u_z = (b/2 − a) sin|θ| and what the joint's effects make of it.

    The reference rotation carries the same calibration as the opening, so calibration cancels.
    """
    theta = run.grid.theta
    size = np.abs(theta)
    inwards, apart = _edges(run, values)
    curved = 0.5 * (values.get("rounded_edge.rho", 0.0) - values["mount_height"])
    found: FloatArray = inwards * _unit(run, block, "size", lambda: size) + apart * _unit(
        run, block, "theta", lambda: theta
    )
    found = found + curved * _unit(run, block, "square", lambda: size**2)
    # The opening is told against |θ|, whose zero is where the wall came to rest: a wall that rests a
    # hundredth of a milliradian off upright makes a step from side to side of it.
    found = found - values["half_base"] * values["zero"] * _unit(run, block, "sides", lambda: np.sign(theta))
    if "winkler.theta_c" in values:
        theta_c, half = values["winkler.theta_c"], values["half_base"]
        opened = half * (theta_c - 2.0 * np.sqrt(theta_c * np.maximum(size, theta_c)))
        found = found + block.coefficients(np.where(size > theta_c, opened, -half * size))
    if "drift@lvdt.rate" in values:
        rest = run.swings.rest_s - run.swings.release_s
        found = found + values["drift@lvdt.rate"] * _unit(run, block, "time", lambda: run.grid.time_s - rest)
    smeared = _smeared_opening(run, block.undone_s, values) if block.undone_s else None
    return found if smeared is None else found + block.coefficients(smeared)


def _smeared_opening(run: RockingRun, undone_s: float, values: Mapping[str, float]) -> FloatArray | None:
    """What slow LVDTs make of an opening beyond that of their own rotation, m, put in step; None for nothing.

    The opening goes with the size of the rotation: after an impact, where that has a corner, a response is
    still on its way down while the other face opens.
    """
    theta, half = run.grid.theta, values["half_base"]
    turned, opened = theta, half * np.abs(np.sin(theta))
    for effect, response in (("slow_response", first_order), ("filter_delay", extra.bessel)):
        if tau := values.get(f"{effect}@lvdt.tau", 0.0):
            turned, opened = response(turned, tau), response(opened, tau)
    if turned is theta:
        return None
    time_s = run.grid.time_s
    return np.asarray(np.interp(time_s + undone_s, time_s, opened - half * np.abs(np.sin(turned))))


def _release(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Speed away from upright when the wall was let go."""
    return np.array([values["omega0"] + values.get("initial_velocity.omega", 0.0)])


def _base(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    follow = values["base_follow"] * run.base_lever
    found = follow * _unit(run, block, "theta", lambda: run.grid.theta)
    total: FloatArray = found + values.get("sliding.c", 0.0) * _unit(
        run, block, "slip", partial(slip_shape, run.grid)
    )
    total = total + _travel(run, block, values, of_base=True)
    if "wire_cosine@wire.kappa" in values:
        bend = values["wire_cosine@wire.kappa"] * run.base_bend_m2
        total = total + bend * _unit(run, block, "square", lambda: run.grid.theta**2)
    if higher := values.get("wire_anchor@wire.height", 0.0):
        total = total + block.coefficients(anchors_off(run.wires, run.grid.theta, higher)[1])
    return total


def _twist(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    follow = values["twist_follow"] + values.get("twist.follow", 0.0)
    found: FloatArray = follow * _unit(run, block, "theta", lambda: run.grid.theta)
    return found


def _bending(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    # What bends is told against the rotation of the reference; wires as the reference show none of it.
    wires = None if run.reference == "wire" else _difference_of(run, "wire", "lvdt", values)
    return extra.bending(run, block, values, wires)


def _turning(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    # Evenly placed wires show nothing of an error of their rotation in what turns.
    uneven = run.reference != "wire" and extra.shows_rotation(block)
    return extra.turning(run, block, values, _difference_of(run, "wire", "lvdt", values) if uneven else None)


_PREDICT = {
    "wire": _wire,
    "tiltmeter": _tiltmeter,
    "accelerometer": _accelerometer,
    "impact timing": _impact_timing,
    "swing timing": _swing_timing,
    "channel": extra.channel,
    "bending": _bending,
    "turning": _turning,
    "floor": extra.floor,
    "joint": _joint,
    "base": _base,
    "release": _release,
    "twist": _twist,
}
