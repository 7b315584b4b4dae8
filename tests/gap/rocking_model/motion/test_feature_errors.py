"""What features are said to be off by is what they are off by."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import extract
from daq_app.gap.rocking_model.motion.release_speed import release_speed
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.run_cache import RunCache
from tests.support.simulated_wall import simulate

P, RATE_HZ, NOISE_RAD = 2.85, 4000.0, 2.5e-5


@pytest.fixture(scope="module")
def run() -> RockingRun:
    return extract(simulate({}, (0.25,))[0])


@pytest.mark.parametrize("observable", ["fall time 1", "rise time 1", "time over the top"])
def test_the_error_of_a_measured_peak_is_in_every_time_that_hangs_on_it(
    run: RockingRun, observable: str
) -> None:
    """Times are predicted from the measured peak: one that is off moves the crossings below it."""
    model, swings = RockingModel(run.survey), run.swings
    values = {p.name: p.mean for p in model.nuisance}
    values |= {p.name: p.mean for p in model.local_nuisance(run)}
    off = replace(swings, peak_rad=swings.peak_rad + np.sign(swings.peak_rad) * swings.peak_sd)
    moved = np.abs(
        model.predict(replace(run, swings=off, cache=RunCache()), values).features
        - model.predict(replace(run, cache=RunCache()), values).features
    )
    count = swings.levels.shape[1]
    checked = 0
    for i, label in enumerate(run.features.labels[: len(run.places)]):
        if label.observable != observable:
            continue
        own = 0.0
        for k, place in (run.places[i, :2], run.places[i, 2:]):
            sds = swings.fall_sd[k] if place < count else swings.rise_sd[k]
            own += float(sds[place % count]) ** 2
        beyond = np.sqrt(run.features.sd[i] ** 2 - own)
        assert beyond == pytest.approx(moved[i], rel=0.35)
        checked += 1
    assert checked > 5


def test_no_speed_at_the_release_is_as_likely_as_it_is_said_to_be() -> None:
    """Small speeds show in v²/2a alone: the curvature at the best one makes none look unlikely too often."""
    rng = np.random.default_rng(0)
    held = 0.03
    pull = P**2 * np.sin(0.157 - held)
    time_s = np.arange(int(2.4 * RATE_HZ)) / RATE_HZ - 2.0
    theta = held - pull * (np.cosh(P * np.maximum(time_s, 0.0)) - 1.0) / P**2
    survey = cast(Any, SimpleNamespace(p_rad_s=P))
    still = SimpleNamespace(rotation_sd=0.0, course=lambda time_s: np.zeros_like(time_s))
    off = []
    for _ in range(40):
        swings = SimpleNamespace(release_s=2.0 + 2e-3 * rng.normal(), peak_rad=np.array([held]), held=still)
        seen = theta + NOISE_RAD * rng.standard_normal(theta.size)
        found = release_speed(seen, NOISE_RAD, cast(Any, swings), survey, RATE_HZ)
        assert found is not None
        off.append(found[0] / found[1])
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.15
    assert np.abs(off).max() < 3.0
