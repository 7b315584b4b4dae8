"""Accelerometers: gravity and inertia along x, and the instants of impacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.parameters import known
from daq_app.gap.rocking_model.features.block import Block, regress, scalar_block
from daq_app.gap.rocking_model.features.differences import base_rotation, own_gain
from daq_app.gap.rocking_model.features.family import (
    Scene,
    SensorFamily,
    Size,
    with_crosstalk,
    with_systematic,
)
from daq_app.gap.rocking_model.features.response import later
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.crosstalk import crosstalk
from daq_app.gap.rocking_model.motion.impact_timing import acceleration_delay
from daq_app.gap.rocking_model.motion.rigid_body import across_axes
from daq_app.gap.rocking_model.motion.rotation import gridded
from daq_app.gap.rocking_model.motion.sway import sway
from daq_app.gap.rocking_model.motion.swing_timing import swing_delay
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, Survey
from daq_app.gap.rocking_model.tolerances.motion import FREE_FROM_S, HELD_UNTIL_S
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, MOUNT_RAD
from daq_app.gap.rocking_model.tolerances.walls import MIDDLE_OF_IMPACT_S

_TURNED = "turned_accelerometers"
"""Parameter of the mean angle by which the accelerometers along x are turned on their mounts, rad."""


def _acceleration_block(scene: Scene) -> Block | None:
    run, grid = scene.run, scene.grid
    last = grid.impact_s[-1] if grid.impact_s.size else 0.0
    # While the wall is held there is gravity alone: its gain is then known apart from inertia's.
    pick = (scene.held & (grid.time_s < -HELD_UNTIL_S)) | (
        scene.rocking & (grid.time_s > FREE_FROM_S) & (grid.time_s < last) & ~grid.near_impact
    )
    chosen = run.steady_accelerometers("x")
    if not chosen:
        return None
    # Means over 5 ms and no filter: one that rings carries an impact past the samples left out around it.
    measured = np.mean([gridded(run, i) for i in chosen], axis=0)
    x, _, height = run.positions(chosen).mean(axis=0).tolist()
    arm = x - np.sign(grid.theta) * run.survey.half_base_m
    gravity, inertia = -GRAVITY_M_S2 * np.sin(grid.theta), height * grid.alpha
    # The held wall sways: only the mean of that part, less the sway's, says what gravity alone shows.
    held = pick & (grid.time_s < 0.0)
    leaked = crosstalk(run, chosen).mean(axis=0)
    if held.any():
        leaked[held] = leaked[held].mean()
        # Its mean is the change of speed over the hold: 1 % of gravity for a few mrad/s, and well measured.
        before = grid.time_s < 0.0
        swaying = height * float(sway(grid.raw, before)[1][held[before]].mean())
        measured[held], gravity[held] = measured[held].mean() - swaying, gravity[held].mean()
    expected = gravity + inertia - grid.omega**2 * arm
    columns = {
        "zero": (np.ones_like(expected), "m/s²"),
        "gain of gravity": (gravity, "1"),
        "gain of inertia": (inertia, "1"),
    }
    # No lag here: between impacts the specific force hardly changes. The impacts themselves tell it.
    block = with_crosstalk(regress("accelerometer", measured - expected, columns, pick, ("zero",)), leaked)
    return block and with_systematic(block, _TURNED, across_axes(run, grid, chosen).mean(axis=0))


def _predict(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    gain = values["cal_accelerometer"] + values.get("gain@accelerometer.error", 0.0)
    name = run.reference
    reference = own_gain(run, values) + values.get(f"gain@{name}.error", 0.0)
    clock = 1.0 + values.get("clock.error", 0.0)
    ratio = (1.0 + gain) / (1.0 + reference)
    gains = {"gain of gravity": ratio - 1.0, "gain of inertia": ratio / clock**2 - 1.0}
    coefficients = np.array([gains.get(name, 0.0) for name in block.names])
    # The base turns slowly: of its rotation the accelerometers show gravity alone, as in the simulator.
    return coefficients - GRAVITY_M_S2 * base_rotation(run, block, values)


def _predict_impact_timing(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """Accelerometers against the reference rotation: their own delay less that of the reference."""
    return np.array([values["onset"] + later("accelerometer", run.reference, values)])


def _predict_swing_timing(run: RockingRun, block: Block, values: Mapping[str, float]) -> FloatArray:
    """The same between impacts, whose form does not matter there."""
    return np.array([later("accelerometer", run.reference, values)])


def _observe(scene: Scene) -> Iterator[Block | None]:
    yield _acceleration_block(scene)
    of_impacts = acceleration_delay(scene.run, scene.grid)
    if of_impacts is not None:
        yield scalar_block("impact timing", (("delay", "s", *of_impacts),), scene.grid)
    of_swings = swing_delay(scene.run, scene.grid, None if of_impacts is None else of_impacts[0])
    if of_swings is not None:
        yield scalar_block("swing timing", (("delay", "s", *of_swings),), scene.grid)


def _priors(survey: Survey) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "cal_accelerometer", 0.0, CALIBRATION / 2, "1", meaning="calibration of the accelerometers"
        ),
        known(
            _TURNED, MOUNT_RAD / 2, "rad", "mean angle by which the accelerometers are turned on their mounts"
        ),
        known("onset", 1e-3, "s", "middle of the impact after the contact", mean=MIDDLE_OF_IMPACT_S),
    )


FAMILY = SensorFamily(
    _observe,
    {
        "accelerometer": _predict,
        "impact timing": _predict_impact_timing,
        "swing timing": _predict_swing_timing,
    },
    {
        ("accelerometer", "gain of gravity"): Size(1e-2),
        ("accelerometer", "gain of inertia"): Size(1e-3, 1e-3, "1"),
        ("impact timing", "delay"): Size(1e-4),
        ("swing timing", "delay"): Size(1e-4, 2e-4, "s"),
    },
    _priors,
)
