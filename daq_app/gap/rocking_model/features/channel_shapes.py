"""One channel beside its prediction: in what it differs (gain, lag, curvature, drift), as features.

The same for every family, whoever predicts it: what is left over is regressed on a few shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray, robust_sd
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.noise import coefficient_covariance
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, Wire
from daq_app.gap.rocking_model.tolerances.inspection import REMAINS_SD, SOUND, SOUND_WIRE
from daq_app.gap.rocking_model.tolerances.sensors import CALIBRATION, CERTIFIED

_SHAPES = ("gain", "lag", "curvature", "drift")
_GAIN, _LAG, _CURVATURE = (_SHAPES.index(name) for name in ("gain", "lag", "curvature"))
SHAPES: dict[Family, tuple[str, ...]] = {
    "lvdt": (*_SHAPES, "rounding"),
    "wire": (*_SHAPES, "side"),
    "accelerometer": _SHAPES,
}
"""Wires have half the difference in gain between the two sides as well: the wall lifts on one side only, and
a wire whose anchor is not as high as the rig file says slopes and sees it. A joint opens at one face at a
time: LVDTs have no other side. Where they close or open at an impact their readings have a corner, which
every response rounds by the variance of its delays over two: a delay by none, a first order by most."""
FURTHER = {family: shapes[len(_SHAPES) :] for family, shapes in SHAPES.items()}
"""Those shapes of a family that not all families have."""
_UNITS: dict[Family, tuple[str, ...]] = {
    "lvdt": ("1", "s", "1/m", "m/s", "s²"),
    "wire": ("1", "s", "1/m", "m/s", "1"),
    "accelerometer": ("1", "s", "s²/m", "m/s³"),
}
TOLERANCE: dict[Family, tuple[float, ...]] = {
    "lvdt": (3.2e-3, 1e-4, 0.06, 4e-6, 1e-6),
    "wire": (3.2e-3, 1e-4, 0.005, 6e-6, 5e-4),
    "accelerometer": (3.2e-3, 2e-3, 2e-3, 1.5e-3),
}
"""What healthy channels differ by: calibration, and how well the others predict them. Accelerometers also
by the place's own ringing, which a hop of the wall carries beyond the mask. An LVDT's lag is as good as what
its family may be late by: a twelfth of it is in the time across every impact, to one side up and to the other
down, and those times repeat to some hundredths of a millisecond. A wire is straight to 0.1 % of its travel of
± 0.45 m; its side is an anchor known to 5 mm. An LVDT rounds as sensors do that respond within a
millisecond."""
_OF_ANCHORS = ("curvature", "side")
RINGING: tuple[Family, ...] = ("accelerometer",)
"""Families whose channels differ in how they ring: what remains of one says nothing."""


@dataclass(frozen=True, slots=True)
class Others:
    """A channel beside what the others of its family make of it, on the grid; both (m,), SI."""

    measured: FloatArray
    expected: FloatArray
    pick: NDArray[np.bool_]
    spread: float
    """How many times one channel's calibration error the relative error of the prediction is."""
    curved: float = 1.0
    """How many times one channel's curvature that of the prediction is: an error that goes with the square of
    a large reading is predicted into a small one."""
    slower: float = 1.0
    """How many times less this wire travels than most: friction in its drum holds back a length, for as many
    times longer."""
    rough: float = 0.0
    """Rms of what the steps of these readings make of the difference; 0 where they have none."""
    repeats: int = 1
    """Half-cycles, in each of which the same steps come back."""
    further: tuple[str, ...] = ()
    """Shapes of its family beyond those of all."""
    weights: FloatArray | None = None
    """Weights, (c,), with which the channels of the family make up the prediction."""
    imperfections: FloatArray | None = None
    """What one sd of each ordinary imperfection adds to what this channel shows beyond the others, (k, m),
    SI: crosstalk from the channels that are scanned before, mounts that are turned."""

    def tolerance(self, family: Family) -> FloatArray:
        """What a sound channel differs by from the prediction in each shape, (k,)."""
        sizes = self.spread * np.array(TOLERANCE[family])
        sizes[_LAG] *= self.slower
        return np.asarray(sizes)


@dataclass(frozen=True, slots=True)
class Deviation:
    """Coefficients of one channel in one run (`SHAPES`), with covariance, and what remains over noise."""

    values: FloatArray
    covariance: FloatArray
    projection: FloatArray
    design: FloatArray
    """Orthonormal basis of the shapes at the samples used."""
    remains: float
    """ln of the rms that the shapes leave, over the rms at rest."""
    noise: float


def shape_columns(beside: Others) -> FloatArray:
    """The shapes in which a channel may differ at the samples used, (n, k + 1); the last is its zero."""
    e = beside.expected
    rate = np.gradient(e, 1.0 / GRID_HZ)
    used = e[beside.pick]
    # Sound LVDTs are bent, and they alone have a rounding. The gain of one is the mean slope over the
    # readings used, which a bend leaves as it is.
    slope = float(used**2 @ used) / max(float(used @ used), 1e-300) if "rounding" in beside.further else 0.0
    return np.column_stack(
        [
            e,
            -rate,
            e**2 - slope * e,
            np.arange(e.size) / GRID_HZ,
            *(np.abs(e) if name == "side" else np.gradient(rate, 1.0 / GRID_HZ) for name in beside.further),
            np.ones_like(e),
        ]
    )[beside.pick]


