"""The stated error of the fitted p is as large as what makes it: slow noise, a zero that walks, places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from daq_app.config import load_rig
from daq_app.rocking.geometry.kinematics import RotationGeometry
from daq_app.rocking.motion.fit_errors import long_run_variance
from daq_app.rocking.motion.motion_fit import fit_motion
from daq_app.rocking.motion.swings import REST_ZERO_SIGMA_RAD
from daq_app.rocking.theory.housner import free_rocking
from daq_app.rocking.theory.yielding_edge import YieldingEdge, free_rocking_on

RATE_HZ, RELEASE_S, R = 500.0, 0.5, 0.88
NOISE_RAD = 1e-6
DRAWS = 16


@pytest.fixture(scope="module")
def rig(configs):
    return load_rig(configs / "fr1.toml")


def rocking(rig, share, lean_rad=0.0, r=R):
    """Time, rotation and motion of a block let go at `share` of α."""
    specimen = rig.specimen
    theta0 = share * specimen.alpha0_rad
    motion = free_rocking(
        theta0,
        np.full(40, r),
        specimen.p_rad_s,
        specimen.alpha0_rad,
        release_s=RELEASE_S,
        smallest_peak_rad=0.02 * theta0,
        max_impacts=20,
        lean_rad=lean_rad,
    )
    time = np.arange(0.0, motion.impacts_s[-1] + 0.5, 1.0 / RATE_HZ)
    return time, np.where(time < RELEASE_S, theta0, motion.at(time)[0]), motion


def on_a_strip(rig, share, edge):
    """The same on edges that yield."""
    specimen = rig.specimen
    theta0 = share * specimen.alpha0_rad
    motion = free_rocking_on(
        edge, theta0, R, specimen.p_rad_s, specimen.alpha0_rad, release_s=RELEASE_S, max_impacts=20
    )
    time = np.arange(0.0, motion.impacts_s[-1] + 0.5, 1.0 / RATE_HZ)
    return time, np.where(time < RELEASE_S, theta0, motion.at(time)[0]), motion


def fitted(rig, time, rotation, motion, *, speeds_off=0.0, edges_yield=True):
    """The fit that starts from speeds that are off by this share at random."""
    impacts = [float(value) for value in motion.impacts_s]
    off = 1.0 + speeds_off * np.random.default_rng(9).standard_normal(len(impacts))
    return fit_motion(
        time,
        rotation,
        release_s=RELEASE_S,
        theta0_rad=float(rotation[0]),
        impacts_s=impacts,
        peaks_rad=[float(value) for value in np.abs(motion.peaks_rad)],
        speeds_rad_s=[float(value) / R for value in np.abs(motion.speeds_after_rad_s) * off],
        r=R,
        scatter=3e-4,
        noise_rad=NOISE_RAD,
        p_rad_s=rig.specimen.p_rad_s,
        alpha_rad=rig.specimen.alpha0_rad,
        edges_yield=edges_yield,
    )


def test_p_is_off_by_its_stated_error_where_the_zero_walks(rig):
    time, rotation, motion = rocking(rig, 0.4)
    exact = fitted(rig, time, rotation, motion).p_rad_s
    rng = np.random.default_rng(5)
    step = REST_ZERO_SIGMA_RAD / np.sqrt(np.count_nonzero(time > RELEASE_S))

    walks = np.cumsum(rng.normal(0.0, step, (DRAWS, time.size)), axis=1)
    fits = [fitted(rig, time, rotation + walk, motion) for walk in walks]

    off = np.array([(fit.p_rad_s - exact) / fit.sigma_p_rad_s for fit in fits])
    # Residuals hold a share of the walk as well, and widen the error by it.
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.3


@pytest.mark.parametrize("share", [0.25, 0.5])
@pytest.mark.parametrize("lean_rad", [7e-4, -2e-3])
def test_a_wall_that_leans_shows_its_own_p_alpha_r_and_zero(rig, share, lean_rad):
    """A centre of mass 1 mm off the middle, or a base off level, is no error of the zero, no scatter of r."""
    time, rotation, motion = rocking(rig, share, lean_rad)
    noise = np.random.default_rng(8).normal(0.0, NOISE_RAD, time.size)

    fit = fitted(rig, time, rotation + noise, motion, speeds_off=1e-3)

    specimen = rig.specimen
    assert fit.p_rad_s == pytest.approx(specimen.p_rad_s, abs=3.0 * fit.sigma_p_rad_s)
    assert fit.alpha_rad == pytest.approx(specimen.alpha0_rad, abs=3.0 * fit.sigma_alpha_rad)
    assert fit.r == pytest.approx(R, abs=1e-4)
    assert np.ptp(fit.restitutions) < 3e-3
    assert abs(fit.zero_rad) < 1e-5
    assert fit.lean_rad == pytest.approx(lean_rad, abs=5e-5)


@pytest.mark.parametrize("lift_rad", [0.0015, 0.004, 0.01])
def test_p_and_alpha_of_edges_that_yield_hold_where_their_strip_lifts(rig, lift_rad):
    """A strip of 3 mm that lifts at a rotation which the fit is not told."""
    strip = YieldingEdge(1e-3, lift_rad)
    time, rotation, motion = on_a_strip(rig, 0.3, strip)
    noise = np.random.default_rng(8).normal(0.0, NOISE_RAD, time.size)

    fit = fitted(rig, time, rotation + noise, motion.sharp)

    specimen = rig.specimen
    assert fit.p_rad_s == pytest.approx(specimen.p_rad_s, abs=2.0 * fit.sigma_p_rad_s)
    assert fit.alpha_rad == pytest.approx(specimen.alpha0_rad, abs=2.0 * fit.sigma_alpha_rad)
    assert fit.r == pytest.approx(R, abs=2e-4)
    assert fit.sigma_p_rad_s < 0.003 * fit.p_rad_s


def test_edges_that_are_held_to_be_sharp_leave_p_better_known_and_wrong_where_they_yield(rig):
    time, rotation, motion = on_a_strip(rig, 0.3, YieldingEdge(1e-3, 0.004))
    free = fitted(rig, time, rotation, motion.sharp)
    held = fitted(rig, time, rotation, motion.sharp, edges_yield=False)

    assert held.inset_rad == 0.0
    assert free.inset_rad == pytest.approx(1e-3, abs=1e-4)
    assert held.sigma_p_rad_s < free.sigma_p_rad_s
    assert abs(held.p_rad_s - rig.specimen.p_rad_s) > 3.0 * held.sigma_p_rad_s


def test_wires_a_millimetre_off_move_p_by_less_than_its_stated_error(rig):
    geometry = RotationGeometry.from_rig(rig)
    time, rotation, motion = rocking(rig, 0.25)
    exact = fitted(rig, time, rotation, motion)
    rng = np.random.default_rng(6)

    def moved(places):
        return places + rng.normal(0.0, 1e-3, places.shape)

    off = []
    for _ in range(DRAWS):
        wires = geometry.wires
        drawn = replace(wires, position_m=moved(wires.position_m), anchor_m=moved(wires.anchor_m))
        seen = geometry.weights()[0] @ wires.rotation_of_each(drawn.shortening(rotation))
        off.append(fitted(rig, time, seen, motion).p_rad_s - exact.p_rad_s)

    assert np.sqrt(np.mean(np.square(off))) < exact.sigma_p_rad_s / 2.0


def test_noise_that_stays_correlated_counts_with_all_of_its_variance_for_slow_parameters():
    """Of points with a correlation ρ from one to the next, means of many vary by (1 + ρ)/(1 − ρ) more."""
    rng, correlation, points = np.random.default_rng(7), 0.45, 200_000
    noise = lfilter([1.0], [1.0, -correlation], rng.standard_normal(points)) * np.sqrt(1.0 - correlation**2)
    no_parameter = np.zeros((points, 1))

    variance = long_run_variance(noise, no_parameter, no_parameter)

    assert variance == pytest.approx((1.0 + correlation) / (1.0 - correlation), rel=0.03)


def test_a_wall_that_hardly_stops_is_fitted_by_its_first_hundred_impacts(rig):
    """A shaking floor keeps a wall rocking for hundreds: a deviation for each makes a fit last minutes."""
    specimen, r = rig.specimen, 0.99
    motion = free_rocking(
        0.3 * specimen.alpha0_rad,
        np.full(160, r),
        specimen.p_rad_s,
        specimen.alpha0_rad,
        release_s=RELEASE_S,
        max_impacts=160,
    )
    time = np.arange(0.0, motion.impacts_s[-1] + 0.5, 1.0 / RATE_HZ)
    rotation = np.where(time < RELEASE_S, 0.3 * specimen.alpha0_rad, motion.at(time)[0])
    speeds = np.abs(motion.speeds_after_rad_s) / r
    fit = fit_motion(
        time,
        rotation,
        release_s=RELEASE_S,
        theta0_rad=float(rotation[0]),
        impacts_s=motion.impacts_s.tolist(),
        peaks_rad=np.abs(motion.peaks_rad).tolist(),
        speeds_rad_s=speeds[: motion.impacts_s.size].tolist(),
        r=r,
        scatter=3e-4,
        noise_rad=NOISE_RAD,
        p_rad_s=specimen.p_rad_s,
        alpha_rad=specimen.alpha0_rad,
    )
    assert motion.impacts_s.size == 160
    assert fit.impacts == 100
    assert fit.r == pytest.approx(r, abs=1e-4)


@pytest.mark.parametrize("r", [0.998, 1.0])
def test_a_motion_that_loses_next_to_nothing_gives_no_r(rig, r):
    """The search keeps r below 1, where its error would be next to nothing."""
    time, rotation, motion = rocking(rig, 0.25, r=r)
    assert fitted(rig, time, rotation, motion) is None


@pytest.mark.parametrize("off", [0.8, 1.4])
def test_a_first_search_that_ends_where_impacts_lose_nothing_is_not_the_last(rig, off):
    """With α and p far from the survey's and speeds that say nothing it does; a thorough one finds r."""
    time, rotation, motion = rocking(rig, 0.4 if off < 1.0 else 0.25)
    fit = fit_motion(
        time,
        rotation,
        release_s=RELEASE_S,
        theta0_rad=float(rotation[0]),
        impacts_s=motion.impacts_s.tolist(),
        peaks_rad=np.abs(motion.peaks_rad).tolist(),
        speeds_rad_s=[1.0] * motion.impacts_s.size,
        r=R,
        scatter=3e-4,
        noise_rad=NOISE_RAD,
        p_rad_s=off * rig.specimen.p_rad_s,
        alpha_rad=off * rig.specimen.alpha0_rad,
    )
    assert fit is not None
    assert fit.r == pytest.approx(R, abs=1e-4)
