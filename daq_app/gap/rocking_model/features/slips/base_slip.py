"""A base that friction does not hold: what wires show of it between impacts, over all runs.

The wires tell how far the base moves along x, and turns about the vertical, from just after an impact to just
before the next one. The rotation is as small there as here, so that no calibration matters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daq_app.gap.core.features import FloatArray, robust_sd
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.features.slips.friction import push, slips_below
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import Wire, gridded, wall_rotation
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.walls import SLIP_EXPLAINED, SLIP_SURE_SD, TURNS_ABOUT_M

_GUARD_S: Final = 0.008
"""Beside an impact: its shock and step."""
_WINDOW_S: Final = 0.03
_SHORTEST_S: Final = 0.1
"""Half-cycles with room for both windows."""
_BELOW: Final = np.geomspace(0.01, 0.4, 16)
"""Rotations below which a base may slip, over α."""
_FEWEST: Final = 12
"""Half-cycles of all runs that tell a law."""
_FEWEST_WIRES: Final = 4


@dataclass(frozen=True, slots=True)
class BaseSlip:
    """A base that slips outwards below a rotation, and turns about the vertical with that.

    Each pair is of a wall on its edge at x < 0, and on that at x > 0.
    """

    below_rad: float
    friction: float
    """Coefficient of friction that holds it beyond, 1."""
    along: FloatArray
    """(2,) acceleration outwards for each rad below it, m/s²."""
    turning: FloatArray
    """(2,) the same of the turn, rad/s², in the direction in which the end at y > 0 moves outwards."""
    slip_m: float
    """Largest slip between two impacts, of all runs."""
    slip_sd_m: float
    turn_rad: float
    """Largest turn between two impacts."""
    turn_sd_rad: float

    @property
    def turns(self) -> bool:
        """Whether one end of the wall slips further than the other."""
        return float(np.abs(self.turning).max()) * TURNS_ABOUT_M > float(np.abs(self.along).max())


@dataclass(frozen=True, slots=True)
class _Seen:
    """What half-cycles show, (k,) each."""

    side: FloatArray
    """Of the edge that the wall is on, ±1."""
    peak_rad: FloatArray
    speed: FloatArray
    along_m: FloatArray
    turn_rad: FloatArray


def find_slip(runs: Sequence[GapRun], grids: Sequence[Grid]) -> BaseSlip | None:
    """The slip of the base of all runs; None where its wires show none, or are too few to tell."""
    parts = [part for run, grid in zip(runs, grids, strict=True) if (part := _seen(run, grid)) is not None]
    if sum(part.speed.size for part in parts) < _FEWEST:
        return None
    names = ("side", "peak_rad", "speed", "along_m", "turn_rad")
    seen = _Seen(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
    survey = runs[0].survey
    best: tuple[float, float, _Fitted, _Fitted] | None = None
    gain = 0.0
    for below in _BELOW * survey.alpha_rad:
        law = slips_below(float(below), seen.peak_rad, survey).slip
        along, turn = (_fitted(law, seen, series) for series in (seen.along_m, seen.turn_rad))
        gained = along.sure**2 + turn.sure**2
        if gained > gain and (along.stands_out or turn.stands_out):
            best, gain = (float(below), float(law.max()), along, turn), gained
    if best is None:
        return None
    below, largest, along, turn = best
    sizes = (largest * size for fit in (along, turn) for size in fit.largest)
    return BaseSlip(below, push(below, survey), along.sizes, turn.sizes, *sizes)


def slip_findings(slip: BaseSlip | None, runs: int) -> list[RunFinding]:
    """What one of the runs says of the slip: how far the base slips, or turns about one of its ends."""
    if slip is None:
        return []
    # It is found from all runs at once: what is said in every run is known only once.
    more, words = math.sqrt(runs), f"friction of {slip.friction:.2f}"
    if slip.turns:
        return [RunFinding("corner_twist@base", words, "rad", slip.turn_rad, more * slip.turn_sd_rad)]
    return [RunFinding("sliding@base", words, "m", slip.slip_m, more * slip.slip_sd_m)]


def _seen(run: GapRun, grid: Grid) -> _Seen | None:
    _, chosen = wall_rotation(run)
    _, y, z = run.positions(chosen).T
    design = np.column_stack([np.ones_like(y), z, y])
    if len(chosen) < _FEWEST_WIRES or np.linalg.matrix_rank(design) < design.shape[1]:
        return None
    ideal = np.array([Wire(run.sensors[i], run.survey.half_base_m).shortening(grid.theta) for i in chosen])
    moved = np.linalg.pinv(design) @ (np.array([gridded(run, i) for i in chosen]) - ideal)
    rows = []
    for start_s, end_s, approach in zip(
        grid.impact_s[:-1], grid.impact_s[1:], grid.approach[:-1], strict=True
    ):
        if end_s - start_s < _SHORTEST_S:
            break
        window_s = min(_WINDOW_S, 0.2 * (end_s - start_s))
        after, before = grid.time_s - start_s - _GUARD_S, end_s - _GUARD_S - grid.time_s
        first, last = ((side > 0.0) & (side < window_s) for side in (after, before))
        inside = grid.theta[(after > 0.0) & (before > 0.0)]
        if not (first.any() and last.any() and grid.valid[first | last].all()):
            continue
        # The wall has crossed to the side that its speed points to.
        outwards = np.sign(approach)
        along, _, turn = outwards * (moved[:, last].mean(axis=1) - moved[:, first].mean(axis=1))
        rows.append((outwards, np.abs(inside).max(), abs(approach), along, turn))
    return _Seen(*np.array(rows).T) if rows else None


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Accelerations by which a series follows the law, (2,): at x < 0 and at x > 0."""

    sizes: FloatArray
    sd: FloatArray
    explained: float
    """Share of what half-cycles differ by."""

    @property
    def sure(self) -> float:
        """Standard errors from none, of the side that is surer."""
        return float(np.abs(self.sizes / self.sd).max())

    @property
    def stands_out(self) -> bool:
        return self.sure > SLIP_SURE_SD and self.explained > SLIP_EXPLAINED

    @property
    def largest(self) -> tuple[float, float]:
        """The larger acceleration, without sign, and its standard error."""
        place = int(np.argmax(np.abs(self.sizes)))
        return abs(float(self.sizes[place])), float(self.sd[place])


def _fitted(law: FloatArray, seen: _Seen, series: FloatArray) -> _Fitted:
    """`series` (k,) by the law, beside a delay of wires, which grows with the speed, and play."""
    others = np.column_stack([np.ones_like(seen.speed), seen.speed])
    design = np.column_stack([law * (seen.side < 0.0), law * (seen.side > 0.0), others])
    left = series - design @ np.linalg.lstsq(design, series, rcond=None)[0]
    without = series - others @ np.linalg.lstsq(others, series, rcond=None)[0]
    noise = max(robust_sd(left), 1e-9)
    inverse = np.linalg.pinv(design.T @ design)
    sd = noise * np.sqrt(np.maximum(np.diag(inverse)[:2], 1e-30))
    explained = 1.0 - float(left @ left) / max(float(without @ without), 1e-30)
    return _Fitted((inverse @ design.T @ series)[:2], sd, explained)
