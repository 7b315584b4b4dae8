"""Tiltmeters: slow, accurate, and the only ones to see a base that turns as a whole."""

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
from daq_app.gap.rocking_model.features.differences import base_rotation, difference_of, face_gain, of_shapes
from daq_app.gap.rocking_model.features.family import (
    Scene,
    SensorFamily,
    Size,
    with_crosstalk,
    with_systematic,
)
from daq_app.gap.rocking_model.features.response import slow_response
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.shapes import Term
from daq_app.gap.rocking_model.motion.crosstalk import crosstalk
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, gridded
from daq_app.gap.rocking_model.records import Survey
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, SHORTEST_TILT_S, SKEW_S, TILT_CONSTANT

_ROUNDS = 12
_DELAY = "tilt_delay"
"""Parameter of how much later the tiltmeters are sampled than the reference."""


def _tilt_block(scene: Scene) -> Block | None:
    """Gain, drift and time constant of the tiltmeters along x against the reference rotation.

    The time constant is estimated for each instrument in each run, so that its error, which a data sheet
    leaves open by a half, spoils neither the gain nor the drift.
    """
    run, grid = scene.run, scene.grid
    chosen = [i for i in run.indices("tiltmeter", "x") if run.reads(i)]
    if not chosen:
        return None
    pick = scene.rocking | (grid.time_s <= 0)
    measured = [gridded(run, i) for i in chosen]
    nominal = np.array([max(run.sensors[i].time_constant_s, SHORTEST_TILT_S) for i in chosen])
    slow = np.array([_time_constant(scene, m, s, pick) for m, s in zip(measured, nominal, strict=True)])
    block = regress(
        "tiltmeter",
        np.mean(measured, axis=0) - slow_response(grid.theta, slow),
        _columns(scene, slow, nominal),
        pick,
        absorbed=("zero", "start"),
    )
    block = with_crosstalk(block, crosstalk(run, chosen).mean(axis=0))
    if block is None:
        return None
    block = with_systematic(block, _DELAY, -np.gradient(slow_response(grid.theta, slow), 1.0 / GRID_HZ))
    values = block.values.copy()
    values[block.names.index("time constant")] += float(np.mean(slow / nominal - 1.0))
    return replace(block, values=values, time_constants_s=tuple(slow.tolist()))


def _columns(scene: Scene, slow: FloatArray, nominal: FloatArray) -> dict[str, tuple[FloatArray, str]]:
    """Shapes in which tiltmeters of the time constants `slow`, s, differ from their prediction."""
    time_s, theta = scene.grid.time_s, scene.grid.theta
    expected = slow_response(theta, slow)
    # A tiltmeter is at rest only some time constants after the wall: its own last value is no zero.
    return {
        "zero": (np.ones_like(expected), "rad"),
        "gain": (expected, "1"),
        "time constant": (_per_time_constant(theta, slow, nominal), "1"),
        "drift": (time_s, "rad/s"),
        "start": (np.exp(-(time_s - time_s[0]) / float(slow.mean())), "rad"),
    }


def _per_time_constant(theta: FloatArray, slow: FloatArray, nominal: FloatArray) -> FloatArray:
    """d response / d (relative error of the time constants), rad, shape (m,)."""
    step = 0.03
    ahead, behind = slow_response(theta, slow + step * nominal), slow_response(theta, slow - step * nominal)
    return (ahead - behind) / (2.0 * step)


def _time_constant(scene: Scene, measured: FloatArray, nominal_s: float, pick: NDArray[np.bool_]) -> float:
    """Time constant of one tiltmeter, s, by least squares with the other shapes free (Gauss–Newton)."""
    slow, nominal = np.array([nominal_s]), np.array([nominal_s])
    for _ in range(_ROUNDS):
        columns = _columns(scene, slow, nominal)
        design = np.column_stack([column[pick] for column, _ in columns.values()])
        difference = (measured - slow_response(scene.grid.theta, slow))[pick]
        step = np.linalg.lstsq(design, difference, rcond=None)[0][list(columns).index("time constant")]
        slow = slow + np.clip(step * nominal_s, -0.5 * slow, 0.5 * slow)
        if abs(step) < 1e-4:
            break
    return float(slow[0])


def _predict(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    slow = np.array(block.time_constants_s)

    def seen(shape: FloatArray) -> FloatArray:
        return slow_response(shape, slow)

    # Each face of the joint has its own calibration: the slow response makes their difference a drift.
    first, second = values["cal_wire"], values["cal_wire"]
    if run.reference == "lvdt":
        first, second = face_gain(values, "face_a"), face_gain(values, "face_b")
    shapes: tuple[Term, ...] = (
        (values["cal_tiltmeter"], "theta", lambda: seen(theta)),
        (-first, "positive", lambda: seen(np.maximum(theta, 0.0))),
        (-second, "negative", lambda: seen(np.minimum(theta, 0.0))),
    )
    coefficients = of_shapes(run, block, shapes) + base_rotation(run, block, values)
    series = difference_of(run, "tiltmeter", run.reference, values)
    if series is not None:
        coefficients = coefficients + block.coefficients(seen(series))
    # A clock that is off shows the time constant as another one.
    response = values["tilt_response"] + 1.0 / (1.0 + values.get("clock.error", 0.0)) - 1.0
    coefficients[block.names.index("time constant")] += response
    return coefficients


def _observe(scene: Scene) -> Iterator[Block | None]:
    yield _tilt_block(scene)


def _priors(survey: Survey) -> tuple[Parameter, ...]:
    return (
        known("cal_tiltmeter", CALIBRATION / math.sqrt(2), "1", "calibration of the tiltmeters"),
        known(_DELAY, 2.0 * SKEW_S, "s", "how much later the tiltmeters are sampled than the reference"),
        known("tilt_response", TILT_CONSTANT, "1", "relative error of the tiltmeters' time constant"),
    )


FAMILY = SensorFamily(
    _observe,
    {"tiltmeter": _predict},
    {
        ("tiltmeter", "gain"): Size(3e-4),
        ("tiltmeter", "time constant"): Size(1e-3),
        ("tiltmeter", "drift"): Size(2e-6, 6e-6, "rad/s"),
    },
    _priors,
)
