"""Walls that are no rigid block with one r: what is said of them, and that sound ones are left alone."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from daq_app.config import load_rig, plan_tasks
from daq_app.rocking import AnalysisOptions, LiveAnalyser, TestAnalysis, analyse_record
from daq_app.rocking.theory.block import RigidBlock
from sim_hardware.direct import synthesise_test
from studies.restitution.faults import Fault
from studies.restitution.laboratory import LaboratoryTest, draw_test
from studies.restitution.walls import SimulatedEffect, ringing_test

ROOT = Path(__file__).parents[2]
RIG = load_rig(ROOT / "configs" / "fr1.toml")
SEED = 6101


def drawn(effects: dict[str, dict[str, float]], seed: int = SEED) -> tuple[LaboratoryTest, TestAnalysis]:
    return _drawn(json.dumps(effects), seed)


@cache
def _drawn(effects: str, seed: int) -> tuple[LaboratoryTest, TestAnalysis]:
    test = draw_test(RIG, seed, effects=json.loads(effects))
    return test, analyse_record(test.record(), AnalysisOptions(fit=False, bias_runs=0, keep_series=False))


def kinds(analysis: TestAnalysis) -> set[str]:
    return {finding.kind for finding in analysis.findings}


@pytest.mark.parametrize("seed", [SEED, SEED + 1, SEED + 2])
def test_a_rigid_block_in_an_ordinary_laboratory_is_not_doubted(seed: int):
    _, analysis = drawn({}, seed)

    assert analysis.verdict.trust == "good", analysis.verdict.reasons


@pytest.mark.parametrize(
    ("effect", "parameters", "kind", "word"),
    [
        ("coulomb", {"mu": 0.02}, "loss", "friction"),
        ("viscous", {"zeta": 0.02}, "loss", "drag"),
        ("restitution_asymmetry", {"d": 0.02}, "side", "edges differ"),
        ("restitution_slope", {"k": 0.3}, "speed", "from"),
        ("dwell", {"tau": 0.002}, "pause", "impacts take"),
        ("bounce", {"tau": 0.002}, "hop", "hops"),
        ("bounce", {"tau": 0.008}, "hop", "hops"),
        ("winkler", {"theta_c": 2e-4}, "duration", "yields"),
    ],
)
def test_what_no_rigid_block_does_is_named_and_r_doubted(effect, parameters, kind, word):
    _, analysis = drawn({effect: parameters})

    assert kind in kinds(analysis)
    assert analysis.verdict.trust == "doubtful"
    assert any(word in reason for reason in analysis.verdict.reasons)


def test_a_hop_is_named_where_pauses_that_fall_with_the_speed_scatter_widely_about_their_mean():
    test, analysis = drawn({"bounce": {"tau": 0.008}}, 6202)
    low, high = analysis.verdict.interval95

    assert "hop" in kinds(analysis)
    assert analysis.verdict.trust == "doubtful"
    assert low <= test.truth["restitution"] <= high


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("coulomb", {"mu": 0.02}),
        ("viscous", {"zeta": 0.02}),
        ("bounce", {"tau": 0.002}),
        ("bounce", {"tau": 0.008}),
    ],
)
def test_the_interval_of_an_r_with_friction_or_hops_reaches_to_the_r_of_the_impacts(effect, parameters):
    test, analysis = drawn({effect: parameters})
    low, high = analysis.verdict.interval95
    r = test.truth["restitution"]

    assert abs(analysis.verdict.r - r) > 0.005
    assert low <= r <= high


def test_an_r_that_scatters_widely_is_remarked_and_its_interval_holds_the_mean_of_many_impacts():
    test, analysis = drawn({"restitution_scatter": {"sigma": 0.02}})
    low, high = analysis.verdict.interval95

    assert kinds(analysis) >= {"scatter"}
    assert analysis.verdict.trust == "remarks"
    assert low <= test.truth["restitution"] <= high


def test_an_r_that_scatters_most_likely_is_remarked_where_it_is_known_worse_than_may_go_unsaid():
    """Its scatter might be an ordinary one in more than one test of twenty."""
    _, analysis = drawn({"restitution_scatter": {"sigma": 0.01}}, 6100)
    estimates = analysis.estimates["eav"], analysis.estimates["crt"]

    assert min(estimate.least_scatter for estimate in estimates) < 0.006
    assert min(estimate.standard_error for estimate in estimates) > 0.002
    assert kinds(analysis) >= {"scatter"}
    assert analysis.verdict.trust == "remarks"


def test_a_slow_release_is_remarked_and_r_by_peaks_and_speeds_begins_after_it():
    _, slow = drawn({"slow_release": {"tau": 0.1}})
    _, sound = drawn({})

    assert kinds(slow) >= {"release"}
    assert slow.verdict.trust == "remarks"
    assert {point.first for point in slow.estimates["crt"].points} == {1}
    assert min(point.first for point in slow.estimates["eav"].points) == 2
    assert math.isnan(slow.half_cycles[1].sigma_speed_before_rad_s)
    assert slow.estimates["crt"].r == pytest.approx(sound.estimates["crt"].r, abs=0.001)


def test_r_that_changes_with_speed_by_less_than_is_named_is_in_the_stated_error_of_every_method():
    _, changing = drawn({"restitution_slope": {"k": 0.05}})
    _, sound = drawn({})

    for method in ("eav", "crt"):
        assert changing.estimates[method].standard_error > sound.estimates[method].standard_error


def test_a_large_change_of_r_with_speed_is_named_where_chance_seldom_makes_it():
    _, analysis = drawn({"restitution_slope": {"k": 0.05}}, 6203)

    assert "speed" in kinds(analysis)
    assert analysis.verdict.trust == "doubtful"


def test_a_change_of_r_with_speed_that_scatter_may_make_is_a_warning_where_it_widens_the_error_of_r_by_much():
    test, analysis = drawn({"restitution_slope": {"k": 0.05}}, 53024)
    (named,) = [finding for finding in analysis.findings if finding.kind == "speed"]
    error = analysis.verdict.r - test.truth["restitution"]

    assert named.severity == "warning" and "scatter alone may make it" in named.text
    assert analysis.verdict.trust == "doubtful"
    assert 0.002 < abs(error) < 2.0 * analysis.verdict.standard_error


def test_a_hop_of_two_milliseconds_is_named_in_a_noisy_laboratory():
    """While the wall rocks a hop is looked for at every impact: there it is named ten times more seldom."""
    _, analysis = drawn({"bounce": {"tau": 0.002}}, 52402)
    (named,) = [finding for finding in analysis.findings if finding.kind == "hop"]

    assert named.severity == "warning"
    assert analysis.verdict.trust == "doubtful"


def test_a_hop_that_noise_may_make_is_told_and_in_the_stated_error_of_every_r():
    test, analysis = drawn({"bounce": {"tau": 0.001}}, 6138)
    (told,) = [finding for finding in analysis.findings if finding.kind == "hop"]
    error = analysis.verdict.r - test.truth["restitution"]

    assert told.severity == "info" and told.text in {note.text for note in analysis.notes}
    assert analysis.verdict.trust == "good"
    assert 0.005 < error < 2.0 * analysis.verdict.standard_error
    assert error < 2.0 * analysis.estimates["crt"].standard_error


@pytest.mark.parametrize("tau_s", [0.1, 0.3])
def test_a_wall_that_is_let_go_slowly_is_fitted_from_where_nothing_holds_it_any_more(tau_s: float):
    test = draw_test(RIG, SEED, effects={"slow_release": {"tau": tau_s}})
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))
    fit = analysis.fit

    assert not fit.from_release
    assert fit.explains_the_motion
    assert fit.r == pytest.approx(test.truth["restitution"], abs=0.002)
    assert fit.alpha_rad == pytest.approx(test.truth["alpha_rad"], abs=3 * fit.sigma_alpha_rad)


def test_a_slow_release_is_left_out_of_the_fit_even_where_the_rest_is_no_rigid_blocks_motion_either():
    effects = {"slow_release": {"tau": 0.3}, "residual_cable": {"k": 0.3}}
    test = draw_test(RIG, SEED, effects=effects, level=0.4)
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))
    fit = analysis.fit

    assert not fit.from_release
    assert not fit.explains_the_motion
    assert "misfit" in kinds(analysis)
    assert fit.r == pytest.approx(test.truth["restitution"], abs=0.003)


def test_the_fit_of_a_wall_whose_r_scatters_widely_has_the_mean_of_its_impacts():
    test = draw_test(RIG, 52404, effects={"restitution_scatter": {"sigma": 0.02}})
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))

    assert analysis.fit.r == pytest.approx(analysis.estimates["eav"].r, abs=0.003)


def test_the_fit_of_a_wall_whose_r_scatters_widely_is_searched_to_its_end():
    """A search that stops on its way has the rest of it in its error: ± 0.06 in place of ± 0.004."""
    test = draw_test(RIG, 52404, effects={"restitution_scatter": {"sigma": 0.02}})
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))

    assert analysis.fit.standard_error < 2.0 * analysis.estimates["eav"].standard_error


def test_pivots_inside_the_edges_change_the_largest_r_and_not_the_trust_in_r():
    test, analysis = drawn({"pivot_shift": {"a": 0.02}})
    pivot = next(finding for finding in analysis.findings if finding.kind == "pivot")
    r_max = RigidBlock.from_specimen(RIG.specimen).with_pivots_inside(pivot.size).r_max

    assert analysis.verdict.trust == "good"
    assert analysis.verdict.r == pytest.approx(test.truth["restitution"], abs=0.003)
    # The edges are those of the survey, whose wall is drawn 1 % off.
    assert pivot.size == pytest.approx(0.02, abs=0.006)
    assert f"{r_max:.4f}" in pivot.text


def test_a_tilted_base_leaves_r_alone_and_the_mean_of_alpha_where_it_is():
    test, analysis = drawn({"base_tilt": {"beta": 0.004}})
    wires = next(view for view in analysis.families if view.family == "wires")

    assert "duration" not in kinds(analysis)
    assert wires.alpha_rad == pytest.approx(test.truth["alpha_rad"], rel=0.01)


def test_wires_that_drift_are_blamed_for_sides_that_differ_and_not_the_wall():
    test, _ = drawn({})
    drifting = Fault("wire", "drift", 3e-4).record(test)

    analysis = analyse_record(drifting, AnalysisOptions(fit=False, bias_runs=0, keep_series=False))

    assert ("wires", "drift") in {(finding.family, finding.kind) for finding in analysis.findings}
    assert "side" not in kinds(analysis)
    assert analysis.verdict.trust == "doubtful"


def test_friction_is_said_while_the_wall_still_rocks():
    plan = plan_tasks(RIG)
    test = synthesise_test(RIG, plan, 0.35, 3, restitution=0.9, effects={"coulomb": {"mu": 0.02}})
    upright = test.readings[:, : test.upright_samples].mean(axis=1)
    tare = {c.id: float(mean - c.offset) for c, mean in zip(RIG.channels, upright, strict=True)}
    analyser = LiveAnalyser(RIG, test.rate_hz, tare)
    results = [
        analyser.process(start, test.readings[:, start : start + 400])
        for start in range(0, test.readings.shape[1], 400)
    ]
    estimates = [result.estimate for result in results if result.estimate is not None]

    assert any("friction" in doubt for doubt in estimates[-1].doubts), estimates[-1].doubts


def test_a_slow_release_does_not_count_in_the_level_that_the_wall_was_held_at():
    test = draw_test(RIG, SEED, effects={"slow_release": {"tau": 0.7}})
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, fit=False))
    time_s = analysis.series.time_s - analysis.release_s
    held_rad = analysis.series.rotation_rad[(time_s > -1.0) & (time_s < -0.5)].mean()

    assert analysis.theta0_by_family["wires"].value == pytest.approx(held_rad, rel=4e-4)


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("restitution_asymmetry", {"d": 0.02}),
        ("coulomb", {"mu": 0.02}),
        ("winkler", {"theta_c": 9e-4}),
        ("flexible_wall", {"gain": 0.2, "frequency": 4.6, "zeta": 0.005}),
    ],
)
def test_p_and_alpha_of_a_wall_that_is_no_rigid_block_have_no_stated_error(effect, parameters):
    test = draw_test(RIG, SEED, effects={effect: parameters})
    fit = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False)).fit

    assert math.isnan(fit.sigma_alpha_rad) and math.isnan(fit.sigma_p_rad_s)


def test_a_motion_that_the_fit_does_not_explain_is_remarked_and_the_verdict_of_r_stands():
    test = draw_test(RIG, 6104, effects={"residual_cable": {"k": 0.06}}, level=0.4)
    analysis = analyse_record(test.record(), AnalysisOptions(bias_runs=0, keep_series=False))

    assert {finding.kind for finding in analysis.findings if finding.severity == "warning"} == {"misfit"}
    assert analysis.verdict.trust == "remarks"
    assert analysis.verdict.r == pytest.approx(test.truth["restitution"], abs=0.003)


@pytest.mark.parametrize("method", ["eav", "crt"])
@pytest.mark.parametrize(
    ("effect", "parameters"), [("coulomb", {"mu": 0.02}), ("restitution_asymmetry", {"d": 0.02})]
)
def test_the_interval_of_each_method_holds_the_r_of_the_impacts_as_the_verdict_does(
    effect, parameters, method
):
    test, analysis = drawn({effect: parameters})
    low, high = analysis.estimates[method].interval95()

    assert low <= test.truth["restitution"] <= high


@pytest.mark.parametrize("gain", [0.02, 0.2])
def test_r_and_theta0_of_a_wall_that_still_rings_where_the_recording_ends_are_those_of_its_base(gain):
    ringing = SimulatedEffect("flexible_wall", {"gain": gain, "frequency": 4.6, "zeta": 0.005}, ends_s=0.7)
    test = ringing.test(RIG, SEED)
    analysis = analyse_record(test.record(), AnalysisOptions(fit=False, bias_runs=0, keep_series=False))
    (bending,) = [finding for finding in analysis.findings if finding.kind == "bending"]
    low, high = analysis.verdict.interval95

    assert bending.family == "wires" and "ring at 4." in bending.text
    assert analysis.verdict.trust == "remarks" and analysis.verdict.left_out == ("wires",)
    assert low <= test.truth["restitution"] <= high and high - low < 0.01
    assert analysis.theta0_rad == pytest.approx(test.truth["theta0_rad"], rel=0.005)
    for value in analysis.theta0_by_family.values():
        assert abs(value.value - test.truth["theta0_rad"]) < 3.0 * value.sigma


@pytest.mark.parametrize("factor", [0.05, 0.5])
def test_r_of_a_wall_that_bends_is_doubted_where_its_lvdts_cannot_take_the_place_of_its_wires(factor: float):
    ringing = SimulatedEffect("flexible_wall", {"gain": 0.2, "frequency": 4.6, "zeta": 0.005}, ends_s=0.7)
    record = Fault("lvdt", "unit", factor).record(ringing.test(RIG, SEED))
    analysis = analyse_record(record, AnalysisOptions(fit=False, bias_runs=0, keep_series=False))
    (bending,) = [finding for finding in analysis.findings if finding.kind == "bending"]

    assert analysis.verdict.trust == "doubtful"
    assert bending.treatment == ("none" if analysis.verdict.used == ("wires",) else "left out")
    assert ("it was not done" in bending.text) == (analysis.verdict.used == ("wires",))


@pytest.mark.parametrize(
    ("fault", "kind", "trust"),
    [
        (Fault("wire", "slow", 0.02), "slow", "remarks"),
        (Fault("lvdt", "slow", 0.02), "slow", "doubtful"),
        (Fault("wire", "late", 0.03), "late", "remarks"),
    ],
)
def test_a_wall_that_bends_is_told_behind_a_family_that_is_slow_or_late(fault: Fault, kind: str, trust: str):
    ringing = SimulatedEffect("flexible_wall", {"gain": 0.2, "frequency": 4.6, "zeta": 0.005}, ends_s=0.7)
    test = ringing.test(RIG, SEED)
    analysis = analyse_record(fault.record(test), AnalysisOptions(bias_runs=0, keep_series=False))
    low, high = analysis.verdict.interval95

    assert kinds(analysis) >= {kind, "bending"}
    assert analysis.verdict.trust == trust
    assert trust == "doubtful" or low <= test.truth["restitution"] <= high


def test_a_wall_that_bends_is_told_behind_wires_that_are_slow_by_less_than_is_named():
    """Their half-cycles would give r by EAV 0.02 off, and none of what was said of them was so."""
    test = ringing_test(RIG, 78602)
    record = Fault("wire", "slow", 0.0014).record(test)
    analysis = analyse_record(record, AnalysisOptions(fit=False, bias_runs=0, keep_series=False))

    assert kinds(analysis) >= {"bending"} and not kinds(analysis) & {"slow", "duration", "speed"}
    assert analysis.verdict.trust == "remarks" and analysis.verdict.left_out == ("wires",)
    assert analysis.verdict.r == pytest.approx(test.truth["restitution"], abs=0.002)


def test_a_survey_whose_alpha_is_not_the_walls_is_named_where_crt_is_off_by_it():
    _, analysis = drawn({"rounded_edge": {"rho": 0.1}}, 72400)
    (named,) = [finding for finding in analysis.findings if finding.kind == "alpha"]
    eav, crt = analysis.estimates["eav"], analysis.estimates["crt"]

    assert (named.family, named.severity) == ("survey", "warning")
    assert analysis.verdict.trust == "remarks"
    assert named.size == pytest.approx(crt.r - eav.r, abs=0.001)
    assert crt.standard_error > abs(named.size)
    assert abs(analysis.verdict.r - eav.r) < 0.5 * abs(crt.r - eav.r)


def test_a_wall_that_stands_bent_at_its_rest_has_the_theta0_of_its_base():
    """Wires and tiltmeters took a zero there that is off: the hold is found by the LVDTs alone."""
    ringing = {"flexible_wall": {"gain": 0.2, "frequency": 4.6, "zeta": 0.005}}
    test = draw_test(RIG, SEED, effects=ringing)
    bent_rad, si = 0.005, test.si.copy()
    stands = round(test.truth["impact_time_s"][-1] * test.rate_hz)
    upright = si[:, : round(0.5 * test.rate_hz)].mean(axis=1)
    for row in test.rows("wire"):
        si[row, stands:] = upright[row] + bent_rad * test.rig.channels[row].position_m[2]
    for row in test.rows("tiltmeter"):
        si[row, stands:] = upright[row] + bent_rad
    record = replace(test, si=si).record()
    analysis = analyse_record(record, AnalysisOptions(fit=False, bias_runs=0, keep_series=False))
    low, high = analysis.verdict.interval95

    assert "bending" in kinds(analysis)
    assert low <= test.truth["restitution"] <= high and high - low < 0.01
    assert analysis.theta0_rad == pytest.approx(test.truth["theta0_rad"], rel=0.005)
    for value in analysis.theta0_by_family.values():
        assert abs(value.value - test.truth["theta0_rad"]) < 5.0 * value.sigma
