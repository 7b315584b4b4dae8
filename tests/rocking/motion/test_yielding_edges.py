"""Walls whose edges yield: p and α of the whole fit hold what that makes of them, and it is told."""

from __future__ import annotations

import functools

import pytest

from daq_app.rocking import AnalysisOptions, analyse_record
from studies.restitution.yielding import strip_test

SEED = 7000
YIELDS_M = 0.003


@functools.cache
def analysed(width_m):
    test = strip_test(SEED, width_m)
    return test, analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))


def warnings(analysis):
    return [finding.kind for finding in analysis.findings if finding.severity == "warning"]


@pytest.mark.parametrize("width_m", [0.0, YIELDS_M])
def test_p_alpha_and_r_are_those_of_the_body_on_sharp_edges(width_m):
    test, analysis = analysed(width_m)
    fit, truth = analysis.fit, test.truth

    assert fit.p_rad_s == pytest.approx(truth["p_rad_s"], abs=2.0 * fit.sigma_p_rad_s)
    assert fit.alpha_rad == pytest.approx(truth["alpha_rad"], abs=2.0 * fit.sigma_alpha_rad)
    assert fit.r == pytest.approx(truth["restitution"], abs=0.001)
    assert fit.sigma_p_rad_s < 0.002 * fit.p_rad_s
    assert fit.sigma_alpha_rad < 0.004 * fit.alpha_rad


def test_edges_that_yield_are_named_and_leave_r_as_good():
    _, analysis = analysed(YIELDS_M)
    (finding,) = [f for f in analysis.findings if f.severity == "warning"]

    assert (finding.kind, finding.unit) == ("edge", "m")
    assert finding.size == pytest.approx(YIELDS_M / 2.0, abs=0.0007)
    assert analysis.verdict.trust == "remarks"
    assert finding.text in analysis.verdict.reasons


def test_sharp_edges_are_not_named():
    _, analysis = analysed(0.0)
    assert "edge" not in warnings(analysis)
    assert abs(analysis.fit.inset_rad) < 2.0 * analysis.fit.sigma_inset_rad
