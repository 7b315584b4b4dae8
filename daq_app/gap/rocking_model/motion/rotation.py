"""From channels to motion: the joint's rotation from the LVDTs, the wall's from the wires, and noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import CannotDiagnose
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.records import GapRun, Sensor, Vector3
from daq_app.gap.rocking_model.tolerances.sensors import FEWEST_LVDTS, LVDT_MISFIT
from daq_app.rocking.geometry.joint import BaseJoint, at_range_end
from daq_app.rocking.geometry.noise import moving_noise, timing_noise
from daq_app.rocking.geometry.wires import wire_rotation, wire_shortening
from daq_app.rocking.means import means_over

GRID_HZ = 200.0
FINER_HZ = 1000.0
"""Rate at which corners at impacts are told from what sensors make of them."""
"""Regressions run on averages over 5 ms."""
TAIL_S = 0.3
"""The wall stands at rest at the end of a record; this much of it is the zero of every channel."""
HOLD_S = 0.5
NOISE_S = 0.45


@dataclass(frozen=True, slots=True)
class Rotation:
    """Rotation of a family with its noise.

    `theta`: shape (n,), rad. `lift`: opening of the joint at the middle of the base, m. `twist`:
    change of rotation along the length, rad/m. `noise_rad`: rms of one sample. `used`: channels.
    """

    theta: FloatArray
    lift: FloatArray
    twist: FloatArray
    noise_rad: float
    used: tuple[str, ...]
    left_out: tuple[str, ...]
    valid: NDArray[np.bool_]
    """Samples at which no used channel is at the end of its range, shape (n,)."""

    @property
    def whole(self) -> bool:
        """Whether the rotation is known at every sample."""
        return bool(self.valid.all())

    def from_sample(self, start: int) -> Rotation:
        """The rotation without the samples before `start`."""
        series = {name: getattr(self, name)[start:] for name in ("theta", "lift", "twist", "valid")}
        return replace(self, **series)


def zeroed(run: GapRun, index: int) -> FloatArray:
    """A channel, (n,), less its mean at the end of the record."""
    values = run.aligned(index)
    tail = values[-max(int(TAIL_S * run.rate_hz), 1) :]
    return values - float(np.nanmean(tail))


def coarse(values: FloatArray, rate_hz: float) -> FloatArray:
    """Averages over the grid's intervals; shape (…, n) → (…, m)."""
    return means_over(values, round(rate_hz / GRID_HZ))


def finer_step(rate_hz: float) -> int:
    """Samples in the coarsest part of an interval of the grid that lasts a millisecond at most."""
    step = round(rate_hz / GRID_HZ)
    return max(d for d in range(1, step + 1) if step % d == 0 and (d == 1 or rate_hz / d >= FINER_HZ))


def gridded(run: GapRun, index: int, early: int = 0) -> FloatArray:
    """A channel less its mean at the end of the record, taken `early` samples sooner, on the grid, (m,)."""
    if early:
        return coarse(sooner(zeroed(run, index), early), run.rate_hz)

    def make() -> FloatArray:
        values = coarse(zeroed(run, index), run.rate_hz)
        values.flags.writeable = False
        return values

    return run.cache.constant(("grid", index), make)


def sooner(values: FloatArray, samples: int) -> FloatArray:
    """A record (n,) as if it came `samples` sooner; its ends are held."""
    if not samples:
        return values
    return values[np.clip(np.arange(values.size) + samples, 0, values.size - 1)]


def sample_noise(values: FloatArray, rate_hz: float) -> float:
    """Rms noise of one of the samples (n,), as averages over the timing windows see it, from the rest."""
    return timing_noise(values[-int(NOISE_S * rate_hz) :], rate_hz)


def joint_rotation(run: GapRun) -> Rotation:
    """θ from the openings of the base joint.

    Channels that disagree with the plane through the others are left out; samples at which a channel reaches
    its declared range are marked. Raises `CannotDiagnose` where too few channels read.
    """
    chosen = np.array(run.indices("lvdt"), dtype=np.intp)
    sensors = [run.sensors[i] for i in chosen]
    joint = BaseJoint(
        tuple(sensor.id for sensor in sensors),
        np.array([sensor.position_m for sensor in sensors]).reshape(-1, 3),
        np.array([sensor.noise_si for sensor in sensors]),
        np.array([sensor.range_si for sensor in sensors]).reshape(-1, 2),
        run.survey.half_base_m,
    )
    shape = (chosen.size, run.channels.shape[1])
    openings = np.array([zeroed(run, i) for i in chosen]).reshape(shape)
    in_range = np.array([~_clipped(run.aligned(i), run.sensors[i].range_si) for i in chosen]).reshape(shape)
    used = np.isfinite(openings).all(axis=1)
    if used.any():
        tolerated = LVDT_MISFIT * float(np.sqrt(np.mean(openings[used] ** 2)))
        used[joint.find_outliers(openings, in_range & used[:, None], tolerated)] = False
    if used.sum() < FEWEST_LVDTS or min(joint.places_on_face(side, used) for side in (-1, 1)) < 2:
        raise CannotDiagnose(
            f"Run {run.name}: only {used.sum()} LVDTs are usable.",
            "Check their ranges and wiring; the rotation of the joint needs both faces.",
        )
    lift, sine, twist = joint.plane(openings[used], used)
    theta = np.arcsin(np.clip(sine, -0.9, 0.9))
    ids = np.array(joint.ids)
    return Rotation(
        theta,
        lift,
        twist,
        sample_noise(theta, run.rate_hz),
        tuple(ids[used].tolist()),
        tuple(ids[~used].tolist()),
        in_range[used].all(axis=0),
    )


