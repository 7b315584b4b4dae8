"""A base whose friction does not hold it between impacts: named with its friction, on walls of an engine."""

from __future__ import annotations

import math

import numpy as np
import pytest

from daq_app.rocking import AnalysisOptions, TestAnalysis, TestRecord, analyse_record
from daq_app.rocking.families.base.slip import HalfCycleSlips, find_slip
from daq_app.rocking.theory.friction import slips_below
from daq_app.runfile import open_run
from tests.support.gap.blind_case import slippery_base

ALPHA, P, R0 = 0.215, 2.2, 1.525
OPTIONS = AnalysisOptions(fit=False, bias_runs=0, keep_series=False)


@pytest.fixture(scope="module")
def slippery(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[TestAnalysis], float]:
    """Tests from the highest levels of a wall that a contact engine moves, and the friction of its base."""
    pytest.importorskip("mujoco", reason="the extra 'contact' is not installed")
    files, friction = slippery_base(tmp_path_factory.mktemp("slippery"), runs=4, place=2)
    analyses = []
    for file in files[2:]:
        with open_run(file) as run:
            analyses.append(analyse_record(TestRecord.from_run(run, run.rig), OPTIONS))
    return analyses, friction


def test_it_is_named_with_its_friction_and_r_is_that_of_the_lvdts(
    slippery: tuple[list[TestAnalysis], float],
) -> None:
    analyses, friction = slippery
    for analysis in analyses:
        (finding,) = [f for f in analysis.findings if f.kind == "slip"]
        said = float(finding.text.split()[2])
        assert said == pytest.approx(friction, abs=0.011)
        assert (finding.family, finding.treatment) == ("wires", "left out")
        assert finding.size > 1e-3
        assert analysis.verdict.used == ("LVDTs",)
        # What slips do to half-cycles and impacts is no hop and no pause.
        assert not {"hop", "pause", "loss", "duration", "late", "slow"} & {f.kind for f in analysis.findings}


def _seen(along_m: np.ndarray, turn_rad: np.ndarray, peaks: np.ndarray) -> HalfCycleSlips:
    speeds = P * np.sqrt(2.0 * (np.cos(ALPHA - peaks) - math.cos(ALPHA)))
    return HalfCycleSlips(np.resize([1.0, -1.0], peaks.size), peaks, speeds, along_m, turn_rad)


def test_delays_and_play_of_wires_are_no_slips() -> None:
    rng = np.random.default_rng(4)
    peaks = np.geomspace(0.08, 0.002, 18)
    noise = 2e-5 * rng.standard_normal(peaks.size)
    still = np.zeros_like(peaks)
    late = 2e-3 * np.sqrt(peaks)
    for along in (noise, late + noise, 4e-4 + noise, late - 4e-4 + noise):
        assert find_slip(_seen(along, still + noise, peaks), ALPHA, P, R0) is None


def test_a_slip_of_one_edge_and_a_turn_are_told_apart() -> None:
    rng = np.random.default_rng(5)
    peaks = np.geomspace(0.08, 0.002, 18)
    law = 8.0 * slips_below(0.012, peaks, ALPHA, P).slip
    noise = 2e-5 * rng.standard_normal((2, peaks.size))
    right = np.resize([1.0, 0.0], peaks.size)
    one = find_slip(_seen(right * law + noise[0], noise[1], peaks), ALPHA, P, R0)
    assert one is not None and not one.turns
    assert one.along[1] == pytest.approx(8.0, rel=0.2) and abs(one.along[0]) < 1.0

    corner = find_slip(_seen(law + noise[0], -1.4 * law + noise[1], peaks), ALPHA, P, R0)
    assert corner is not None and corner.turns
    assert corner.turning / corner.along == pytest.approx([-1.4, -1.4], rel=0.1)
