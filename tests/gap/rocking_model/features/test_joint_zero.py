"""A wall that comes to rest a little off upright: what that makes of the joint's opening."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import extract
from daq_app.gap.rocking_model.motion.rotation import TAIL_S
from daq_app.gap.rocking_model.prediction.model import RockingModel
from tests.support.simulated_wall import simulate

OFF_UPRIGHT_RAD = 2e-5


def _coefficient(run: RockingRun) -> float:
    block = next(b for b in run.blocks if b.family == "joint")
    return float(block.values[block.names.index("pivot left against right")])


def _predicted(run: RockingRun, zero: float) -> float:
    model = RockingModel(run.survey)
    values = {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}
    features = model.predict(run, {**values, "zero": zero}).features
    place = [(label.channel, label.observable) for label in run.features.labels]
    return float(features[place.index(("joint", "pivot left against right"))])


def test_a_wall_that_rests_off_upright_steps_from_side_to_side_of_its_joint() -> None:
    """The face that is open at rest is zeroed with its opening: it reads less than nothing once closed."""
    (upright,) = simulate({}, levels=(0.15,))
    tilted = replace(upright, channels=upright.channels.copy())
    tail = slice(-round(TAIL_S * upright.rate_hz), None)
    open_face = [i for i in upright.indices("lvdt") if upright.sensors[i].position_m[0] < 0]
    width = 2.0 * upright.survey.half_base_m
    tilted.channels[open_face, tail] += width * OFF_UPRIGHT_RAD
    before, after = extract(upright), extract(tilted)
    shown = _coefficient(after) - _coefficient(before)
    assert abs(shown) > 1e-4, "else there would be nothing to explain"
    expected = _predicted(after, -OFF_UPRIGHT_RAD) - _predicted(after, 0.0)
    assert expected == pytest.approx(shown, rel=0.1)
    assert np.sign(shown) == 1.0
