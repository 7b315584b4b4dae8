"""Contract of a sensor family: what it observes, how that is predicted, how it repeats, its priors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import Parameter
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, Rotation
from daq_app.gap.rocking_model.motion.swings import Swings
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun, Survey
from daq_app.gap.rocking_model.tolerances.motion import (
    AROUND_TEST_S,
    HELD_STILL,
    HELD_UNTIL_S,
    SHORTEST_HOLD_S,
)
from daq_app.gap.rocking_model.tolerances.walls import SWAY_SHARE

Predict = Callable[[RockingRun, Block, Mapping[str, float]], FloatArray]
"""Predicted coefficients, (k,), of a block of a run at the values of a hypothesis."""
CROSSTALK_SHARE = "crosstalk"
"""Parameter of the share of the channel scanned before, which the families' blocks carry as `systematic`."""


@dataclass(frozen=True, slots=True)
class Size:
    """How well one coefficient repeats from run to run, and what a sound sensor may be off by in all runs.

    Both in the coefficient's own unit. The model's scatter of sensors multiplies `scatter`; `bias` is the
    standard deviation of a parameter that all runs share, 0 where a calibration among the priors says it.
    """

    scatter: float
    bias: float = 0.0
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Scene:
    """One run with its reference motion: what a sensor family is observed against."""

    run: GapRun
    joint: Rotation
    grid: Grid
    swings: Swings
    reference: str
    """``lvdt`` or ``wire``: the family whose rotation is the grid's."""
    calm: NDArray[np.bool_]
    """Samples of the grid at which nothing rings, (m,)."""
    late: bool = False
    """Whether the LVDTs are sound but for their time."""

    @property
    def rocking(self) -> NDArray[np.bool_]:
        """Samples from just before the release until just after the wall comes to rest, (m,)."""
        time_s = self.grid.time_s
        return (time_s > -AROUND_TEST_S) & (time_s < self.grid.rest_s + AROUND_TEST_S)

    @property
    def in_range(self) -> NDArray[np.bool_]:
        """Those at which every LVDT is within its range, (m,)."""
        return self.rocking & self.grid.valid

    @property
    def held(self) -> NDArray[np.bool_]:
        """Samples at which the wall is held and nothing rings, (m,).

        A held wall that sways accelerates more than its gravity differs from the model's: it is not used.
        """
        grid = self.grid
        before = grid.time_s < -HELD_UNTIL_S
        middle = float(np.median(grid.raw[before])) if before.any() else 0.0
        held = self.calm & (np.abs(grid.raw - middle) < HELD_STILL * abs(middle))
        mean_error = 3.0 * self.swings.held.sway_speed_sd / max(float(held.sum()) / GRID_HZ, SHORTEST_HOLD_S)
        return held & (mean_error < SWAY_SHARE * GRAVITY_M_S2 * abs(middle))


def with_crosstalk(block: Block | None, added: FloatArray) -> Block | None:
    """The block with what a full crosstalk of its channels, (m,) in the series' unit, does to it."""
    return block and with_systematic(block, CROSSTALK_SHARE, added)


def with_systematic(block: Block, parameter: str, added: FloatArray) -> Block:
    """The block with what a parameter of one adds to its series, (m,) in the series' unit."""
    return replace(block, systematic={**block.systematic, parameter: block.coefficients(added)})


@dataclass(frozen=True, slots=True)
class SensorFamily:
    """One sensor family in the diagnosis.

    `observe`: blocks of a run. `predict`: by the block's rule (`Block.rule`). `sizes`: by (block,
    coefficient). `priors`: parameters of the sensors that all runs share.
    """

    observe: Callable[[Scene], Iterable[Block | None]]
    predict: Mapping[str, Predict]
    sizes: Mapping[tuple[str, str], Size] = field(default_factory=dict)
    priors: Callable[[Survey], tuple[Parameter, ...]] = lambda survey: ()
