"""Diagnosers that lack a part of the method."""

from __future__ import annotations

import numpy as np

from daq_app.gap.blind.running.diagnosers import load_diagnoser
from daq_app.gap.rocking_model.study import model_and_library, prepare
from studies.gap.ablations import rotation_alone
from tests.support.gap.simulated_campaign import simulate


def test_each_can_be_named() -> None:
    for part in ("scatter", "channels", "probes"):
        assert callable(load_diagnoser(f"studies.gap.ablations:without_{part}"))


def test_without_channels_the_features_of_the_rotation_are_left_and_predicted() -> None:
    (run,), _ = prepare(simulate({}, 1, levels=(0.35,)))
    alone = rotation_alone(run)
    model, _ = model_and_library([run])
    values = {p.name: p.value(0.0) for p in (*model.nuisance, *model.local_nuisance(run))}
    n = len(alone.features)
    assert 0 < n < len(run.features)
    predicted = [model.predict(each, values).features for each in (alone, run)]
    np.testing.assert_array_equal(predicted[0], predicted[1][:n])
