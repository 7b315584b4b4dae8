"""Tiltmeters whose time constant is not that of the rig file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.coefficients import sizes
from daq_app.gap.rocking_model.features.response import first_order
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import extract
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun
from tests.support.simulated_wall import simulate

RIG_S = 0.3


@pytest.fixture(scope="module")
def recorded() -> GapRun:
    return simulate({}, (0.25,))[0]


def _declared(run: GapRun, time_constant_s: float) -> GapRun:
    """The run with another time constant of its tiltmeters in the rig file."""
    sensors = tuple(
        replace(s, time_constant_s=time_constant_s) if s.family == "tiltmeter" else s for s in run.sensors
    )
    return replace(run, sensors=sensors)


def _coefficient(run: RockingRun, name: str) -> float:
    block = next(b for b in run.blocks if b.family == "tiltmeter")
    return float(block.values[block.names.index(name)])


@pytest.mark.parametrize("declared_s", [0.05, 0.2, 0.45, 0.6])
def test_the_time_constant_is_read_from_the_run_whatever_the_rig_file_says(
    recorded: GapRun, declared_s: float
) -> None:
    right, wrong = extract(recorded), extract(_declared(recorded, declared_s))
    measured = declared_s * (1.0 + _coefficient(wrong, "time constant"))
    assert measured == pytest.approx(RIG_S, rel=0.03)
    assert _coefficient(wrong, "gain") == pytest.approx(_coefficient(right, "gain"), abs=2e-4)


def test_a_clock_that_is_off_shows_another_time_constant_with_the_gain_as_it_is(recorded: GapRun) -> None:
    run = extract(recorded)
    model = RockingModel(run.survey)
    values = {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}
    block = next(b for b in run.blocks if b.family == "tiltmeter")
    first = len(run.features) - sum(len(b.names) for b in run.blocks)
    start = first + sum(len(b.names) for b in run.blocks[: run.blocks.index(block)])
    off = slice(start, start + len(block.names))
    late = model.predict(run, values | {"clock.error": -0.03}).features
    change = (late - model.predict(run, values).features)[off]
    slow = RIG_S * (1.0 + _coefficient(run, "time constant"))
    theta = run.grid.theta
    slower = block.coefficients(first_order(theta, slow / 0.97) - first_order(theta, slow))
    assert change == pytest.approx(slower, rel=0.05, abs=3e-4)


def test_a_delay_of_a_sample_is_explained_by_how_channels_are_sampled(recorded: GapRun) -> None:
    """A converter's filter delays by half a sample or more: that is no gain, no drift and no free form."""
    late = replace(recorded, channels=recorded.channels.copy())
    chosen = recorded.indices("tiltmeter")
    late.channels[chosen] = np.roll(recorded.channels[chosen], 1, axis=1)
    late.channels[chosen, 0] = recorded.channels[chosen, 0]
    before, after = extract(recorded), extract(late)
    delay = 1.0 / recorded.rate_hz
    block = next(b for b in after.blocks if b.family == "tiltmeter")
    explained = delay * block.systematic["tilt_delay"]
    for name, value in zip(block.names, explained, strict=True):
        shown = _coefficient(after, name) - _coefficient(before, name)
        assert value == pytest.approx(shown, abs=0.3 * sizes()["tiltmeter", name].scatter)
    allowed = next(p for p in RockingModel(after.survey).nuisance if p.name == "tilt_delay")
    assert delay < 2.0 * allowed.sd < 1e-3, "a sound tiltmeter's, and none that is late by milliseconds"
