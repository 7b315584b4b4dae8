"""Motion on edges that yield, against the law of the strip that scipy integrates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from daq_app.rocking.theory.housner import free_rocking
from daq_app.rocking.theory.yielding_edge import YieldingEdge, free_rocking_on

P, ALPHA, LEAN, R = 2.2, 0.2135, 1e-3, 0.9
THETA0, RELEASE_S, IMPACTS = 0.08, 0.4, 12
EDGES = [YieldingEdge(1e-3, 4e-3), YieldingEdge(3e-3, 2e-2), YieldingEdge(-1e-3, 1e-3)]


def lever(edge, theta):
    """c/R by the definition: a strip of half-width `inset` that carries W, in contact over all or a part."""
    width = 2.0 * edge.inset_rad
    if theta <= edge.lift_rad:
        return width / 2.0 * (1.0 - theta / (3.0 * edge.lift_rad))
    return width / 3.0 * np.sqrt(edge.lift_rad / theta)


def integrated(edge, theta0):
    """Impacts, peaks, and (side, dense solution, begin, end) of each half-cycle, by scipy."""
    impacts, peaks, courses = [], [theta0], []
    start, state, side = RELEASE_S, [theta0, 0.0], 1.0
    for _ in range(IMPACTS):
        alpha = ALPHA + side * LEAN

        def slopes(_, state, alpha=alpha):
            return [state[1], -(P**2) * (np.sin(alpha - state[0]) - lever(edge, max(state[0], 0.0)))]

        def through_zero(_, state):
            return state[0]

        through_zero.terminal, through_zero.direction = True, -1.0
        found = solve_ivp(
            slopes,
            (start, start + 5.0),
            state,
            events=through_zero,
            dense_output=True,
            rtol=1e-11,
            atol=1e-13,
            max_step=0.01,
        )
        courses.append((side, found.sol, start, found.t[-1]))
        start, state, side = found.t[-1], [1e-15, -R * found.y[1, -1]], -side
        impacts.append(start)
        peaks.append(found.y[0].max())
    return impacts, peaks, courses


@pytest.mark.parametrize("edge", EDGES)
def test_the_motion_is_that_of_the_strip(edge):
    impacts, _, courses = integrated(edge, THETA0)
    motion = free_rocking_on(
        edge, THETA0, R, P, ALPHA, release_s=RELEASE_S, max_impacts=IMPACTS + 2, lean_rad=LEAN
    )

    assert motion.impacts_s[:IMPACTS] == pytest.approx(impacts, abs=1e-6)
    for side, course, begin, end in courses:
        time = np.linspace(begin, end, 60)[1:-1]
        assert motion.at(time)[0] == pytest.approx(side * course(time)[0], abs=5e-7)
        assert motion.at(time)[1] == pytest.approx(side * course(time)[1], abs=2e-6)


@pytest.mark.parametrize("edge", EDGES)
def test_the_work_of_the_strip_is_the_sum_of_its_lever(edge):
    for theta in (0.3 * edge.lift_rad, edge.lift_rad, 20.0 * edge.lift_rad):
        expected = quad(lambda t: lever(edge, t), 0.0, theta, points=[min(edge.lift_rad, theta)])[0]
        assert float(edge.work(theta)) == pytest.approx(expected, rel=1e-9)


def test_edges_without_an_inset_are_sharp():
    sharp = free_rocking(THETA0, R, P, ALPHA, release_s=RELEASE_S, max_impacts=IMPACTS, lean_rad=LEAN)
    motion = free_rocking_on(
        YieldingEdge(0.0, 4e-3), THETA0, R, P, ALPHA, release_s=RELEASE_S, max_impacts=IMPACTS, lean_rad=LEAN
    )
    time = np.linspace(0.0, sharp.impacts_s[-1], 500)

    assert motion.impacts_s == pytest.approx(sharp.impacts_s, abs=1e-12)
    assert motion.at(time)[0] == pytest.approx(sharp.at(time)[0], abs=1e-12)


def test_half_cycles_with_more_energy_reach_further_and_last_longer():
    motion = free_rocking_on(YieldingEdge(1e-3, 4e-3), THETA0, R, P, ALPHA, max_impacts=IMPACTS)
    start = YieldingEdge(1e-3, 4e-3), THETA0 * 1.001
    other = free_rocking_on(*start, R, P, ALPHA, max_impacts=IMPACTS)
    factor = (other.sharp.speeds_before_rad_s[0] / motion.sharp.speeds_before_rad_s[0]) ** 2

    changed = motion.half_cycles.with_energy_times(float(factor))

    assert changed.peaks_rad == pytest.approx(other.half_cycles.peaks_rad, rel=1e-9)
    assert changed.quarters_s == pytest.approx(other.half_cycles.quarters_s, rel=1e-9)


@pytest.mark.parametrize("share", [0.9, 0.97])
def test_an_edge_that_stands_out_and_would_overturn_the_block_gives_a_motion_still(share):
    """A search for the motion of a test strays there; no wall has such an edge."""
    motion = free_rocking_on(
        YieldingEdge(-0.1 * ALPHA, 4.5e-3), share * ALPHA, R, P, ALPHA, max_impacts=IMPACTS
    )
    assert np.all(np.isfinite(motion.at(np.linspace(0.0, 6.0, 601))))
    assert np.all(np.diff(motion.impacts_s) > 0.0)


def test_a_release_beyond_the_angle_of_the_block_is_refused():
    with pytest.raises(ValueError, match="below α"):
        free_rocking_on(YieldingEdge(1e-3, 4.5e-3), 1.01 * ALPHA, R, P, ALPHA)
