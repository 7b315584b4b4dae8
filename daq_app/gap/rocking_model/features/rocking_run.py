"""A run as the core sees it: features with labels, and what their prediction needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import FeatureSet, Label
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.oscillations.vibration import FloorSpectrum, Vibration
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import Wire
from daq_app.gap.rocking_model.motion.swings import Swings
from daq_app.gap.rocking_model.records import Survey, Wiring
from daq_app.gap.rocking_model.run_cache import RunCache
from daq_app.rocking.families.base.slip import BaseSlip

_SMALLEST_LOADING = 1e-3


@dataclass(frozen=True, slots=True)
class RockingRun:
    """A run as the core sees it, with what the rocking model needs to predict its features."""

    name: str
    level: str
    features: FeatureSet
    survey: Survey
    swings: Swings
    places: NDArray[np.intp]
    """(T, 4): each time feature is crossing `b` of half-cycle `kb` minus crossing `a` of half-cycle `ka`,
    as (ka, a, kb, b); crossings below F are of the fall, the others of the rise."""
    across: NDArray[np.intp]
    """Time features that span an impact."""
    peaks: NDArray[np.intp]
    """Half-cycles whose peak is a feature (all but the first)."""
    blocks: tuple[Block, ...]
    grid: Grid
    reference: str
    """``lvdt`` or ``wire``: the family whose rotation the dynamics features come from."""
    impacts_before: float
    wire_height_m: float
    """Height at which a displacement of all wires looks like one rotation."""
    wire_bend_m: float
    """Height at which an error with the square of a wire's reading looks like one of the rotation."""
    base_bend_m2: float
    """What such an error of all wires makes of the base, over the square of the rotation."""
    base_lever: float
    """What the base seems to move by, m per rad, for wires whose calibrations are each off by one."""
    fixed_loadings: FloatArray
    """(n, k): measurement covariance of the blocks as loadings, and what else is known to move features."""
    notes: tuple[str, ...] = ()
    vibration: Vibration | None = None
    floor: FloorSpectrum | None = None
    """How the floor vibrates irregularly in all runs; None for one that does not."""
    floor_loadings: FloatArray | None = None
    """(T + P, k): what that moves times and peaks by, for draws of unit variance; none for a still floor."""
    slip: BaseSlip | None = None
    """How the base slips between impacts in all runs; None for one that does not."""
    wires: tuple[Wire, ...] = ()
    """All wires whose geometry is known."""
    leaked: FloatArray = field(default_factory=lambda: np.zeros(0))
    """What a full crosstalk adds to a reference rotation that is read from wires, (m,), rad; else empty."""
    lvdt_range_m: tuple[float, float] = (math.nan, math.nan)
    """Least and largest reading of the LVDTs; NaN where it is not known."""
    lvdt_curves: float = math.nan
    """Sd by which one LVDT is not straight, over half of that range; NaN where they count as straight."""
    wiring: Wiring = field(default_factory=Wiring)
    """What was put right in all runs before anything was read from them."""
    findings: tuple[RunFinding, ...] = ()
    """What the run shows of conditions of the electronics."""
    cache: RunCache = field(default_factory=RunCache, compare=False)

    def with_blocks(self, more: Sequence[Block]) -> RockingRun:
        """The run with further blocks of features after those it has."""
        blocks = (*self.blocks, *more)
        old = self.features
        rows = list(zip(old.values, old.sd, old.labels, strict=True))
        size = float(abs(self.swings.peak_rad[0]))
        for block in more:
            share = 1.0 if block.independent else _SMALLEST_LOADING
            for name, unit, value, variance in zip(
                block.names, block.units, block.values, np.diag(block.covariance), strict=True
            ):
                channel, observable = block.said.get(name, (block.family, name))
                label = Label(channel, "run", observable, unit, size, 0.5)
                rows.append((value, share * np.sqrt(variance) + 1e-15, label))
        first = len(self.places) + self.peaks.size
        loadings = _block_loadings(blocks, first, len(rows))
        return replace(
            self, features=FeatureSet.of(rows), blocks=blocks, fixed_loadings=loadings, cache=RunCache()
        )

    def of_blocks(self, blocks: Sequence[Block]) -> RockingRun:
        """The run with these blocks of features in place of those it has."""
        first, old = len(self.places) + self.peaks.size, self.features
        of_swings = FeatureSet(old.values[:first], old.sd[:first], old.labels[:first])
        return replace(self, features=of_swings, blocks=()).with_blocks(blocks)

    def without_block(self, family: str) -> RockingRun:
        """The run without the features of one block, if it has it."""
        return self.of_blocks([block for block in self.blocks if block.family != family])

    def with_loadings(self, columns: FloatArray) -> RockingRun:
        """The run whose features move by `columns` (n, k) times draws of unit variance as well."""
        return replace(self, fixed_loadings=np.hstack([self.fixed_loadings, columns]), cache=RunCache())


def _block_loadings(blocks: tuple[Block, ...], first: int, n: int) -> FloatArray:
    columns = []
    row = first
    for block in blocks:
        k = len(block.names)
        if block.independent:
            row += k
            continue
        matrix = np.zeros((n, k))
        sd = np.sqrt(np.diag(block.covariance)) + 1e-30
        correlation = block.covariance / np.outer(sd, sd)
        matrix[row : row + k] = sd[:, None] * np.linalg.cholesky(correlation + 1e-9 * np.eye(k))
        columns.append(matrix)
        row += k
    return np.hstack(columns) if columns else np.zeros((n, 0))
