"""Where a base that friction does not hold walks in the course of a test, and the runs without that.

Wires go with the base, and accelerometers show its acceleration. With the walk in them the wires' rotation
is off by it, and channels that stop short, or a floor that shakes, are seen where there are none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.optimize import nnls
from scipy.signal import butter, sosfiltfilt

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.slips.base_slip import base_motion
from daq_app.gap.rocking_model.motion.motion_grid import SMOOTH_HZ, Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.walls import BASE_NOISE_M, BASE_SETTLED_S, SLIP_LEFT_OPEN
from daq_app.rocking.families.base.slip import BaseSlip
from daq_app.rocking.theory.friction import push, slips_as_it_rocks

_AROUND: Final = np.geomspace(0.5, 1.4, 10)
"""Rotations below which the base slips that are tried, over that which half-cycles show."""
_BEGINS_S2: Final = (0.0, 2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3)
"""Speeds of a slip just after an impact that are tried, as `BaseSlip` has them."""
_SHORTEST: Final = 4
"""Number of samples of the grid in the shortest half-cycle that is looked at."""


@dataclass(frozen=True, slots=True)
class _Course:
    """Slips of half-cycles by the law, (m,) each on the grid: how far, m, and how fast the base speeds up."""

    along_m: FloatArray
    turn_rad: FloatArray
    along_m_s2: FloatArray
    turn_rad_s2: FloatArray


def without_walk(run: GapRun, test: GapRun, grid: Grid, slip: BaseSlip) -> GapRun:
    """The run whose wires and accelerometers show a wall on a base that stays where it is.

    `test`: the part of it that `grid` is of, from some sample to its end. Wires that do not tell where the
    base is are left as they are.
    """
    walk = walk_of(test, grid, slip)
    if walk is None:
        return replace(run, slip=slip)
    count = run.channels.shape[1]
    since_s = (np.arange(count) - count + test.channels.shape[1] + 0.5) / run.rate_hz
    time_s = grid.time_s[0] - 0.5 / GRID_HZ + since_s
    along, turn, faster, turns = (
        np.interp(time_s, grid.time_s, values)
        for values in (walk.along_m, walk.turn_rad, walk.along_m_s2, walk.turn_rad_s2)
    )
    lean = np.interp(time_s, grid.time_s, grid.theta)
    shares = {"x": np.cos(lean), "z": np.sin(lean)}
    channels = run.channels.copy()
    # Channels that are examined on their own stand on the same base.
    for row, sensor in zip(channels, run.sensors, strict=True):
        y = sensor.position_m[1]
        if sensor.family == "wire":
            row -= along + y * turn
        elif sensor.family == "accelerometer" and not sensor.ac_coupled and sensor.axis in shares:
            row -= (faster + y * turns) * shares[sensor.axis]
    return replace(run, channels=channels, slip=slip)


def walk_of(run: GapRun, grid: Grid, slip: BaseSlip) -> _Course | None:
    """How the base walks, from the release on; None where the run's wires do not tell.

    Each half-cycle slips by the law, times a factor of its own that the wires tell. After the last impact
    that is told the base goes where the wires say.
    """
    seen = base_motion(run, grid)
    courses = [] if seen is None else list(_courses(grid, slip))
    if seen is None or not courses:
        return None
    first, last = np.searchsorted(grid.time_s, (-BASE_SETTLED_S, grid.impact_s[-1]))
    told, others = slice(first, last), _with_rotation(grid.theta)
    laws = np.array([course.along_m for course in courses])
    factors, kept = _factors(laws[:, told], others[told], seen[0, told])
    smooth = sosfiltfilt(butter(4, SMOOTH_HZ, fs=GRID_HZ, output="sos"), seen[0] - others @ kept)
    walked, *rest = (
        factors @ np.array([getattr(course, field.name) for course in courses]) for field in fields(_Course)
    )
    walked[last:] = smooth[last:]
    return _Course(walked, *rest)


def beside_slips(grid: Grid, slip: BaseSlip) -> Grid:
    """The grid that knows where the base slips."""
    slips = np.zeros(grid.theta.size, dtype=np.bool_)
    for course in _courses(grid, slip):
        slips |= course.along_m_s2 != 0.0
    return replace(grid, slips=slips)


def by_whole_tests(runs: Sequence[GapRun], grids: Sequence[Grid], slip: BaseSlip) -> BaseSlip:
    """The slip by the law that fits the walk in the course of whole tests best.

    From its beginning to its end a half-cycle slips as far by a law that is faster and sooner over as by one
    that is slower and lasts longer.
    """
    tried = [(below, begin) for below in (_AROUND * slip.below_rad).tolist() for begin in _BEGINS_S2]
    below_rad, begins_s2 = np.array(tried).T
    design, wanted = [], []
    for run, grid in zip(runs, grids, strict=True):
        moved = base_motion(run, grid)
        if moved is None or not grid.impact_s.size:
            continue
        told = slice(*np.searchsorted(grid.time_s, (-BASE_SETTLED_S, grid.impact_s[-1])))
        basis, _ = np.linalg.qr(_with_rotation(grid.theta)[told])
        walks = np.zeros((told.stop - told.start, 2 * len(tried)))
        for cycle in _half_cycles(grid, below_rad, begins_s2):
            edge = slice(cycle.edge * len(tried), (cycle.edge + 1) * len(tried))
            walks[:, edge] += cycle.side * cycle.way[told]
        design.append(walks - basis @ (basis.T @ walks))
        wanted.append(moved[0, told] - basis @ (basis.T @ moved[0, told]))
    if not design:
        return slip
    columns, values = np.vstack(design).reshape(-1, 2, len(tried)), np.concatenate(wanted)
    fits = [nnls(columns[:, :, place], values) for place in range(len(tried))]
    place = min(range(len(tried)), key=lambda k: fits[k][1])
    along = fits[place][0]
    faster = float(np.abs(along).max() / np.abs(slip.along).max())
    survey = runs[0].survey
    return replace(
        slip,
        below_rad=float(below_rad[place]),
        friction=push(float(below_rad[place]), survey.alpha_rad, survey.p_rad_s, survey.r0_m),
        begins_s2=float(begins_s2[place]),
        along=along,
        turning=faster * slip.turning,
    )


def _with_rotation(theta: FloatArray) -> FloatArray:
    """What calibrations and anchors of the wires make of a base that stands still, (m, 4)."""
    return np.column_stack([np.ones_like(theta), theta, np.abs(theta), theta**2])


def _factors(laws: FloatArray, others: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Factor of each law (k, n), near 1, and sizes of the columns `others` (n, j), by least squares."""
    design = np.column_stack([laws.T, others]) / BASE_NOISE_M
    near = np.eye(len(laws), design.shape[1]) / SLIP_LEFT_OPEN
    wanted = np.append(seen / BASE_NOISE_M, np.full(len(laws), 1.0 / SLIP_LEFT_OPEN))
    sizes = np.linalg.lstsq(np.vstack([design, near]), wanted, rcond=None)[0]
    return sizes[: len(laws)], sizes[len(laws) :]


