"""What each sensor family says beyond the reference rotation: small regressions with full covariance.

For every family the difference between what it shows and what the reference rotation implies is
explained by a few shapes (gain, lag, a step with the moment, drift …). A hypothesis predicts the
same coefficients by passing its own difference through the same regression.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfiltfilt

from daq_app.gap.core.features import FloatArray, independent_fraction
from daq_app.gap.rocking_model.motion.late_joint import in_step
from daq_app.gap.rocking_model.motion.motion_grid import GRID_HZ, Grid, coarse
from daq_app.gap.rocking_model.motion.rotation import (
    Rotation,
    WireInverse,
    wall_rotation,
    wire_reading,
    zeroed,
)
from daq_app.gap.rocking_model.motion.swings import Swings
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun

SWAY_HZ = 8.0
"""Nobody sways five tonnes faster."""
OTHER_WIRES = 2e-3
"""Difference in calibration between the mean of some wires and that of all."""


@dataclass(frozen=True, slots=True)
class Shares:
    """What a signal put together from several channels shows of each way in which they can move.

    Of bending or turning the sensors that are left may show more than one, where they no longer stand
    evenly on both sides of the middle.
    """

    rotation: float = 0.0
    """Of an error of the family's rotation, m (m/s² of the angular acceleration)."""
    bend: float = 0.0
    """Of the bending at the top of the wall; 1/m in signals of turning."""
    yaw: float = 0.0
    """Of the angle about the vertical, m; 1 or none in signals of turning."""
    twist: float = 0.0
    """Of the rotation's slope along the length, m²; m in signals of turning."""


@dataclass(frozen=True, slots=True)
class Block:
    """Coefficients of one family in one run, with the regression that made them.

    `values` (k,), `covariance` (k, k), `projection` (k, m'): coefficients = projection @ series on
    the samples `pick` of the grid.
    """

    family: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    projection: FloatArray
    pick: NDArray[np.bool_]
    kind: str = ""
    """Which rule predicts it; empty where the family's name says so."""
    expected: FloatArray | None = None
    """Of a single channel: what the others make of it, on the whole grid."""
    design: FloatArray | None = None
    """Of a single channel: the shapes of the regression at the samples of `pick`."""
    noise: float = 1.0
    """Of a single channel: rms at rest."""
    wire: WireInverse | None = None
    """Of a single wire: how its rotation was made from its length, which is what its faults act on."""
    ring: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of a ring-down: frequency in Hz, damping ratio, rate of the grid in Hz."""
    levers: tuple[float, ...] = ()
    """Of a single channel: the relative error of its prediction."""
    shares: tuple[Shares, ...] = ()
    """Of a ring-down: what the signal of each coefficient shows."""
    fading: tuple[float, ...] = ()
    """Of a ring-down: change of each coefficient of unit size per ln of the damping ratio."""
    undone_s: float = 0.0
    """Delay of accelerometers (of a ring-down) or LVDTs (of the joint) that was undone before."""
    unequal: FloatArray | None = None
    """Of a ring-down, (k,): what calibrations that differ by one sd add to each coefficient in all runs."""
    tags: Mapping[str, str] = field(default_factory=dict)
    """Sensor family behind a channel or a mark."""
    said: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    """(channel, observable) under which a coefficient is spoken of, where not the block's and its name."""

    @property
    def independent(self) -> bool:
        """Whether its coefficients' errors are independent: then no loadings are needed for them."""
        return not np.any(self.covariance - np.diag(np.diag(self.covariance)))

    @property
    def rule(self) -> str:
        return self.kind or self.family

    def coefficients(self, series: FloatArray) -> FloatArray:
        """What the regression makes of a difference given on the whole grid."""
        found: FloatArray = self.projection @ series[self.pick]
        return found


def first_order(values: FloatArray, time_constant_s: float, rate_hz: float = GRID_HZ) -> FloatArray:
    """Response of a slow sensor that starts in balance."""
    if time_constant_s <= 0:
        return values
    a = np.exp(-1.0 / (time_constant_s * rate_hz))
    # The input is linear between samples: exact discretisation of the ramp response.
    b0 = 1.0 - (1.0 - a) * time_constant_s * rate_hz
    b1 = (1.0 - a) * time_constant_s * rate_hz - a
    state = np.array([values[0] - b0 * values[0]])
    found: FloatArray = lfilter([b0, b1], [1.0, -a], values, zi=state)[0]
    return found