def deviation(beside: Others) -> Deviation:
    """Regress what a channel shows beyond the others' prediction on the shapes."""
    e, columns = beside.expected, shape_columns(beside)
    scale = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    basis, triangle = np.linalg.qr(columns / scale)
    inverse = np.linalg.pinv(triangle, rcond=1e-9) @ basis.T / scale[:, None]
    difference = (beside.measured - e)[beside.pick]
    left = difference - columns @ (inverse @ difference)
    left = left - _leaked(left, basis, beside)
    left_over = float(left @ left) / max(left.size - columns.shape[1], 1)
    rest = (beside.measured - e)[-round(0.4 * GRID_HZ) :]
    noise = float(np.std(rest - np.linspace(rest[:8].mean(), rest[-8:].mean(), rest.size))) + 1e-12
    # At rest a reading in steps shows none of them, and in motion the same ones in every half-cycle.
    noise = float(np.hypot(noise, beside.rough))
    kept = slice(0, columns.shape[1] - 1)
    covariance = coefficient_covariance(left, inverse[kept], beside.pick, columns.shape[1])
    if beside.rough > 0.0:
        covariance = covariance * max(beside.repeats, 1)
    if beside.imperfections is not None:
        shared = inverse[kept] @ beside.imperfections[:, beside.pick].T
        covariance = covariance + shared @ shared.T
    return Deviation(
        (inverse @ difference)[kept],
        covariance,
        inverse[kept],
        basis,
        0.5 * float(np.log(left_over / noise**2)),
        noise,
    )


def _leaked(left: FloatArray, basis: FloatArray, beside: Others) -> FloatArray:
    """What ordinary imperfections explain of what the shapes leave, both (n,): their posterior mean."""
    if beside.imperfections is None:
        return np.zeros_like(left)
    imperfections = beside.imperfections[:, beside.pick].T
    imperfections = imperfections - basis @ (basis.T @ imperfections)
    noise = float(left @ left) / left.size
    sizes = np.linalg.solve(
        imperfections.T @ imperfections + noise * np.eye(imperfections.shape[1]), imperfections.T @ left
    )
    return np.asarray(imperfections @ sizes)


def usual_remains(of_channels: Sequence[float]) -> float:
    """What remains (`Deviation`) of a sound channel: the middle of all, and no less than its noise.

    Readings that go in steps from the same zero step together, and nearly nothing remains of them. One whose
    calibration is another steps at other places; what its own steps make is noise that it is allowed.
    """
    return max(float(np.median(of_channels)), 0.0)


def usual_deviation(family: Family, of_channels: Sequence[tuple[Others, Deviation]]) -> FloatArray:
    """Sd of what one channel is off by in each shape, (k,), as its family's channels and a table say it.

    Certificate and table count as `CERTIFIED` channels: where many agree it is they that say how well. Other
    shapes than gains are no better known than the table says.
    """
    shares = [SOUND_WIRE if family == "wire" and name in _OF_ANCHORS else SOUND for name in SHAPES[family]]
    stated = np.array(shares) * np.array(TOLERANCE[family])
    stated[_GAIN] = CALIBRATION
    if not of_channels:
        return np.asarray(stated, dtype=np.float64)
    table = np.array(TOLERANCE[family])
    off = np.array([m.values / b.tolerance(family) * table for b, m in of_channels])
    seen = [robust_sd(shape) for shape in off.T]
    weights = np.array([CERTIFIED, len(of_channels)]) / (CERTIFIED + len(of_channels))
    usual = np.sqrt(weights @ np.square([stated, seen]))
    # The others say of gains alone that one is better than stated: each anchor is measured by tape anew.
    return np.asarray(np.where(np.arange(usual.size) == _GAIN, usual, np.maximum(usual, stated)))


def block_of(
    name: str,
    family: Family,
    beside: Others,
    sound: Sequence[tuple[Others, Deviation]],
    wire: Wire | None = None,
    finer: tuple[FloatArray, float] | None = None,
) -> Block:
    """Block of the coefficients of a channel; `sound` are the others of its family, each beside the others.

    Without any, the certificate says what a sound one is off by, and what remains is as it should be.
    `finer` is its prediction at a higher rate, Hz.
    """
    misfit = deviation(beside)
    usual = usual_remains([other.remains for _, other in sound] or [misfit.remains])
    k = len(SHAPES[family])
    covariance = np.zeros((k + 1, k + 1))
    covariance[:k, :k] = misfit.covariance
    covariance[k, k] = REMAINS_SD**2
    remains = 0.0 if family in RINGING else max(misfit.remains - usual, 0.0)
    return Block(
        name,
        (*SHAPES[family], "what remains"),
        (*_UNITS[family], "1"),
        np.append(misfit.values, remains),
        covariance,
        misfit.projection,
        beside.pick,
        kind="channel",
        expected=beside.expected,
        finer=finer,
        design=misfit.design,
        noise=misfit.noise * float(np.exp(usual)),
        wire=wire,
        sensor_family=family,
        levers=_levers(beside, usual_deviation(family, sound), misfit),
    )


def _levers(beside: Others, usual: FloatArray, misfit: Deviation) -> tuple[float, ...]:
    """What a sound channel is off by from the others' prediction (sd); `usual`, (k,): from the truth.

    No fault of the library bends one LVDT: one is bent by what it shows.
    """
    levers = beside.spread * usual
    levers[_LAG] *= beside.slower
    levers[_CURVATURE] *= max(beside.curved / beside.spread, 1.0)
    if "rounding" in beside.further:
        levers[_CURVATURE] = max(levers[_CURVATURE], abs(float(misfit.values[_CURVATURE])))
    return tuple(levers.tolist())
