"""A sampling rate that is told wrong: r is right, times are not, and that is said in words."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record

TRUE_R = 0.895
OPTIONS = AnalysisOptions(bias_runs=0, fit=False, keep_series=False)


def analysed(made, told_share: float, hum_m: float = 0.0) -> TestAnalysis:
    """A sound test whose sampling rate is told too high by a share; its wires may hum at 50 Hz."""
    test = made(phi=0.35, r=TRUE_R, side=-1, seed=8, full=True)
    si = test.si.copy()
    rows = [k for k, name in enumerate(test.rig.channel_ids) if name.startswith("WP-")]
    si[rows] += hum_m * np.sin(2.0 * np.pi * 50.0 * np.arange(si.shape[1]) / test.rate_hz)
    rate = test.rate_hz * (1.0 + told_share)
    return analyse_record(TestRecord.from_array(test.rig, rate, si, time_offsets_s=test.offsets_s), OPTIONS)


@pytest.mark.parametrize(
    ("told_share", "severity"), [(0.03, "info"), (0.05, "warning"), (-0.03, "info"), (-0.05, "warning")]
)
def test_a_rate_that_the_motion_contradicts_is_told_and_r_is_right(made, told_share, severity):
    analysis = analysed(made, told_share)
    (finding,) = [f for f in analysis.findings if f.kind == "p"]

    assert (finding.family, finding.severity) == ("survey", severity)
    assert finding.size == pytest.approx(told_share, abs=0.003)
    assert "sampling rate" in finding.text and "r is not" in finding.text
    assert analysis.verdict.r == pytest.approx(TRUE_R, abs=0.001)
    assert analysis.verdict.trust == ("remarks" if severity == "warning" else "good")


def test_a_rate_that_is_right_is_not_doubted(made):
    assert not [f for f in analysed(made, 0.0, hum_m=2e-3).findings if "sampling rate" in f.text]


@pytest.mark.parametrize("told_share", [0.01, -0.01])
def test_hum_tells_a_rate_that_is_wrong_by_less_than_the_survey_knows_p(made, told_share):
    (finding,) = [f for f in analysed(made, told_share, hum_m=2e-3).findings if f.kind == "hum"]
    assert f"the sampling rate may be {told_share:+.1%} off" in finding.text