UPRIGHT_RAD = 1e-4
"""Rotation over which the reaction goes from one edge to the other."""


def side_of(theta: FloatArray) -> FloatArray:
    """Which edge carries the wall, −1 … 1: the mean of tanh(θ/0.1 mrad) over each interval of the grid.

    In the interval of an impact the wall is on both edges in turn. The sign of its mean rotation would
    be wrong there, and an explanatory variable with errors makes every coefficient too small.
    """
    half = np.maximum(0.5 * np.abs(np.gradient(theta)), 1e-3 * UPRIGHT_RAD)

    def integral(rotation: FloatArray) -> FloatArray:
        size = np.abs(rotation) / UPRIGHT_RAD
        found: FloatArray = size + np.log1p(np.exp(-2.0 * size))
        return found

    mean: FloatArray = 0.5 * UPRIGHT_RAD / half * (integral(theta + half) - integral(theta - half))
    return mean


def moment_shape(theta: FloatArray, alpha: float) -> FloatArray:
    """Overturning moment over its largest value: sgn θ · sin(α − |θ|)/sin α, rounded at upright."""
    shape: FloatArray = side_of(theta) * np.sin(alpha - np.abs(theta)) / np.sin(alpha)
    return shape


def regress(
    family: str,
    difference: FloatArray,
    columns: dict[str, tuple[FloatArray, str]],
    pick: NDArray[np.bool_],
    absorbed: tuple[str, ...] = (),
) -> Block | None:
    """Least squares of a difference on named shapes; None with too few samples.

    The shapes `absorbed` are fitted but say nothing about the wall or the sensor, and are dropped.
    """
    if pick.sum() < 20 * len(columns):
        return None
    design = np.column_stack([column[pick] for column, _ in columns.values()])
    scale = np.sqrt(np.mean(design**2, axis=0)) + 1e-300
    scaled = np.linalg.pinv(design / scale, rcond=1e-8)
    projection = scaled / scale[:, None]
    values = projection @ difference[pick]
    residual = difference[pick] - design @ values
    fraction = max(independent_fraction(residual), 0.01)
    variance = float(residual @ residual) / max(residual.size - len(columns), 1) / fraction
    covariance = variance * projection @ projection.T
    kept = [k for k, name in enumerate(columns) if name not in absorbed]
    names = tuple(name for name in columns if name not in absorbed)
    units = tuple(unit for name, (_, unit) in columns.items() if name not in absorbed)
    return Block(family, names, units, values[kept], covariance[np.ix_(kept, kept)], projection[kept], pick)


def blocks_of(
    run: GapRun,
    joint: Rotation,
    grid: Grid,
    swings: Swings,
    reference: str,
    calm: NDArray[np.bool_],
    late: bool = False,
) -> dict[str, Block]:
    """All blocks that the run's channels allow, by name; `calm` are samples at which nothing rings, and
    `late` says that the LVDTs are sound but for their time."""
    before = grid.time_s < -0.1
    middle = float(np.median(grid.raw[before])) if before.any() else 0.0
    held = calm & (np.abs(grid.raw - middle) < 0.01 * abs(middle))
    # A wall that sways in the hand accelerates more than its gravity differs from the model's.
    mean_error = 3.0 * swings.hold_rate_sd / max(float(held.sum()) / GRID_HZ, 0.05)
    held &= mean_error < 0.005 * GRAVITY_M_S2 * abs(middle)
    rocking = (grid.time_s > -0.2) & (grid.time_s < swings.rest_s - swings.release_s + 0.2)
    pick = rocking & grid.valid
    last = grid.impact_s[-1] if grid.impact_s.size else 0.0
    found: dict[str, Block | None] = {
        "wire": _wire_block(run, joint, grid, pick, reference),
        "tiltmeter": _tilt_block(run, grid, rocking),
        # While the wall is held there is gravity alone: its gain is then known apart from inertia's.
        "accelerometer": _acceleration_block(
            run,
            grid,
            (held & (grid.time_s < -0.1))
            | (rocking & (grid.time_s > 0.05) & (grid.time_s < last) & ~grid.near_impact),
        ),
        "base": _translation_block(run, grid, swings, rocking),
    }
    if reference == "lvdt":
        found["joint"] = _lift_block(run, joint, grid, pick)
        found["twist"] = _twist_block(run, joint, grid, pick)
    elif late and joint.whole:
        own = in_step(joint, grid, run.rate_hz)
        lifted = _lift_block(run, own.joint, own.grid, pick & own.pick)
        found["joint"] = lifted and replace(lifted, undone_s=own.late_s)
        found["twist"] = _twist_block(run, own.joint, own.grid, pick & own.pick)
    return {name: block for name, block in found.items() if block is not None}


