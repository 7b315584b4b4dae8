"""The study of r from few peaks weighs scatters as the analysis does, and draws decays that CRT holds."""

from __future__ import annotations

import numpy as np

from daq_app.rocking import estimators
from studies.restitution.few_impacts import decay, scatter_weights


def test_a_weight_that_falls_faster_makes_an_error_smaller() -> None:
    _, series = decay(np.random.default_rng(1), 4, None)
    (usual,) = estimators.estimate_all([series])
    (narrow,) = estimators.estimate_all([series], scatter_weights("half-Cauchy"))
    assert usual.standard_error and narrow.standard_error
    assert narrow.standard_error < usual.standard_error


def test_the_weight_of_the_analysis_is_power_1() -> None:
    weights = scatter_weights("power 1")
    np.testing.assert_allclose(
        weights / weights[1], estimators.SCATTER_WEIGHTS / estimators.SCATTER_WEIGHTS[1]
    )


def test_four_points_hold_r_more_often_than_promised() -> None:
    rng = np.random.default_rng(2)
    drawn = [decay(rng, 4, None) for _ in range(400)]
    intervals = [e.interval95() for e in estimators.estimate_all([series for _, series in drawn])]
    holds = np.mean([i[0] <= r <= i[1] for (r, _), i in zip(drawn, intervals, strict=True) if i is not None])
    assert 0.955 <= holds <= 0.995  # 97.7 % of 2000; 400 of them are known to 0.8 %
