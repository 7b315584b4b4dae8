"""Walls with another α to either side: the whole fit finds both, and what the wall leans by."""

from __future__ import annotations

from pathlib import Path

import pytest

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, analyse_record
from studies.restitution.laboratory import draw_test

RIG = load_rig(Path(__file__).parents[2] / "configs" / "fr1.toml")
SEED = 6101


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [("base_tilt", {"beta": 0.004}), ("eccentric_mass", {"e": 0.007}), ("alpha_asymmetry", {"delta": 0.005})],
)
def test_a_wall_with_another_alpha_to_either_side_is_fitted_as_one(effect, parameters):
    test = draw_test(RIG, SEED, effects={effect: parameters})
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))
    fit, truth = analysis.fit, test.truth

    assert analysis.verdict.trust == "remarks"
    assert fit.explains_the_motion
    assert [(f.kind, f.size) for f in analysis.findings if f.severity == "warning"] == [
        ("lean", fit.lean_rad)
    ]
    assert 0.003 < abs(fit.lean_rad) < 0.006
    assert fit.p_rad_s == pytest.approx(truth["p_rad_s"], abs=2.0 * fit.sigma_p_rad_s)
    assert fit.sigma_p_rad_s < 0.0025 * fit.p_rad_s
    assert fit.alpha_rad == pytest.approx(truth["alpha_rad"], rel=0.005)
    assert fit.r == pytest.approx(truth["restitution"], abs=0.002)


def test_a_wall_that_leans_as_ordinary_ones_do_is_not_named():
    test = draw_test(RIG, SEED, effects={"base_tilt": {"beta": 0.001}})
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))
    assert analysis.fit.lean_rad == pytest.approx(-0.001, abs=2e-4)
    assert not [finding for finding in analysis.findings if finding.severity == "warning"]