def _wire_block(
    run: GapRun, joint: Rotation, grid: Grid, pick: NDArray[np.bool_], reference: str
) -> Block | None:
    rows, heights, _ = wall_rotation(run)
    if len(rows) == 0:
        return None
    theta = np.average(rows, axis=0, weights=heights**2)
    some = len(rows) < len(run.indices("wire"))
    compared = coarse(theta, run.rate_hz) - (
        coarse(joint.theta, run.rate_hz) if reference == "wire" else grid.theta
    )
    columns = rotation_columns(grid, run.survey.alpha_rad)
    found = regress("wire", compared, columns, pick & grid.settled, ("zero",))
    if found is not None and some:
        # Other wires than in the other runs: their mean has another calibration.
        found.covariance[found.names.index("gain"), found.names.index("gain")] += OTHER_WIRES**2
    return found


def rotation_columns(grid: Grid, alpha: float) -> dict[str, tuple[FloatArray, str]]:
    """Shapes in which two measures of the rotation can differ."""
    return {
        "zero": (np.ones_like(grid.theta), "rad"),
        "gain": (grid.theta, "1"),
        "lag": (-grid.omega, "s"),
        "even harmonic": (grid.theta**2, "1/rad"),
        "step with moment": (moment_shape(grid.theta, alpha), "rad"),
        "drift": (grid.time_s, "rad/s"),
    }


def _tilt_block(run: GapRun, grid: Grid, pick: NDArray[np.bool_]) -> Block | None:
    chosen = [i for i in run.indices("tiltmeter", "x") if np.all(np.isfinite(run.channels[i]))]
    if not chosen:
        return None
    slow = run.sensors[chosen[0]].time_constant_s
    measured = np.mean([coarse(zeroed(run, i), run.rate_hz) for i in chosen], axis=0)
    expected = first_order(grid.theta, slow)
    # A tiltmeter is at rest only some time constants after the wall: its own last value is no zero.
    columns = {
        "zero": (np.ones_like(expected), "rad"),
        "gain": (expected, "1"),
        "lag": (-np.gradient(expected, 1 / GRID_HZ), "s"),
        "drift": (grid.time_s, "rad/s"),
        "start": (np.exp(-(grid.time_s - grid.time_s[0]) / max(slow, 0.05)), "rad"),
    }
    wide = pick | (grid.time_s <= 0)
    return regress("tiltmeter", measured - expected, columns, wide, absorbed=("zero", "start"))


def _acceleration_block(run: GapRun, grid: Grid, pick: NDArray[np.bool_]) -> Block | None:
    chosen = run.steady_accelerometers("x")
    if not chosen:
        return None
    # Means over 5 ms and no filter: one that rings carries an impact past the samples left out around it.
    measured = coarse(np.mean([zeroed(run, i) for i in chosen], axis=0), run.rate_hz)
    height = float(np.mean([run.sensors[i].position_m[2] for i in chosen]))
    x = float(np.mean([run.sensors[i].position_m[0] for i in chosen]))
    arm = x - np.sign(grid.theta) * run.survey.half_base_m
    gravity, inertia = -GRAVITY_M_S2 * np.sin(grid.theta), height * grid.alpha
    expected = gravity + inertia - grid.omega**2 * arm
    columns = {
        "zero": (np.ones_like(expected), "m/s²"),
        "gain of gravity": (gravity, "1"),
        "gain of inertia": (inertia, "1"),
    }
    # The held wall sways: only the mean of that part, less the sway's, says what gravity alone shows.
    held = pick & (grid.time_s < 0.0)
    if held.any():
        swaying = height * float(_sway(grid)[held].mean())
        measured[held], gravity[held] = measured[held].mean() - swaying, gravity[held].mean()
        expected = gravity + inertia - grid.omega**2 * arm
        columns["gain of gravity"], columns["gain of inertia"] = (gravity, "1"), (inertia, "1")
    # No lag here: between impacts the specific force hardly changes. The impacts themselves tell it.
    return regress("accelerometer", measured - expected, columns, pick, ("zero",))


