"""The study of r from few peaks weighs scatters for itself alone, and draws decays that CRT holds."""

from __future__ import annotations

import numpy as np

from daq_app.rocking import estimators
from studies.restitution.few_impacts import _WEIGHTS, decay, weighted


def test_a_weight_holds_within_the_study_only() -> None:
    before = estimators._SCATTER_WEIGHTS.copy()
    _, series = decay(np.random.default_rng(1), 4, None)
    (usual,) = estimators.estimate_all([series])
    with weighted(_WEIGHTS["half-Cauchy"]):
        (narrow,) = estimators.estimate_all([series])
    assert usual.standard_error and narrow.standard_error
    assert narrow.standard_error < usual.standard_error
    np.testing.assert_array_equal(estimators._SCATTER_WEIGHTS, before)


def test_the_weight_of_the_analysis_is_power_1() -> None:
    with weighted(_WEIGHTS["power 1"]):
        weights = estimators._SCATTER_WEIGHTS / estimators._SCATTER_WEIGHTS[1]
    np.testing.assert_allclose(weights, estimators._SCATTER_WEIGHTS / estimators._SCATTER_WEIGHTS[1])


def test_four_points_hold_r_more_often_than_promised() -> None:
    rng = np.random.default_rng(2)
    drawn = [decay(rng, 4, None) for _ in range(400)]
    intervals = [e.interval95() for e in estimators.estimate_all([series for _, series in drawn])]
    holds = np.mean([i[0] <= r <= i[1] for (r, _), i in zip(drawn, intervals, strict=True) if i is not None])
    assert 0.955 <= holds <= 0.995  # 97.7 % of 2000; 400 of them are known to 0.8 %
