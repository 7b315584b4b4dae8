"""Tiltmeters that come a sample late, beside a time constant that is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import extract
from daq_app.gap.rocking_model.prediction.model import RockingModel
from tests.support.simulated_wall import simulate


def _tilt(run: RockingRun, values: dict[str, float] | None = None) -> np.ndarray:
    """Coefficients of the tiltmeters, as seen or as predicted with some values, (k,)."""
    block = next(b for b in run.blocks if b.family == "tiltmeter")
    if values is None:
        return block.values
    model = RockingModel(run.survey)
    usual = {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}
    features = model.predict(run, {**usual, **values}).features
    places = [(label.channel, label.observable) for label in run.features.labels]
    return np.array([features[places.index(("tiltmeter", name))] for name in block.names])


def test_a_sample_s_delay_of_sound_tiltmeters_is_a_bias_and_no_time_constant() -> None:
    """A converter's filter delays by half a sample or more: with the time constant alone to explain that,
    runs without anything missing were given to a free form of the tiltmeters."""
    (run,) = simulate({}, levels=(0.15,))
    late = replace(run, channels=run.channels.copy())
    chosen = run.indices("tiltmeter")
    late.channels[chosen] = np.roll(run.channels[chosen], 1, axis=1)
    late.channels[chosen, 0] = run.channels[chosen, 0]
    before, after = extract(run), extract(late)
    shown = _tilt(after) - _tilt(before)
    delay = 1.0 / run.rate_hz
    explained = _tilt(after, {"bias_tiltmeter_lag": delay}) - _tilt(after, {})
    lag = next(b for b in after.blocks if b.family == "tiltmeter").names.index("lag")
    assert shown[lag] == pytest.approx(delay, rel=0.1)
    assert explained == pytest.approx(shown, abs=0.15 * delay)
    bias = next(p for p in RockingModel(run.survey).nuisance if p.name == "bias_tiltmeter_lag")
    assert delay < 2.0 * bias.sd < 0.001, "a sound tiltmeter's, and none that is late by milliseconds"