def _sway(grid: Grid) -> FloatArray:
    """θ̈ of the held wall on the grid, (m,), rad/s²; 0 after the release.

    Its mean is the change of speed over the hold: 1 % of gravity for a few mrad/s, and well measured.
    """
    found = np.zeros_like(grid.raw)
    before = grid.time_s < 0.0
    low_pass = butter(3, SWAY_HZ, fs=GRID_HZ, output="sos")
    theta = sosfiltfilt(low_pass, grid.raw[before] - grid.raw[before].mean())
    found[before] = np.gradient(np.gradient(theta, 1 / GRID_HZ), 1 / GRID_HZ)
    return found


def _lift_block(run: GapRun, joint: Rotation, grid: Grid, pick: NDArray[np.bool_]) -> Block | None:
    size = np.abs(grid.theta)
    expected = run.survey.half_base_m * np.sin(size)
    columns = {
        "zero": (np.ones_like(size), "m"),
        "pivot": (size, "m"),
        "pivot left against right": (grid.theta, "m"),
        "pivot with rotation": (size**2, "m/rad"),
        "contact length": (np.sqrt(size), "m"),
        "drift": (grid.time_s, "m/s"),
    }
    return regress(
        "joint", coarse(joint.lift, run.rate_hz) - expected, columns, pick & ~grid.near_impact, ("zero",)
    )


def _twist_block(run: GapRun, joint: Rotation, grid: Grid, pick: NDArray[np.bool_]) -> Block | None:
    columns = {
        "zero": (np.ones_like(grid.theta), "rad/m"),
        "follows rotation": (grid.theta, "1/m"),
        "drift": (grid.time_s, "rad/m/s"),
    }
    return regress("twist", coarse(joint.twist, run.rate_hz), columns, pick, ("zero", "drift"))


def slip_shape(grid: Grid) -> FloatArray:
    """Sum of the signed approach speeds of the impacts so far, less its last value (the zero is at rest).

    The mean over each interval of the grid: in that of an impact only a part of it is after the slip.
    """
    after = (grid.time_s[:, None] - grid.impact_s[None, :]) * GRID_HZ + 0.5
    shape: FloatArray = np.clip(after, 0.0, 1.0) @ grid.approach - float(np.sum(grid.approach))
    return shape


def _translation_block(run: GapRun, grid: Grid, swings: Swings, pick: NDArray[np.bool_]) -> Block | None:
    """Movement of the base along x, from wires at several heights."""
    _, heights, names = wall_rotation(run)
    if len(set(np.round(heights, 2))) < 2 or len(names) < len(run.indices("wire")):
        return None  # what the base seems to do hangs on the calibration of each wire
    chosen = [i for i in run.indices("wire") if run.sensors[i].id in names]
    shift = []
    for i in chosen:
        sensor = run.sensors[i]
        assert sensor.anchor_m is not None
        ideal = wire_reading(grid.theta, sensor.position_m, sensor.anchor_m, run.survey.half_base_m)
        shift.append(coarse(zeroed(run, i), run.rate_hz) - ideal)
    design = np.column_stack([np.ones_like(heights), heights])
    moved = (np.linalg.pinv(design) @ np.array(shift))[0]
    columns = {
        "zero": (np.ones_like(grid.theta), "m"),
        "slip per speed": (slip_shape(grid), "m s/rad"),
        "follows rotation": (grid.theta, "m/rad"),
        "drift": (grid.time_s, "m/s"),
    }
    return regress("base", moved, columns, pick, ("zero", "drift"))
