"""A block: coefficients of one family in one run, with the regression that made them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.noise import coefficient_covariance
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import Wire, pseudo_inverse


@dataclass(frozen=True, slots=True)
class Shares:
    """What a signal put together from several channels shows of each way in which they can move.

    Signals of bending or turning show more than one where the sensors that are left do not stand evenly on
    both sides of the middle.
    """

    rotation: float = 0.0
    """Per error of the family's rotation, m (per angular acceleration in m/s²)."""
    bend: float = 0.0
    """Per bending at the top of the wall; 1/m in signals of turning."""
    yaw: float = 0.0
    """Per angle about the vertical, m; 1 or none in signals of turning."""
    twist: float = 0.0
    """Per slope of the rotation along the length, m²; m in signals of turning."""


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
    """A single channel as the others predict it, on the whole grid."""
    finer: tuple[FloatArray, float] | None = None
    """The same at a higher rate, Hz, for what the grid is too coarse for: the corners at impacts."""
    design: FloatArray | None = None
    """Shapes of a single channel's regression at the samples of `pick`."""
    noise: float = 1.0
    """Rms of a single channel at rest."""
    wire: Wire | None = None
    """Geometry of a single wire, whose faults act on its length."""
    ring: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Frequency of a ring-down in Hz, its damping ratio, rate of the grid in Hz."""
    levers: tuple[float, ...] = ()
    """Relative error of a single channel's prediction, by coefficient."""
    shares: tuple[Shares, ...] = ()
    """What the signal behind each coefficient of a ring-down shows."""
    fading: tuple[float, ...] = ()
    """d(coefficient)/d(ln ζ) of a ring-down for unit amplitude, by coefficient."""
    time_constants_s: tuple[float, ...] = ()
    """Time constants, s, of the slow sensors behind the block, as this run shows them."""
    undone_s: float = 0.0
    """Delay of accelerometers (of a ring-down) or LVDTs (of the joint) that was undone before."""
    systematic: Mapping[str, FloatArray] = field(default_factory=dict)
    """What parameters that all runs share add to the coefficients at a value of one, (k,) each."""
    sensor_family: str = ""
    """Family of a single channel."""
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
        """Coefficients, (k,), that the regression makes of a difference on the whole grid, (m,)."""
        return self.projection @ series[self.pick]


def regress(
    family: str,
    difference: FloatArray,
    columns: dict[str, tuple[FloatArray, str]],
    pick: NDArray[np.bool_],
    absorbed: tuple[str, ...] = (),
) -> Block | None:
    """Least squares of a difference, (m,), on named shapes, (m,) with their units; None with too few samples.

    The shapes `absorbed` are fitted but say nothing about the wall or the sensor, and are dropped.
    """
    if pick.sum() < 20 * len(columns):
        return None
    design = np.column_stack([column[pick] for column, _ in columns.values()])
    projection = pseudo_inverse(design)
    values = projection @ difference[pick]
    residual = difference[pick] - design @ values
    covariance = coefficient_covariance(residual, projection, pick, len(columns))
    kept = [k for k, name in enumerate(columns) if name not in absorbed]
    names = tuple(name for name in columns if name not in absorbed)
    units = tuple(unit for name, (_, unit) in columns.items() if name not in absorbed)
    return Block(family, names, units, values[kept], covariance[np.ix_(kept, kept)], projection[kept], pick)


def scalar_block(family: str, entries: Sequence[tuple[str, str, float, float]], grid: Grid) -> Block:
    """A block of plain numbers: (name, unit, value, variance) each."""
    return Block(
        family,
        tuple(e[0] for e in entries),
        tuple(e[1] for e in entries),
        np.array([e[2] for e in entries]),
        np.diag([e[3] for e in entries]),
        np.zeros((len(entries), grid.valid.size)),
        np.ones(grid.valid.size, dtype=bool),
    )
