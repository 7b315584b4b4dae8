"""Half-cycle fits and the estimators built on them, with their claimed errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from daq_app.rocking.estimators import crt_series, eav_series, estimate_all
from daq_app.rocking.families.body import body_of_half_cycles
from daq_app.rocking.motion.arcs import fit_arcs
from daq_app.rocking.motion.motion_fit import fit_motion
from daq_app.rocking.motion.motion_model import FIXED, MotionModel
from daq_app.rocking.motion.swings import MotionSettings, MotionTrack
from daq_app.rocking.theory.housner import exact_quarter_period, free_rocking

P, ALPHA, RATE = 2.2, 0.215, 4000.0
SETTINGS = MotionSettings(RATE, P, ALPHA)


def eav(speeds_rad_s, sigmas_rad_s):
    return estimate_all([eav_series(speeds_rad_s, sigmas_rad_s)])[0]


def crt(peaks_rad, sigmas_rad, alpha_rad):
    return estimate_all([crt_series(peaks_rad, sigmas_rad, alpha_rad)])[0]


def rock(phi, r, noise=0.0, seed=0, p=P, side=1, smallest=3e-4):
    motion = free_rocking(side * phi * ALPHA, r, p, ALPHA, release_s=0.6, smallest_peak_rad=smallest)
    time = np.arange(round((motion.impacts_s[-1] + 0.1) * RATE)) / RATE
    rotation = motion.at(time)[0] + np.random.default_rng(seed).normal(0, noise, time.size)
    return motion, time, rotation


def follow(motion, time, rotation):
    first = np.searchsorted(time, motion.impacts_s[0] + 1e-3)
    track = MotionTrack.begin(
        SETTINGS, time[:first], rotation[:first], 0.6, motion.side * motion.peaks_rad[0]
    )
    for crossing in motion.impacts_s:
        track.add_impact(float(crossing), time, rotation)
    return track


@settings(max_examples=20)
@given(st.floats(0.05, 0.6), st.floats(0.7, 0.98), st.floats(0.95, 1.05), st.sampled_from([1, -1]))
def test_arcs_of_clean_motion_are_exact_for_any_p(phi, r, factor, side):
    """Without noise the fits give peaks and one-sided speeds, though their own p is wrong."""
    motion, time, rotation = rock(phi, r, p=P * factor, side=side, smallest=3e-3)
    track = follow(motion, time, rotation)
    before, after = np.abs(track.speeds_before_rad_s), np.abs(track.speeds_after_rad_s[:-1])
    np.testing.assert_allclose(before, motion.speeds_before_rad_s, rtol=5e-4)
    np.testing.assert_allclose(after, motion.speeds_after_rad_s[:-1], rtol=5e-4)
    np.testing.assert_allclose(np.abs(track.peaks_rad[1:]), motion.peaks_rad[1:-1], rtol=3e-4)
    np.testing.assert_allclose(track.impacts_s, motion.impacts_s, atol=1e-4)
    signs = np.sign(track.peaks_rad)
    assert (signs[1:] == -signs[:-1]).all() and signs[0] == side


def test_errors_of_arcs_are_as_claimed():
    """Over repeated noise the errors of speeds and peaks are normal with the claimed sigma."""
    motion = rock(0.35, 0.9)[0]
    normalised = []
    for seed in range(30):
        _, time, rotation = rock(0.35, 0.9, noise=6e-5, seed=seed)
        for n in (4, 9, 14):
            start, stop = motion.impacts_s[n - 1 : n + 1]
            (arc,) = fit_arcs(
                time, rotation, [start, stop], first_index=n, p_rad_s=P, alpha_rad=ALPHA, zero_sigma_rad=0.0
            )
            normalised += [
                (abs(arc.speed_end_rad_s) - motion.speeds_before_rad_s[n]) / arc.sigma_speed_end_rad_s,
                (abs(arc.speed_start_rad_s) - motion.speeds_after_rad_s[n - 1]) / arc.sigma_speed_start_rad_s,
                (abs(arc.peak_rad) - motion.peaks_rad[n]) / arc.sigma_peak_rad,
            ]
    assert 0.7 < np.std(normalised) < 1.25
    assert abs(np.mean(normalised)) < 0.3


def test_a_wrong_zero_moves_impacts_by_turns_and_by_the_stated_error():
    motion, time, rotation = rock(0.35, 0.9, smallest=3e-3)
    true = follow(motion, time, rotation).impacts_s
    off = follow(motion, time, rotation + SETTINGS.zero_sigma_rad).impacts

    moved = [impact.time_s - before for impact, before in zip(off, true, strict=True)]

    signs = np.sign(moved)
    assert (signs[1:] == -signs[:-1]).all()
    np.testing.assert_allclose(np.abs(moved), [impact.zero_s for impact in off], rtol=0.1)


def test_too_little_to_fit_is_none_not_nonsense():
    time = np.arange(100) / RATE
    for rotation, end in ((np.full(100, np.nan), 0.02), (np.ones(100), 0.02), (np.ones(100), 0.005)):
        assert fit_arcs(time, rotation, [0.0, end], first_index=1, p_rad_s=P, alpha_rad=ALPHA) == [None]


@pytest.mark.parametrize("r", [0.82, 0.9, 0.95])
@pytest.mark.parametrize(("phi", "tolerance"), [(0.15, 0.01), (0.25, 0.003), (0.4, 0.003)])
def test_both_estimators_meet_the_requirement_with_worse_sensors(r, phi, tolerance):
    """Rotation noise of 0.1 mrad is what five wires of 0.5 mm rms would give."""
    for seed in range(2):
        track = follow(*rock(phi, r, noise=1e-4, seed=seed))
        assert track.eav().r == pytest.approx(r, abs=tolerance)
        assert track.crt().r == pytest.approx(r, abs=tolerance)


def test_linear_and_exact_crt_differ_as_the_theory_says():
    track = follow(*rock(0.35, 0.9))
    (exact,) = estimate_all([track.crt_exact_series()])
    assert exact.r == pytest.approx(0.9, abs=1e-5)
    # E_nl / E_lin ≈ 1 − (1−φ)² α²/12: (4.5) comes out high by about a ten-thousandth here.
    assert 2e-5 < track.crt().r - 0.9 < 3e-4
    assert "exact" in exact.method


def test_points_are_named_by_the_impact_that_completed_them():
    track = follow(*rock(0.35, 0.9))
    first = track.eav().points[0]
    assert (first.first, first.last, first.impact) == (1, 3, 3)
    first = track.crt().points[0]
    assert (first.first, first.last, first.impact) == (0, 1, 1)
    v = np.abs(track.speeds_before_rad_s)
    assert track.eav().points[2].r == pytest.approx(math.sqrt(v[4] / v[2]))


def test_a_lost_half_cycle_costs_its_pairs_only():
    speeds = 0.3 * 0.9 ** np.arange(10.0)
    speeds[4] = math.nan
    estimate = eav(speeds.tolist(), (1e-4 * np.ones(10)).tolist())
    assert {(p.first, p.last) for p in estimate.points} == {(1, 3), (2, 4), (4, 6), (6, 8), (7, 9), (8, 10)}
    assert estimate.r == pytest.approx(0.9)


def test_peaks_tell_r_where_the_first_of_them_is_not_known():
    """A release that is no clean one makes no φ0 of the decay: points begin at the first peak after it."""
    peaks = [0.3 * ALPHA, *(ALPHA * (1 - math.sqrt(1 - (1 - 0.75**2) * 0.81**n)) for n in range(6))]
    estimate = crt(peaks, [math.nan, *[1e-5] * 6], ALPHA)
    assert [(point.first, point.impact) for point in estimate.points] == [(1, n) for n in range(2, 7)]
    assert estimate.r == pytest.approx(0.9, abs=1e-6)


def test_late_noisy_points_do_not_spoil_the_weighted_mean():
    speeds = 0.3 * 0.9 ** np.arange(12.0)
    sigmas = np.full(12, 2e-4)
    speeds[-1] *= 1.3
    sigmas[-1] = 0.3 * speeds[-1] * 0.4
    estimate = eav(speeds.tolist(), sigmas.tolist())
    assert abs(estimate.r - 0.9) < 1e-3
    assert abs(estimate.plain_mean - 0.9) > abs(estimate.r - 0.9)


def test_scatter_of_r_is_found_and_in_the_standard_error():
    rng = np.random.default_rng(2)
    covered, scatters = 0, []
    for _ in range(60):
        rs = 0.9 * (1 + rng.normal(0, 0.01, 18))
        speeds = 0.35 * np.cumprod(np.concatenate(([1.0], rs)))
        estimate = eav(speeds.tolist(), (1e-4 + 0 * speeds).tolist())
        low, high = estimate.interval95()
        covered += low <= 0.9 <= high
        scatters.append(estimate.scatter)
    assert covered >= 51  # 95 % of 60 is 57; three standard deviations below
    assert np.median(scatters) == pytest.approx(0.01, rel=0.3)


def test_a_scatter_that_few_impacts_cannot_show_is_not_taken_as_none():
    """The likeliest scatter is often none although there is one: its interval would hold r in 80 %."""
    rng = np.random.default_rng(0)
    tests, impacts, scatter, sigma = 150, 10, 3e-4, 1.2e-4
    held = 0
    for _ in range(tests):
        walk = np.concatenate(([0.0], np.cumsum(rng.normal(0.0, scatter, impacts - 1))))
        speeds = 0.4 * 0.9 ** np.arange(impacts) * np.exp(walk) + rng.normal(0.0, sigma, impacts)
        low, high = eav(speeds.tolist(), [sigma] * impacts).interval95()
        held += low <= 0.9 <= high
    assert held >= 0.93 * tests


def test_intervals_from_few_values_hold_hardly_more_than_they_promise():
    """Were a scatter of 15 % as likely beforehand as one of 0.5 %, six values would hold r in 99 %."""
    rng = np.random.default_rng(5)
    tests, sigma, held = 400, 2e-4, 0
    for _ in range(tests):
        speeds = 0.35 * np.cumprod(np.concatenate(([1.0], 0.82 * np.exp(rng.normal(0.0, 0.01, 5)))))
        speeds += rng.normal(0.0, sigma, speeds.size)
        low, high = eav(speeds.tolist(), [sigma] * speeds.size).interval95()
        held += low <= 0.82 <= high
    assert 0.93 * tests <= held <= 0.98 * tests


def test_no_points_no_value():
    for estimate in (
        eav([0.3, 0.2], [1e-3, 1e-3]),
        crt([0.05], [1e-4], ALPHA),
        crt([math.nan, 0.1], [1, 1], ALPHA),
    ):
        assert estimate.r is None and estimate.points == () and estimate.interval95() is None


@pytest.mark.parametrize("scatter", [0.0, 0.02])
def test_fit_of_the_whole_motion_finds_the_body_too(scatter):
    """True p 3 % off: the fit finds it, α and the mean r of the impacts it saw."""
    rng = np.random.default_rng(4)
    rs = np.minimum(0.88 * (1 + rng.normal(0, scatter, 40)), 0.99) if scatter else 0.88
    motion, time, rotation = rock(0.35, rs, noise=5e-5, p=P * 1.03)
    track = follow(motion, time, rotation)
    fit = fit_motion(
        time,
        rotation,
        release_s=track.release.time_s,
        theta0_rad=track.theta0_rad,
        impacts_s=track.impacts_s,
        peaks_rad=track.peaks_rad,
        speeds_rad_s=track.speeds_before_rad_s,
        r=track.crt().r,
        scatter=max(track.crt().scatter, track.eav().scatter),
        noise_rad=5e-5,
        p_rad_s=P,
        alpha_rad=ALPHA,
    )
    truth = float(np.mean(motion.restitution[: fit.impacts]))
    assert fit.explains_the_motion
    assert fit.p_rad_s == pytest.approx(P * 1.03, rel=2e-3)
    assert fit.alpha_rad == pytest.approx(ALPHA, rel=3e-3)
    assert fit.r == pytest.approx(truth, abs=max(1e-3, 0.15 * scatter))
    assert abs(fit.r - 0.88) < 4 * fit.standard_error + 1e-4


def test_the_errors_of_p_and_alpha_hold_where_slow_noise_is_more_than_it_is_taken_for():
    """A fit takes up a part of slow noise: by what it leaves alone, p would be off by 1.2 of its errors."""
    rng = np.random.default_rng(1)
    white, slow, keep, off = 8e-5, 2.4e-5, math.exp(-1.0 / 20.0), []
    for _ in range(100):
        motion, time, rotation = rock(0.2, 0.88 * np.exp(0.003 * rng.standard_normal(40)), smallest=1e-3)
        noise = slow * lfilter([math.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(time.size))
        fit = fit_motion(
            time,
            rotation + noise + white * rng.standard_normal(time.size),
            release_s=0.6,
            theta0_rad=float(motion.peaks_rad[0]),
            impacts_s=motion.impacts_s.tolist(),
            peaks_rad=motion.peaks_rad.tolist(),
            speeds_rad_s=motion.speeds_before_rad_s.tolist(),
            r=0.88,
            scatter=0.003,
            noise_rad=1.2 * white,
            p_rad_s=P,
            alpha_rad=ALPHA,
        )
        off.append(((fit.p_rad_s - P) / fit.sigma_p_rad_s, (fit.alpha_rad - ALPHA) / fit.sigma_alpha_rad))
    assert np.all(np.std(off, axis=0) < 1.1)
    assert np.all(np.std(off, axis=0) > 0.8)


@pytest.mark.parametrize("spread", [None, 0.02])
def test_jacobian_of_the_fit_is_that_of_its_residual(spread):
    time = np.arange(0.5, 6.0, 0.008)
    model = MotionModel(time, np.zeros(time.size), 1e-5, 0.6, 0.075, -1.0, P, ALPHA, math.log(0.9), spread)
    size = FIXED + (0 if spread is None else 8)
    x = np.random.default_rng(0).normal(0, 0.3, size)
    analytic = model.jacobian(x, 9, 5.5)
    for column in range(size):
        step = np.zeros(size)
        step[column] = 1e-5
        numeric = (model.residual(x + step, 9, 5.5) - model.residual(x - step, 9, 5.5)) / 2e-5
        np.testing.assert_allclose(analytic[:, column], numeric, atol=1e-4 * np.abs(numeric).max())


def test_a_fit_that_strays_to_no_r_at_all_still_has_a_residual():
    time = np.arange(0.5, 6.0, 0.008)
    model = MotionModel(time, np.zeros(time.size), 1e-5, 0.6, 0.075, -1.0, P, ALPHA, math.log(0.9), 0.15)
    x = np.zeros(FIXED + 8)
    x[5] = -6e21

    assert np.isfinite(model.residual(x, 9, 5.5)).all()


def test_a_gain_that_differs_by_side_does_not_reach_eav():
    """Pairs are of the same side: speeds that read 5 % high on one side change nothing."""
    speeds = 0.3 * 0.9 ** np.arange(12.0)
    speeds[::2] *= 1.05
    estimate = eav(speeds.tolist(), (1e-4 * speeds).tolist())
    assert estimate.r == pytest.approx(0.9, abs=1e-6)
    assert estimate.scatter == 0.0 and estimate.standard_error < 1e-4


@pytest.mark.parametrize("side", [1, -1])
def test_half_cycles_to_one_side_alone_tell_no_alpha_and_p(side):
    peaks_rad, noise_rad = np.array([0.04, 0.03, 0.02, 0.015, 0.01]), np.full(5, 1e-5)
    durations_s = 2.0 * exact_quarter_period(peaks_rad, 2.2, 0.21)

    assert body_of_half_cycles(side * peaks_rad, noise_rad, durations_s, noise_rad, 0.215, 2.2) is None