def _clipped(values: FloatArray, limits: tuple[float, float]) -> NDArray[np.bool_]:
    """Samples at which a channel is at its declared range, with a little room on either side in time."""
    at_end = at_range_end(values, *limits)
    return np.asarray(np.convolve(at_end, np.ones(81), "same") > 0) if at_end.any() else at_end


def reaches_its_range(values: FloatArray, limits: tuple[float, float]) -> bool:
    """Whether a channel, (n,), is ever at the end of its declared range."""
    return bool(at_range_end(values, *limits).any())


def opening(theta: FloatArray, x_m: FloatArray | float, half_base_m: float) -> FloatArray:
    """Opening of the joint at `x_m` from its middle at a small rotation θ, rad, in their common shape, m."""
    return np.asarray(half_base_m * np.abs(theta) - x_m * theta)


def rotation_of_faces(
    openings: Sequence[FloatArray], x_m: Sequence[float], half_base_m: float, fewest: int
) -> FloatArray | None:
    """θ, (n,), rad, from the middle opening, (n,), of either face; None where a face has too few."""
    faces = [[row for row, x in zip(openings, x_m, strict=True) if side * x > 0] for side in (-1.0, 1.0)]
    if min(map(len, faces)) < fewest:
        return None
    first, second = (np.median(face, axis=0) for face in faces)
    return np.asarray((first - second) / (2.0 * half_base_m))


def straight_line(heights: FloatArray) -> FloatArray:
    """Weights, (2, k), of readings at these heights, (k,), m: value at the foot and slope of their line."""
    return np.linalg.pinv(np.column_stack([np.ones_like(heights), heights]))


def pseudo_inverse(design: FloatArray) -> FloatArray:
    """That of shapes of whatever sizes and units, (n, k): coefficients = (k, n) @ samples (n,)."""
    scale = np.sqrt(np.mean(design**2, axis=0)) + 1e-300
    return np.asarray(np.linalg.pinv(design / scale, rcond=1e-8) / scale[:, None])


@dataclass(frozen=True, slots=True)
class Wire:
    """One wire with its real geometry about the nominal edges."""

    sensor: Sensor
    half_base: float

    @property
    def anchor_m(self) -> Vector3:
        """Where the wire is anchored; only wires of the rig file that say so are made a `Wire`."""
        assert self.sensor.anchor_m is not None
        return self.sensor.anchor_m

    def rotation(self, shortening: FloatArray) -> FloatArray:
        """θ, rad, at which the wire is shorter by `shortening`, m; NaN where there is none."""
        return wire_rotation(shortening, self.sensor.position_m, self.anchor_m, self.half_base)

    def shortening(self, theta: FloatArray, anchor_higher: float = 0.0) -> FloatArray:
        """Shortening, m, at `theta`, rad, with the anchor higher by so much, m."""
        x, y, z = self.anchor_m
        return wire_shortening(theta, self.sensor.position_m, (x, y, z + anchor_higher), self.half_base)


def wires_of(run: GapRun) -> tuple[Wire, ...]:
    """All wires whose geometry is known."""
    chosen = (run.sensors[i] for i in run.indices("wire"))
    return tuple(Wire(s, run.survey.half_base_m) for s in chosen if s.anchor_m is not None)


def anchors_turn(wires: Sequence[Wire], theta: FloatArray, higher: float) -> FloatArray:
    """What anchors higher by so much, m, add to the wires' mean rotation (weights z²), rad."""
    return _turned(wires, theta, _shortened(wires, theta, higher=higher))


def anchors_move(wires: Sequence[Wire], theta: FloatArray, higher: float) -> FloatArray:
    """What anchors higher by so much, m, add to what the wires show of the base, m."""
    return _moved(wires, theta, _shortened(wires, theta, higher=higher))


_FURTHER_M = 1e-3


