"""Shapes that the regressions on the coarse grid use are means over its intervals, not values of means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.response import bessel
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import examine, extract
from daq_app.gap.rocking_model.features.shapes import UPRIGHT_RAD, moment_shape, side_of, stepped_shape
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, coarse, pivots_off, wires_of
from daq_app.rocking.geometry.wires import wire_shortening
from tests.support.simulated_wall import simulate

RATE_HZ = 4000.0
ALPHA = 0.215


def _rocking() -> np.ndarray:
    """Rotation of ever shorter half-cycles that cross zero anywhere in the grid's intervals, (n,)."""
    t = np.arange(0.0, 8.0, 1.0 / RATE_HZ)
    return 0.06 * np.exp(-0.3 * t) * np.cos(2 * np.pi * (0.6 * t + 0.05 * t**2))


def test_the_side_in_the_interval_of_an_impact_is_its_mean() -> None:
    theta = _rocking()
    true = coarse(np.tanh(theta / UPRIGHT_RAD), RATE_HZ)
    of_means = np.tanh(coarse(theta, RATE_HZ) / UPRIGHT_RAD)
    error = np.abs(side_of(coarse(theta, RATE_HZ)) - true)
    assert error.max() < 0.03
    assert np.abs(of_means - true).max() > 0.5, "else there would be nothing to be careful about"


def test_a_base_that_gives_way_is_found_without_bias() -> None:
    """Regression of the true step, averaged, on the shape: an error in the shape makes it too small."""
    theta = _rocking()
    sharp = np.tanh(theta / UPRIGHT_RAD) * np.sin(ALPHA - np.abs(theta)) / np.sin(ALPHA)
    seen, mean = coarse(sharp, RATE_HZ), coarse(theta, RATE_HZ)
    columns = np.column_stack([moment_shape(mean, ALPHA), mean, np.gradient(mean) * GRID_HZ])
    step = np.linalg.lstsq(columns, seen, rcond=None)[0][0]
    assert abs(step - 1.0) < 2e-3


def test_a_base_seems_to_move_by_what_calibrations_of_wires_make() -> None:
    """Four wires a metre and a half up and higher say twice as little of it as five."""
    (plain,) = simulate({}, (0.35,))
    levers = []
    for left_out in ((), ("WP-1",)):
        run = plain.excluding(left_out)
        seen = extract(run)
        changed = []
        for i in run.indices("wire"):
            other = replace(run, channels=run.channels.copy())
            other.channels[i] *= 1.01
            changed.append((_follows(extract(other)) - _follows(seen)) / 0.01)
        levers.append(seen.base_lever)
        assert seen.base_lever == pytest.approx(np.linalg.norm(changed), rel=0.03)
    assert levers[1] > 2.0 * levers[0]


def _follows(run: RockingRun) -> float:
    block = next(b for b in run.blocks if b.family == "base")
    return float(block.values[block.names.index("follows rotation")])


def test_a_slip_within_an_interval_counts_for_the_part_of_it_that_follows() -> None:
    impacts, speeds = np.array([0.5013, 0.9471, 1.2]), np.array([0.3, -0.25, 0.2])
    fine = np.arange(0.0, 2.0, 1.0 / RATE_HZ) + 0.5 / RATE_HZ
    slipped = np.sum(speeds[:, None] * (fine[None, :] > impacts[:, None]), axis=0) - speeds.sum()
    empty = np.zeros(0)
    time_s = coarse(fine, RATE_HZ)
    none = np.zeros(time_s.size, dtype=bool)
    grid = Grid(
        time_s,
        empty,
        empty,
        empty,
        empty,
        none,
        impacts,
        empty,
        1.5,
        empty,
        jumps=empty,
        approach=speeds,
        slips=none,
    )
    assert np.abs(stepped_shape(grid, alternating=True) - coarse(slipped, RATE_HZ)).max() < 0.02


def test_a_filter_of_no_delay_shows_where_more_would_lead() -> None:
    """Without it a filter that is not there had the evidence of nothing missing in every diagnosis."""
    series = np.sin(np.arange(400) / 30.0)
    slope = (bessel(series, 1e-6) - bessel(series, 0.0)) / 1e-6
    assert slope[50:-50] == pytest.approx(((bessel(series, 2e-3) - series) / 2e-3)[50:-50], abs=0.15)
    assert np.abs(slope).max() > 1.0


def test_impacts_do_not_reach_the_accelerometers_gain_of_inertia() -> None:
    """A filter carries a knock past the samples left out around it: 0.2 % more inertia, as of a clock."""
    (run,) = simulate({}, levels=(-0.25,))
    seen = examine(run)
    before = next(b for b in seen.features.blocks if b.family == "accelerometer")
    knocked = replace(seen.run, channels=seen.run.channels.copy())
    chosen = knocked.indices("accelerometer", "x")
    grid = seen.features.grid
    for time_s, jump in zip(seen.features.swings.release_s + grid.impact_s, grid.jumps, strict=True):
        k = round(time_s * RATE_HZ)
        knocked.channels[chosen, k - 4 : k + 5] += 40.0 * np.sign(jump)
    after = next(b for b in extract(knocked).blocks if b.family == "accelerometer")
    assert after.values == pytest.approx(before.values, abs=1e-4)


def test_wires_see_a_shifted_pivot_as_they_are_strung() -> None:
    """More than the travel of the base: the face with the wires rises by as much as its edge is away, and the
    slope that a wire has by then shows where the pivot is. On the other side the face itself is the edge."""
    run = simulate({}, (0.35,))[0]
    wires, half, shift = wires_of(run), run.survey.half_base_m, 0.03
    theta = np.array([-0.08, -0.04, 0.02, 0.08])
    turned, moved = pivots_off(wires, theta)
    z = np.array([wire.sensor.position_m[2] for wire in wires])
    rows, base = [], []
    for wire in wires:
        shorter = wire_shortening(theta, wire.sensor.position_m, wire.anchor_m, half - shift)
        rows.append(wire.rotation(shorter))
        base.append(shorter - wire.shortening(theta))
    mean = np.average(np.array(rows), axis=0, weights=z**2) - theta
    np.testing.assert_allclose(-shift * turned, mean, rtol=0.03, atol=1e-7)
    line = np.polynomial.Polynomial.fit
    ends = [line(z, column, 1).convert().coef[0] for column in np.array(base).T]
    np.testing.assert_allclose(-shift * moved, ends, rtol=0.03, atol=1e-7)
    travel = 1.0 - np.cos(theta)
    assert abs(moved[0]) > 1.2 * travel[0] or abs(moved[0]) < 0.8 * travel[0]
    assert moved[-1] == pytest.approx(travel[-1], rel=0.02)
