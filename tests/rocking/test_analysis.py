"""The offline analysis of whole records: against truth, against the online one, and when things are wrong."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from daq_app.rocking import AnalysisOptions, LiveAnalyser, TestRecord, analyse_record
from daq_app.rocking.analysis.preparation.fusion import best_value
from daq_app.rocking.analysis.results import ValueWithSigma

QUICK = AnalysisOptions(bias_runs=0, fit=False)


@pytest.fixture(scope="module")
def whole(made):
    """A full test with LVDTs and accelerometers, and its analysis."""
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    return test, analyse_record(record_of(test))


def record_of(test, si=None, **changes):
    arguments = {"time_offsets_s": test.offsets_s, "label": "FR1-L3-2", **changes}
    return TestRecord.from_array(test.rig, test.rate_hz, test.si if si is None else si, **arguments)


def test_every_method_is_right(whole):
    _, analysis = whole
    for name in ("eav", "crt", "crt_exact", "eav_best", "crt_best", "eav_lvdts", "crt_lvdts"):
        assert analysis.estimates[name].r == pytest.approx(0.895, abs=0.001), name
    assert analysis.fit.r == pytest.approx(0.895, abs=0.001)
    assert analysis.fit.explains_the_motion
    assert analysis.fit.p_rad_s == pytest.approx(2.2, abs=0.003)


def test_the_papers_filtered_peaks_are_biased_and_the_bias_is_told(whole):
    _, analysis = whole
    raw, corrected = analysis.estimates["eav_filtered"], analysis.estimates["eav_filtered_corrected"]
    told = analysis.bias["eav_filtered"]
    assert raw.r < 0.892
    assert raw.r - told.mean == pytest.approx(0.895, abs=0.003)
    assert corrected.r == pytest.approx(0.895, abs=0.002)
    assert abs(analysis.bias["eav"].mean) < 3e-4 and abs(analysis.bias["crt"].mean) < 3e-4


def test_accelerometers_are_read_about_the_impacts_and_once_at_rest(whole):
    test, expected = whole
    record, read = record_of(test), []

    def load(ids, start=0, stop=None):
        if "AC-1" in ids:
            read.append((start, stop))
        return record.load(ids, start, stop)

    analysis = analyse_record(replace(record, load=load), QUICK)
    shocks = [cycle.accelerometer_s for cycle in analysis.half_cycles[1:]]
    np.testing.assert_array_equal(shocks, [cycle.accelerometer_s for cycle in expected.half_cycles[1:]])
    first, last = test.motion.impacts_s[0] * test.rate_hz, analysis.half_cycles[-1].start_s * test.rate_hz
    assert min(start for start, _ in read) == pytest.approx(first, abs=0.15 * test.rate_hz)
    about_impacts = [(start, stop) for start, stop in read if start < last]
    assert max(stop for _, stop in about_impacts) == pytest.approx(last, abs=0.15 * test.rate_hz)
    (at_rest,) = set(read) - set(about_impacts)
    assert at_rest[0] > analysis.rest_s * test.rate_hz
    assert at_rest[1] - at_rest[0] < 2.0 * test.rate_hz


def test_theta0_by_family(whole):
    test, analysis = whole
    truth = test.motion.side * 0.35 * test.motion.alpha_rad
    assert set(analysis.theta0_by_family) == {"tiltmeters", "wires", "lvdts", "best"}
    for value in analysis.theta0_by_family.values():
        assert value.value == pytest.approx(truth, abs=0.005 * test.motion.alpha_rad)
        assert abs(value.value - truth) < 3 * value.sigma
    assert analysis.side == -1
    assert analysis.theta0_over_alpha == pytest.approx(0.35, abs=0.005)


def test_faces_that_are_further_apart_than_surveyed_are_in_the_error_of_theta0(whole):
    """All LVDTs open as much wider, so that nothing in the joint shows it."""
    test, _ = whole
    truth = test.motion.side * 0.35 * test.motion.alpha_rad
    wider = test.si.copy()
    wider[[channel.family == "lvdt" for channel in test.rig.channels]] *= 1.006

    theta0 = analyse_record(record_of(test, wider), QUICK).theta0_by_family

    assert theta0["lvdts"].value == pytest.approx(1.006 * truth, rel=5e-4)
    assert abs(theta0["lvdts"].value - truth) < 2.5 * theta0["lvdts"].sigma
    assert theta0["best"].value == pytest.approx(truth, rel=1.2e-3)


def test_theta0_of_a_family_that_is_left_out_is_known_no_better_than_it_differs_from_the_others(whole):
    """The base has walked by 3 mm since the release: wires that are zeroed at rest show it in the hold."""
    test, sound = whole
    truth = test.motion.side * 0.35 * test.motion.alpha_rad
    walked = test.si.copy()
    time_s = np.arange(test.n_samples) / test.rate_hz
    steps = 1.5e-3 * np.abs(test.motion.speeds_before_rad_s[:10])
    path = np.zeros(test.n_samples)
    for instant_s, step in zip(test.motion.impacts_s, steps, strict=False):
        path += step * (time_s > instant_s)
    walked[[channel.family == "wire" for channel in test.rig.channels]] += path

    analysis = analyse_record(record_of(test, walked, tared=False), QUICK)

    wires = analysis.theta0_by_family["wires"]
    assert "slide" in {finding.kind for finding in analysis.findings}
    assert abs(wires.value - truth) > 5.0 * sound.theta0_by_family["wires"].sigma
    assert abs(wires.value - truth) < 2.0 * wires.sigma
    assert analysis.theta0_by_family["best"].value == pytest.approx(truth, rel=2e-3)


@pytest.mark.parametrize(("apart_sigmas", "widened_by"), [(2.9, 1.0), (4.0, 4.0 / math.sqrt(3.0))])
def test_the_best_theta0_is_known_worse_where_families_differ_by_more_than_chance(apart_sigmas, widened_by):
    """Three values of which one is off: chance puts it by 3.0 standard errors in one test of twenty."""
    families = {name: ValueWithSigma(0.0, 1e-4) for name in ("tiltmeters", "wires")}
    families["lvdts"] = ValueWithSigma(apart_sigmas * 1e-4, 1e-4)

    assert best_value(families).sigma == pytest.approx(1e-4 / math.sqrt(3.0) * widened_by)


def test_times_are_aligned_and_refined(whole):
    """Wires and accelerometers are sampled up to 0.1 ms apart; all end on one time base."""
    test, analysis = whole
    cycles = analysis.half_cycles
    assert analysis.release_s == pytest.approx(test.motion.release_s, abs=3e-4)
    starts = np.array([cycle.start_s for cycle in cycles[1:13]])
    np.testing.assert_allclose(starts, test.motion.impacts_s[:12], atol=8e-5)
    shocks = np.array([cycle.accelerometer_s for cycle in cycles[1:]])
    assert np.isfinite(shocks).mean() > 0.9
    errors = (shocks - test.motion.impacts_s[: shocks.size])[np.isfinite(shocks)]
    assert np.abs(errors).max() < 5e-4 and np.median(np.abs(errors)) < 2e-4


def test_half_cycles_are_those_of_the_truth(whole):
    test, analysis = whole
    for cycle in analysis.half_cycles[1:13]:
        n = cycle.n
        assert abs(cycle.peak_rad) == pytest.approx(test.motion.peaks_rad[n], rel=3e-3)
        assert abs(cycle.speed_before_rad_s) == pytest.approx(
            test.motion.speeds_before_rad_s[n - 1], rel=5e-3
        )
        assert abs(cycle.speed_after_rad_s) == pytest.approx(test.motion.speeds_after_rad_s[n - 1], rel=5e-3)
        assert cycle.jump_ratio == pytest.approx(0.895, abs=0.01)
        assert cycle.period_theory_s == pytest.approx(cycle.duration_s, rel=5e-3)
        assert abs(cycle.speed_filtered_rad_s) < abs(cycle.speed_before_rad_s)


def test_base_joint_and_residuals(whole):
    test, analysis = whole
    joint, left = analysis.joint, analysis.residuals
    half = test.rig.specimen.base_width_m / 2
    assert joint.pivot_left_m.value == pytest.approx(-half, abs=1e-3)
    assert joint.pivot_right_m.value == pytest.approx(half, abs=1e-3)
    assert joint.inset_theory_m == pytest.approx(0.0334, abs=1e-4)
    assert joint.gain_to_wires == pytest.approx(1.0, abs=1e-3)
    assert abs(joint.twist_hold_rad_per_m) < 1e-4
    assert abs(left.rotation_wires_rad.value) < 1e-5 and abs(left.sliding_m.value) < 2e-5
    assert max(joint.profile_opening_m) == pytest.approx(2 * half * math.sin(0.35 * 0.215), rel=0.01)


def test_fused_rotation_is_better_than_either_and_its_uncertainty_holds(whole):
    test, analysis = whole
    series = analysis.series
    truth = test.motion.at(series.time_s)[0]
    moving = series.time_s > test.motion.release_s
    error = (series.best_rotation_rad - truth)[moving]
    assert error.std() < (series.rotation_rad - truth)[moving].std()
    assert np.mean(np.abs(error) < 2 * series.best_sigma_rad[moving]) > 0.95


def test_offline_and_online_agree(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    offline = analyse_record(record_of(test, time_offsets_s={}), QUICK)
    live = LiveAnalyser(test.rig, test.rate_hz, {})
    results = [live.process(k, test.readings[:, k : k + 400]) for k in range(0, test.n_samples, 400)]
    online = [result.estimate for result in results if result.estimate][-1]
    # Offline the noise of the rest weighs the half-cycles; the half-cycles themselves are the same.
    assert offline.estimates["eav"].r == pytest.approx(online.eav.r, abs=5e-5)
    assert offline.estimates["crt"].r == pytest.approx(online.crt.r, abs=5e-5)
    assert [cycle.peak_rad for cycle in offline.half_cycles[:-1]] == pytest.approx(
        online.peaks_rad, abs=1e-12
    )


def test_json_is_strict_and_whole(whole):
    _, analysis = whole
    text = json.dumps(analysis.as_dict(), allow_nan=False)
    back = json.loads(text)
    assert back["estimates"]["eav"]["interval95"][0] < 0.895 < back["estimates"]["eav"]["interval95"][1]
    assert back["half_cycles"][0]["speed_before_rad_s"] is None
    assert "series" not in back


def test_a_good_test_has_no_warnings(whole):
    _, analysis = whole
    assert [note.text for note in analysis.notes if note.severity == "warning"] == []


def test_offsets_without_a_tare_are_taken_from_the_rest(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    offsets = np.random.default_rng(0).normal(0, 2e-3, test.si.shape[0])
    si = test.si + offsets[:, None]
    analysis = analyse_record(record_of(test, si, tared=False), QUICK)
    assert analysis.estimates["eav"].r == pytest.approx(0.895, abs=0.002)
    assert analysis.theta0_rad == pytest.approx(-0.35 * 0.215, abs=0.001)
    assert analysis.residuals is None
    assert analysis.zero == "rest"
    assert any("zero is taken from the rest" in note.text for note in analysis.notes)
    kept = analyse_record(
        record_of(test, si, tared=False), AnalysisOptions(bias_runs=0, fit=False, zero_at_rest=False)
    )
    assert kept.residuals is not None
    assert kept.zero == "certificates"
    assert any("certificates' offsets" in note.text for note in kept.notes)


def test_sliding_and_residual_rotation_are_seen(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    si = test.si.copy()
    after = round((test.motion.impacts_s[-1] + 0.05) * test.rate_hz)
    for row, channel in enumerate(test.rig.channels):
        if channel.family == "wire":
            si[row, after:] += 1e-3 + channel.position_m[2] * 5e-4
    analysis = analyse_record(record_of(test, si), QUICK)
    assert analysis.residuals.sliding_m.value == pytest.approx(1e-3, abs=5e-5)
    assert any("slid" in note.text for note in analysis.notes)
    assert any("came to rest" in note.text for note in analysis.notes)


def test_a_semi_rigid_pivot_is_seen_in_the_profile(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    si, inset = test.si.copy(), 0.03
    for row, channel in enumerate(test.rig.channels):
        if channel.family == "lvdt":
            theta = test.motion.at(np.arange(test.n_samples) / test.rate_hz)[0]
            si[row] -= inset * np.abs(np.sin(theta))
    analysis = analyse_record(record_of(test, si), QUICK)
    assert analysis.joint.inset_left_m == pytest.approx(inset, abs=2e-3)
    assert analysis.joint.inset_right_m == pytest.approx(inset, abs=2e-3)
    assert analysis.joint.contact_m == pytest.approx(inset, abs=2e-3)


def test_bad_lvdts_are_left_out_and_named(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    si = test.si.copy()
    si[test.rig.channel_ids.index("LV-A03")] += np.linspace(0, 0.02, test.n_samples)
    si[test.rig.channel_ids.index("LV-B07")] = 0.004
    analysis = analyse_record(record_of(test, si), QUICK)
    assert set(analysis.joint.suspects) == {"LV-A03", "LV-B07"}
    assert analysis.joint.gain_to_wires == pytest.approx(1.0, abs=2e-3)


def test_clipped_lvdts_do_not_bend_the_rotation(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    channels = tuple(
        c.model_copy(update={"range_si": (-0.01, 0.03)}) if c.family == "lvdt" else c
        for c in test.rig.channels
    )
    rig = test.rig.model_copy(update={"channels": channels})
    si = test.si.copy()
    rows = [row for row, c in enumerate(channels) if c.family == "lvdt"]
    si[rows] = np.clip(si[rows], -0.01, 0.03)
    analysis = analyse_record(
        TestRecord.from_array(rig, test.rate_hz, si, time_offsets_s=test.offsets_s), QUICK
    )
    assert analysis.joint.gain_to_wires == pytest.approx(1.0, abs=5e-3)
    assert len(analysis.joint.clipped) > 0
    assert analysis.estimates["eav"].r == pytest.approx(0.895, abs=0.001)


def test_families_that_disagree_are_told(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    si = test.si.copy()
    rows = [row for row, c in enumerate(test.rig.channels) if c.family == "lvdt"]
    si[rows] *= 1.03
    notes = [note.text for note in analyse_record(record_of(test, si), QUICK).notes]
    assert any("disagree on θ0" in text for text in notes)
    assert any("LVDTs" in text and "a calibration is wrong" in text for text in notes)


def test_missing_families_are_told_and_the_rest_is_done(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    rows = [row for row, c in enumerate(test.rig.channels) if c.family == "wire"]
    ids = [test.rig.channel_ids[row] for row in rows]
    record = TestRecord.from_array(test.rig, test.rate_hz, test.si[rows], channel_ids=ids)
    analysis = analyse_record(record, QUICK)
    assert analysis.estimates["eav"].r == pytest.approx(0.895, abs=0.001)
    assert analysis.joint is None
    texts = " ".join(note.text for note in analysis.notes)
    assert "no tiltmeter" in texts and "too few LVDTs" in texts and "no accelerometers" in texts


def test_gaps_are_left_out(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    si = test.si.copy()
    start = round((test.motion.impacts_s[3] + 0.05) * test.rate_hz)
    si[:, start : start + 400] = np.nan
    analysis = analyse_record(record_of(test, si), QUICK)
    assert analysis.estimates["eav"].r == pytest.approx(0.895, abs=0.002)
    assert analysis.estimates["crt"].r == pytest.approx(0.895, abs=0.002)
    assert any("no rotation (gaps)" in note.text for note in analysis.notes)


@pytest.mark.parametrize(
    ("stop_s", "words"),
    [(1.5, "no steady hold"), (4.4, "no release follows"), (6.0, "before the wall is at rest")],
)
def test_records_cut_short_are_told_without_an_exception(made, stop_s, words):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    analysis = analyse_record(record_of(test, test.si[:, : round(stop_s * test.rate_hz)]), QUICK)
    assert any(words in note.text for note in analysis.notes)
    assert analysis.found == (stop_s > 5)
    json.dumps(analysis.as_dict(), allow_nan=False)


def test_a_record_without_wires_is_refused_in_words(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    record = TestRecord.from_array(test.rig, test.rate_hz, test.si[:3], channel_ids=test.rig.channel_ids[:3])
    with pytest.raises(ValueError, match="the record has none"):
        analyse_record(record)
    with pytest.raises(ValueError, match="as many rows"):
        TestRecord.from_array(test.rig, test.rate_hz, test.si[:3])


def test_one_wire_gives_a_rotation_and_a_warning(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    kept = [k for k, name in enumerate(test.rig.channel_ids) if not name.startswith("WP") or name == "WP-5"]
    ids = tuple(test.rig.channel_ids[k] for k in kept)
    analysis = analyse_record(
        TestRecord.from_array(test.rig, test.rate_hz, test.si[kept], channel_ids=ids), QUICK
    )
    assert analysis.estimates["crt"].r == pytest.approx(0.895, abs=0.002)
    assert any("that of one wire" in note.text for note in analysis.notes)


def test_known_delays_of_a_family_are_taken_out(made):
    """LVDTs sampled 3 ms late and accelerometers 5 ms early, both declared: nothing moves."""
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    si, offsets = test.si.copy(), dict(test.offsets_s)
    for row, channel in enumerate(test.rig.channels):
        shift = {"lvdt": 12, "accelerometer": -20}.get(channel.family, 0)
        si[row] = np.roll(si[row], -shift)
        offsets[channel.id] += shift / test.rate_hz
    analysis = analyse_record(record_of(test, si, time_offsets_s=offsets), QUICK)
    inner = slice(100, -100)
    truth = test.motion.at(analysis.series.time_s)[0]
    moving = (analysis.series.time_s > test.motion.release_s)[inner]
    assert np.abs(analysis.series.best_rotation_rad - truth)[inner][moving].max() < 4e-4
    shocks = np.array([cycle.accelerometer_s for cycle in analysis.half_cycles[1:13]])
    np.testing.assert_allclose(shocks, test.motion.impacts_s[:12], atol=5e-4)


def test_lvdts_read_one_after_the_other_show_no_twist(made):
    """Skews of 0 to 0.15 ms along the wall would make twist follow the speed: 0.04 mrad/m at the impacts."""
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    series = analyse_record(record_of(test), QUICK).series
    moving = (series.time_s > test.motion.release_s) & (series.time_s < test.motion.impacts_s[5])
    speed, twist = series.velocity_rad_s[moving], series.twist_rad_per_m[moving]
    known = np.isfinite(twist)
    slope = float(np.polyfit(speed[known], twist[known], 1)[0])
    assert abs(slope * np.abs(speed).max()) < 8e-6


def test_the_simulated_bias_has_this_tests_noise(whole):
    _, analysis = whole
    assert 1e-5 < analysis.bias["eav_filtered"].scatter < 5e-3
    assert analysis.bias["eav"].runs == 6 and analysis.bias["fit"].runs == 3
    low, high = analysis.fit.interval95()
    assert high - low > 2 * 1.96 * analysis.fit.standard_error  # Student's, not the normal distribution's
