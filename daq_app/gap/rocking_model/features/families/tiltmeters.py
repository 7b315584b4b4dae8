"""Tiltmeters: slow, accurate, and the only ones to see a base that turns as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block, regress
from daq_app.gap.rocking_model.features.differences import (
    base_rotation,
    difference_of,
    unit_coefficients,
)
from daq_app.gap.rocking_model.features.family import Scene, SensorFamily, Size
from daq_app.gap.rocking_model.features.response import first_order
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.motion_grid import GRID_HZ, coarse
from daq_app.gap.rocking_model.motion.rotation import (
    zeroed,
)
from daq_app.gap.rocking_model.records import Survey
from daq_app.gap.rocking_model.tolerances import CALIBRATION


def _tilt_block(scene: Scene) -> Block | None:
    run, grid = scene.run, scene.grid
    chosen = [i for i in run.indices("tiltmeter", "x") if np.all(np.isfinite(run.channels[i]))]
    if not chosen:
        return None
    slow = run.sensors[chosen[0]].time_constant_s
    measured = np.mean([coarse(zeroed(run, i), run.rate_hz) for i in chosen], axis=0)
    expected = first_order(grid.theta, slow)
    # A tiltmeter is at rest only some time constants after the wall: its own last value is no zero.
    columns = {
        "zero": (np.ones_like(expected), "rad"),
        "gain": (expected, "1"),
        "lag": (-np.gradient(expected, 1 / GRID_HZ), "s"),
        "drift": (grid.time_s, "rad/s"),
        "start": (np.exp(-(grid.time_s - grid.time_s[0]) / max(slow, 0.05)), "rad"),
    }
    wide = scene.rocking | (grid.time_s <= 0)
    return regress("tiltmeter", measured - expected, columns, wide, absorbed=("zero", "start"))


def _predict(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    theta = run.grid.theta
    found = values["cal_tiltmeter"] * unit_coefficients(run, block, "theta", lambda: first_order(theta, 0.3))
    # Each face of the joint has its own calibration: the slow response makes their difference a drift.
    first, second = ("face_a", "face_b") if run.reference == "lvdt" else ("cal_wire", "cal_wire")
    positive = unit_coefficients(run, block, "positive", lambda: first_order(np.maximum(theta, 0.0), 0.3))
    negative = unit_coefficients(run, block, "negative", lambda: first_order(np.minimum(theta, 0.0), 0.3))
    found = found - values[first] * positive - values[second] * negative
    if "compliance.phi" in values:
        found = found + base_rotation(run, block, values)
    series = difference_of(run, "tiltmeter", run.reference, values)
    if series is not None:
        found = found + block.coefficients(first_order(series, 0.3))
    # A clock that is off shows the time constant as another one.
    response = values["tilt_response"] + 0.3 / (1.0 + values.get("clock.error", 0.0)) - 0.3

    def slower() -> FloatArray:
        difference: FloatArray = (first_order(theta, 0.31) - first_order(theta, 0.29)) / 0.02
        return difference

    return found + response * unit_coefficients(run, block, "response", slower)


def _observe(scene: Scene) -> Iterator[Block | None]:
    yield _tilt_block(scene)


def _priors(survey: Survey) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "cal_tiltmeter",
            0.0,
            CALIBRATION / math.sqrt(2),
            "1",
            meaning="calibration of the tiltmeters",
            linear=True,
        ),
        Parameter(
            "tilt_response", 0.0, 0.01, "s", meaning="error of the tiltmeters' time constant", linear=True
        ),
    )


FAMILY = SensorFamily(
    _observe,
    {"tiltmeter": _predict},
    {
        ("tiltmeter", "gain"): Size(3e-4),
        ("tiltmeter", "lag"): Size(1e-4, 3e-4, "s"),
        ("tiltmeter", "drift"): Size(2e-6, 6e-6, "rad/s"),
    },
    _priors,
    probes={"tiltmeter": "sensor"},
)