@dataclass(frozen=True, slots=True)
class _HalfCycle:
    """What laws say of a half-cycle for an acceleration of 1 m/s² for each rad, (m, k) on the grid."""

    side: float
    """The edge that the wall is on: −1 is the one at x < 0, 1 the one at x > 0."""
    way: FloatArray
    """How far that edge slips outwards, rad s²."""
    acceleration: FloatArray
    """rad."""

    @property
    def edge(self) -> int:
        """Place of the edge in what `BaseSlip` says of both."""
        return int(self.side > 0.0)


def _half_cycles(grid: Grid, below_rad: FloatArray, begins_s2: FloatArray) -> Iterator[_HalfCycle]:
    """What laws (k,) say of each half-cycle that is told, from the release on."""
    if not grid.impact_s.size:
        return
    starts = np.searchsorted(grid.time_s, np.append(0.0, grid.impact_s))
    sides = np.append(-np.sign(grid.approach[0]), np.sign(grid.approach))
    speeds = np.append(0.0, np.abs(grid.approach))
    for (start, end), side, speed in zip(pairwise(starts.tolist()), sides.tolist(), speeds, strict=False):
        if end - start < _SHORTEST:
            continue
        rotations = np.abs(grid.theta[start:end])
        slipping, course = slips_as_it_rocks(below_rad, rotations, 1.0 / GRID_HZ, begins_s2 * speed)
        way, acceleration = np.zeros((2, grid.theta.size, below_rad.size))
        way[start:end], way[end:] = course, course[-1]
        acceleration[start:end] = np.gradient(slipping, 1.0 / GRID_HZ, axis=0)
        yield _HalfCycle(side, way, acceleration)


def _courses(grid: Grid, slip: BaseSlip) -> Iterator[_Course]:
    """What the law of a slip says of each half-cycle on an edge that slips."""
    for cycle in _half_cycles(grid, np.array([slip.below_rad]), np.array([slip.begins_s2])):
        along, turning = cycle.side * slip.along[cycle.edge], cycle.side * slip.turning[cycle.edge]
        if slip.along[cycle.edge] > 0.0:
            way, faster = cycle.way[:, 0], cycle.acceleration[:, 0]
            yield _Course(along * way, turning * way, along * faster, turning * faster)
