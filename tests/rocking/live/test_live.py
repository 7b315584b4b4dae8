"""The online analysis against known truth, in blocks of any size, with gaps and broken wires."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from daq_app.acquisition.messages.published import EstimateMessage
from daq_app.config import Scaling
from daq_app.rocking import LiveAnalyser, Phase
from daq_app.rocking.live_families import LiveFamilies


def run_live(test, cuts=None, readings=None, tare=None):
    """Feed a whole test in the given cuts; results in order."""
    analyser = LiveAnalyser(test.rig, test.rate_hz, tare or {})
    readings = test.readings if readings is None else readings
    cuts = np.arange(0, test.n_samples, 400) if cuts is None else np.asarray(cuts)
    edges = [*cuts, test.n_samples]
    return [analyser.process(int(a), readings[:, a:b]) for a, b in pairwise(edges)]


def last_estimate(results):
    return [result.estimate for result in results if result.estimate is not None][-1]


@pytest.mark.parametrize(
    ("phi", "r", "tolerance"),
    [
        (0.15, 0.82, 0.01),
        (0.15, 0.895, 0.01),
        (0.25, 0.82, 0.003),
        (0.25, 0.95, 0.003),
        (0.35, 0.895, 0.003),
        (0.40, 0.82, 0.003),
    ],
)
def test_r_and_theta0_are_recovered(made, phi, r, tolerance):
    test = made(phi=phi, r=r, side=1 if r != 0.895 else -1, seed=3)
    estimate = last_estimate(run_live(test))
    assert estimate.eav.r == pytest.approx(r, abs=tolerance)
    assert estimate.crt.r == pytest.approx(r, abs=tolerance)
    theta0 = test.motion.side * phi * test.motion.alpha_rad
    assert estimate.theta0_rad == pytest.approx(theta0, abs=0.005 * test.motion.alpha_rad)
    assert estimate.release_sample / test.rate_hz == pytest.approx(test.motion.release_s, abs=2e-3)
    found = np.array(estimate.impact_samples[:8]) / test.rate_hz
    np.testing.assert_allclose(found, test.motion.impacts_s[: found.size], atol=4e-4)


def test_estimate_fits_the_message_and_comes_after_each_impact(made):
    results = run_live(made(phi=0.25, r=0.895, side=-1, seed=3))
    impacts = [impact for result in results for impact in result.impacts]
    told = [result.estimate for result in results if result.impacts]
    assert all(estimate is not None for estimate in told)
    message = EstimateMessage(**last_estimate(results).as_message())
    assert len(message.impact_samples) == len(impacts) == len(message.peaks_rad)
    assert message.peaks_rad[0] < 0 < message.peaks_rad[1]
    assert message.r_max == pytest.approx(0.9317, abs=1e-4)


def test_phases_in_order(made):
    results = run_live(made(phi=0.35, r=0.895, side=-1, seed=3))
    kinds = [event.kind for result in results for event in result.events]
    assert kinds[:2] == ["hold", "release"] and kinds[-1] == "rest"
    assert set(kinds[2:-1]) == {"impact"}
    assert results[-1].phase is Phase.AT_REST


@pytest.mark.parametrize("zeroed", [True, False])
def test_a_wall_is_held_before_a_zero_whatever_its_tiltmeters_are_off_by(made, zeroed):
    """They sit a fraction of a degree off: beside a zero such a difference is a doubt, without one none."""
    test = made(phi=0.15, r=0.895, side=1, seed=3)
    readings = test.readings.copy()
    for row, channel in enumerate(test.rig.channels):
        if channel.family == "tiltmeter":
            gain = np.ptp(Scaling.of([channel]).to_readings(np.array([[0.0, 1.0]])))
            readings[row] += 4.5e-3 * gain
    results = run_live(test, readings=readings, tare={"AX-1": 0.0} if zeroed else {})
    kinds = [event.kind for result in results for event in result.events]
    assert ("hold" in kinds) is not zeroed


def test_rotation_and_velocity_belong_to_the_same_samples(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=3)
    results = run_live(test)
    rotation = np.concatenate([result.rotation_rad for result in results])
    velocity = np.concatenate([result.velocity_rad_s for result in results])
    assert results[0].first_sample == 0 and rotation.size == velocity.size
    firsts = np.cumsum([0, *(result.rotation_rad.size for result in results)])[:-1]
    assert [result.first_sample for result in results] == firsts.tolist()
    time = np.arange(rotation.size) / test.rate_hz
    falling = (time > test.motion.release_s + 0.1) & (time < test.motion.impacts_s[0] - 0.05)
    theta, omega = test.motion.at(time)
    np.testing.assert_allclose(rotation[falling], theta[falling], atol=5e-4)
    np.testing.assert_allclose(velocity[falling], omega[falling], atol=5e-3)


@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_block_size_gives_the_same_answer(made, data):
    test = made(phi=0.15, r=0.82, side=1, seed=3)
    size = data.draw(st.sampled_from([37, 100, 401, 1999, 8000, 10**6]))
    extra = data.draw(st.lists(st.integers(1, test.n_samples - 1), max_size=20))
    cuts = sorted({0, *range(0, test.n_samples, size), *extra})
    one, many = run_live(test, [0]), run_live(test, cuts)
    assert last_estimate(many) == last_estimate(one)
    events = [event for result in many for event in result.events]
    assert tuple(events) == one[0].events
    rotation = np.concatenate([result.rotation_rad for result in many])
    np.testing.assert_array_equal(rotation, one[0].rotation_rad[: rotation.size])
    velocity = np.concatenate([result.velocity_rad_s for result in many])
    np.testing.assert_allclose(velocity, one[0].velocity_rad_s[: velocity.size], atol=1e-12)


def test_a_tare_is_taken_out(made):
    test = made(phi=0.25, r=0.82, side=1, seed=3)
    tare = {channel.id: 0.05 for channel in test.rig.channels}
    estimate = last_estimate(run_live(test, readings=test.readings + 0.05, tare=tare))
    assert estimate.eav.r == pytest.approx(0.82, abs=0.003)


@pytest.mark.parametrize("fault", ["stuck", "open", "nan", "jump"])
def test_one_broken_wire_does_no_harm(made, fault):
    test = made(phi=0.25, r=0.82, side=1, seed=3)
    readings = test.readings.copy()
    row = test.rig.channel_ids.index("WP-4")
    middle = test.n_samples // 2
    if fault == "stuck":
        readings[row] = readings[row, 0]
    elif fault == "open":
        readings[row, middle:] = 10.0
    elif fault == "nan":
        readings[row, middle:] = np.nan
    else:
        readings[row, middle:] += 0.3
    results = run_live(test, readings=readings)
    estimate = last_estimate(results)
    assert estimate.eav.r == pytest.approx(0.82, abs=0.003)
    assert estimate.crt.r == pytest.approx(0.82, abs=0.003)
    assert any("WP-4" in result.excluded_wires for result in results)
    assert not any(wire != "WP-4" for result in results for wire in result.excluded_wires)


def test_a_gap_costs_the_half_cycle_but_not_the_test(made):
    test = made(phi=0.35, r=0.895, side=-1, seed=3)
    analyser = LiveAnalyser(test.rig, test.rate_hz, {})
    start = round((test.motion.impacts_s[2] + 0.1) * test.rate_hz)
    results = [analyser.process(0, test.readings[:, :start])]
    results.append(analyser.process(start + 800, test.readings[:, start + 800 :]))
    assert not any(result.excluded_wires for result in results), "no wire is to blame for a gap"
    estimate = last_estimate(results)
    assert estimate.eav.r == pytest.approx(0.895, abs=0.003)
    assert estimate.crt.r == pytest.approx(0.895, abs=0.003)


def test_wrong_blocks_are_refused_in_words(made):
    test = made(phi=0.25, r=0.82, side=1, seed=3)
    analyser = LiveAnalyser(test.rig, test.rate_hz, {})
    with pytest.raises(ValueError, match="one row per channel"):
        analyser.process(0, test.readings[:5, :100])
    analyser.process(0, test.readings[:, :100])
    with pytest.raises(ValueError, match="already analysed"):
        analyser.process(50, test.readings[:, 50:100])


def shifted(readings, rig, prefix, by):
    """The same with the channels whose ids begin with `prefix` late by `by` samples."""
    changed = readings.copy()
    rows = [row for row, name in enumerate(rig.channel_ids) if name.startswith(prefix)]
    changed[rows, by:], changed[rows, :by] = readings[rows, :-by], readings[rows, :1]
    return changed


def slowed(readings, rig, prefix, seconds):
    """The same with the channels whose ids begin with `prefix` behind a first-order filter."""
    changed = readings.copy()
    rows = [row for row, name in enumerate(rig.channel_ids) if name.startswith(prefix)]
    keep = np.exp(-1.0 / rig.acquisition.rate_hz / seconds)
    start = readings[rows, :1] * keep
    changed[rows] = lfilter([1.0 - keep], [1.0, -keep], readings[rows], axis=1, zi=start)[0]
    return changed


def test_families_that_agree_raise_no_doubt_while_live(made):
    estimates = [result.estimate for result in run_live(made(phi=0.35, r=0.895, side=-1, seed=8, full=True))]
    assert {estimate.doubts for estimate in estimates if estimate is not None} == {()}


@pytest.mark.parametrize(
    ("prefix", "change", "by", "told"),
    [
        ("WP-", slowed, 0.02, "wires are slow"),
        ("LV-", slowed, 0.02, "LVDTs are slow"),
        ("LV-", shifted, 80, "LVDTs are 20.0 ms late"),
        ("AC-", shifted, 60, "accelerometers are"),
    ],
)
def test_a_family_that_disagrees_is_told_while_the_wall_rocks(made, prefix, change, by, told):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    estimate = last_estimate(run_live(test, readings=change(test.readings, test.rig, prefix, by)))
    assert any(told in doubt for doubt in estimate.doubts), estimate.doubts
    assert EstimateMessage(**estimate.as_message()).doubts == estimate.doubts


def test_r_is_told_before_the_other_families_are_asked_about_it(made, monkeypatch):
    test = made(phi=0.35, r=0.895, side=-1, seed=8, full=True)
    readings = shifted(test.readings, test.rig, "LV-", 80)
    told, asked_after, look = [], [], LiveFamilies.look
    monkeypatch.setattr(LiveFamilies, "look", lambda *given: (asked_after.append(len(told)), look(*given)))
    analyser = LiveAnalyser(test.rig, test.rate_hz, {}, told.append)
    starts = range(0, test.n_samples, 80)
    results = [analyser.process(start, readings[:, start : start + 80]) for start in starts]
    whole = [result.estimate for result in results if result.impacts]
    assert [estimate.crt for estimate in told] == [estimate.crt for estimate in whole]
    assert asked_after == [*range(1, len(told) + 1)]
    doubted = next(place for place, estimate in enumerate(whole) if estimate.doubts)
    assert told[doubted].doubts == () and told[doubted + 1].doubts == whole[doubted].doubts