def pivots_off(wires: Sequence[Wire], theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(rad/m, m/m): what pivots further from the middle add to the wires' mean rotation and to the base.

    To first order: the wall moves along x by 1 − cos θ and rises by sin|θ| for each metre.
    """
    seen = _shortened(wires, theta, further=_FURTHER_M)
    return _turned(wires, theta, seen) / _FURTHER_M, _moved(wires, theta, seen) / _FURTHER_M


def _shortened(
    wires: Sequence[Wire], theta: FloatArray, *, higher: float = 0.0, further: float = 0.0
) -> FloatArray:
    """Shortening of each wire, (w, θ's size), m, with anchors higher and pivots further out by so much, m."""
    positions, anchors = _ends(wires)
    anchors[:, 2] += higher
    return wire_shortening(theta.ravel(), positions, anchors, wires[0].half_base + further)


def _ends(wires: Sequence[Wire]) -> tuple[FloatArray, FloatArray]:
    """Where the wires are fixed to the wall and anchored, (w, 3) each, m."""
    positions, anchors = ([w.sensor.position_m for w in wires], [w.anchor_m for w in wires])
    return np.array(positions, dtype=np.float64), np.array(anchors, dtype=np.float64)


def _turned(wires: Sequence[Wire], theta: FloatArray, shortened: FloatArray) -> FloatArray:
    """Mean rotation (weights z²), rad, that wires so much shorter show beyond `theta`, in its shape."""
    positions, anchors = _ends(wires)
    weights = positions[:, 2] ** 2
    beyond = wire_rotation(shortened, positions, anchors, wires[0].half_base) - theta.ravel()
    return np.asarray((weights / weights.sum() @ beyond).reshape(theta.shape))


def _moved(wires: Sequence[Wire], theta: FloatArray, shortened: FloatArray) -> FloatArray:
    """Motion of the base, m, that wires so much shorter show beyond `theta`, in its shape."""
    weights = straight_line(_ends(wires)[0][:, 2])[0]
    return np.asarray((weights @ (shortened - _shortened(wires, theta))).reshape(theta.shape))


def shown_by_wires(wires: Sequence[Wire], moved: FloatArray, *, of_base: bool) -> float:
    """What wires moved by so much, (w,), m, show of the base, m, or of the rotation (weights z²), rad."""
    z = np.array([wire.sensor.position_m[2] for wire in wires])
    return float(straight_line(z)[0] @ moved) if of_base else float(z @ moved / (z @ z))


def wall_rotation(run: GapRun) -> tuple[FloatArray, list[int]]:
    """θ of each wire (w, n), and the wires' places; clipped wires are left out.

    Each reading is turned into a rotation by the wire's real geometry about the nominal edges.
    """
    wires = run.indices("wire")
    rotations = [run.cache.constant(("wire", i), partial(_rotation_of_wire, run, i)) for i in wires]
    read = [(theta, i) for theta, i in zip(rotations, wires, strict=True) if theta is not None]
    return np.array([theta for theta, _ in read]), [i for _, i in read]


def mean_rotation(run: GapRun) -> FloatArray | None:
    """Mean of what the wires show of the wall's rotation (weights z²), (n,), rad; None where none reads."""
    rows, chosen = wall_rotation(run)
    return np.average(rows, axis=0, weights=run.positions(chosen)[:, 2] ** 2) if chosen else None


def noise_of_wires(run: GapRun, theta: FloatArray) -> float:
    """rms noise of one sample of the wires' mean rotation `theta`, (n,), rad: at rest, or while they move.

    The larger of the two: a potentiometer errs from winding to winding, which at rest is one and the same.
    """
    rows, chosen = wall_rotation(run)
    _, y, z = run.positions(chosen).T
    moving = np.abs(theta) > 0.05 * np.abs(theta).max()
    shown, rate = theta[moving], np.gradient(theta)[moving]
    shapes = np.array([np.ones_like(shown), shown, shown**2, np.abs(shown), rate, np.arange(shown.size)])
    # A wall that rotates, bends or turns moves all wires together.
    together = np.column_stack([z, z**2, y * z])
    travel = moving_noise(
        z[:, None] * rows[:, moving],
        together / np.abs(together).max(axis=0).clip(1e-9),
        shapes / np.abs(shapes).max(axis=1, keepdims=True),
        run.rate_hz,
    )
    return float(np.nanmax([sample_noise(theta, run.rate_hz), travel / math.sqrt(float(z @ z))]))


def wire_height(run: GapRun) -> float:
    """Height, m, at which a displacement of all wires looks like one rotation; 1 without any."""
    z = run.positions(run.indices("wire"))[:, 2]
    return float(np.sum(z**2) / np.sum(z)) if z.size else 1.0


def _rotation_of_wire(run: GapRun, index: int) -> FloatArray | None:
    """θ, (n,), of a wire that reads; None where no rotation explains what it reads."""
    sensor, raw = run.sensors[index], run.aligned(index)
    if sensor.anchor_m is None or not run.reads(index) or reaches_its_range(raw, sensor.range_si):
        return None
    theta = Wire(sensor, run.survey.half_base_m).rotation(zeroed(run, index))
    return theta if np.all(np.isfinite(theta)) else None
