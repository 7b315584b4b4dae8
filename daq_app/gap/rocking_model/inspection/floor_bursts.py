"""Does the floor shake for a while only? What accelerometers show together beyond rotation and ring-down.

A floor that vibrates evenly is looked for where the wall stands still (`floor_vibration`). A burst that
comes and goes while the wall rocks is seen in no part at rest. A rigid wall on a floor with acceleration a
turns by θ̈ = −(p²/g) cos(α − |θ|) a (Housner 1963 with base excitation), so that a place at the height z
shows (1 − z (p²/g) cos α) a: a shape over the heights that neither bending (z²) nor turning (y z) has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.oscillations.ring_signals import accelerations
from daq_app.gap.rocking_model.features.oscillations.rings import Ring, cleaner, forced_column, ring_columns
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun, Survey
from daq_app.gap.rocking_model.tolerances.sensors import SPREAD_ALONG_M
from daq_app.gap.rocking_model.tolerances.walls import BURST_SD, SHAKEN_POWER, USUAL_POWER

WINDOW_S = 0.5
"""Half-cycles whose middles are this near count together …"""
_ENOUGH = 60
"""… if they have as many samples of the grid."""
_SHORTEST = 40
"""Samples of the grid that a half-cycle must have: in a shorter one a smooth curve takes up a vibration, and
the rotation's own second derivative is not known well enough."""
_ROUNDS = 12
_NEAR = 0.25
"""Difference in the logarithm of jumps that are about the same."""
_ALIKE = 7
"""Half-cycles, those after the nearest jumps, that say what such a jump usually leaves."""


@dataclass(frozen=True, slots=True)
class _HalfCycle:
    """What is left between two impacts of one run after smooth curves."""

    middle_s: float
    jump: float
    """Jump of the angular velocity at the impact before."""
    columns: FloatArray
    """What the accelerometers show by the floor's shape, and the ring-down's shapes, (n, 1 or 4)."""
    free: int
    """Samples less the coefficients of the curve."""

    def power(self, rings: FloatArray) -> float:
        """Mean square without the ring-down of those coefficients."""
        left = self.columns[:, 0] - self.columns[:, 1:] @ rings
        return float(left @ left) / self.free


def floor_bursts(
    runs: Sequence[GapRun], grids: Sequence[Grid], survey: Survey, ring: Ring | None
) -> list[list[RunFinding]]:
    """Findings of the runs in which the floor shook for a while; no effect explains them.

    What is usual is said by all half-cycles of all runs: noise, and what an impact leaves, which grows with
    the jump of the speed, or what half of those leave that follow about as large a jump: a base that slips
    shows it for longer than an impact takes. Nor is a burst what comes back in two other tests. `ring` is the
    wall's bending after impacts, whose shape over the heights is not quite z²: it is the same wall in every
    run, so that one size of it is taken out of all.
    """
    seen = [_half_cycles(run, grid, survey, ring) for run, grid in zip(runs, grids, strict=True)]
    known = [cycle for cycles in seen for cycle in cycles]
    findings: list[list[RunFinding]] = [[] for _ in runs]
    if not known:
        return findings
    columns = np.concatenate([cycle.columns for cycle in known])
    rings = np.linalg.lstsq(columns[:, 1:], columns[:, 0], rcond=None)[0]
    jumps = np.array([cycle.jump for cycle in known])
    powers = np.array([cycle.power(rings) for cycle in known])
    floor, per_jump = _usual(jumps, powers)
    test = np.repeat(np.arange(len(seen)), [len(cycles) for cycles in seen])
    for k, (row, cycles) in enumerate(zip(findings, seen, strict=True)):
        power = np.array([cycle.power(rings) for cycle in cycles])
        own = np.array([cycle.jump for cycle in cycles])
        elsewhere = test != k
        alike = [_of_alike(jump, jumps, powers) for jump in own]
        again = [_seen_again(jump, jumps[elsewhere], powers[elsewhere]) for jump in own]
        usual = np.maximum.reduce([floor + per_jump * own**2, np.array(alike), np.array(again)])
        excess, loud = _loudest(cycles, power, usual)
        if loud > SHAKEN_POWER:
            size = float(np.sqrt(max(excess, 0.0)))
            row.append(RunFinding("shaking@floor", "burst of shaking", "m/s²", size, BURST_SD * size))
    return findings


def _loudest(cycles: Sequence[_HalfCycle], power: FloatArray, usual: FloatArray) -> tuple[float, float]:
    """(excess, ratio) of the power over the usual one in the second in which it is loudest."""
    if not cycles:
        return 0.0, 0.0
    middle = np.array([cycle.middle_s for cycle in cycles])
    samples = np.array([len(cycle.columns) for cycle in cycles])
    weights = (np.abs(middle[:, None] - middle[None, :]) < WINDOW_S) * samples
    loud = (weights @ power) / (weights @ usual)
    loud[weights.sum(axis=1) < _ENOUGH] = 0.0
    worst = int(np.argmax(loud))
    excess = float(weights[worst] @ (power - usual)) / float(weights[worst].sum())
    return excess, float(loud[worst])


def _half_cycles(run: GapRun, grid: Grid, survey: Survey, ring: Ring | None) -> list[_HalfCycle]:
    chosen = run.steady_accelerometers("x")
    if len(chosen) < 3:
        return []
    _, y, z = run.positions(chosen).T
    follows = survey.p_rad_s**2 / GRAVITY_M_S2 * np.cos(survey.alpha_rad)
    shapes = [1.0 - follows * z, z**2, *([y * z] if np.ptp(y) > SPREAD_ALONG_M else [])]
    if z.size <= len(shapes):
        return []
    seen = accelerations(run, grid, chosen)
    columns = (np.linalg.pinv(np.column_stack(shapes))[0] @ seen.beyond)[:, None]
    if ring is not None:
        forced = forced_column(grid, ring.frequency_hz, ring.zeta, accelerations=True)
        columns = np.column_stack([columns, ring_columns(grid, ring.frequency_hz, ring.zeta), forced])
    half_cycles = []
    for part, basis in cleaner(grid, seen.pick, slow=False):
        if part.size < _SHORTEST:
            continue
        before = int(np.searchsorted(grid.impact_s, grid.time_s[part[0]])) - 1
        if _slips(run, grid, before):
            continue
        left = columns[part] - basis @ (basis.T @ columns[part])
        middle = float(grid.time_s[part].mean())
        half_cycles.append(_HalfCycle(middle, float(grid.jumps[before]), left, part.size - basis.shape[1]))
    return half_cycles


def _slips(run: GapRun, grid: Grid, impact: int) -> bool:
    """Whether the edge that an impact sets the wall on slips, and bounces."""
    return run.slip is not None and bool(run.slip.along[int(grid.approach[impact] > 0.0)] > 0.0)


def _of_alike(jump: float, jumps: FloatArray, powers: FloatArray) -> float:
    """Power that half of the half-cycles after the nearest jumps leave; 0 where they are too few."""
    nearest = np.argsort(np.abs(np.log(np.abs(jumps) / abs(jump))))[:_ALIKE]
    return float(np.median(powers[nearest])) if nearest.size == _ALIKE else 0.0


def _seen_again(jump: float, jumps: FloatArray, powers: FloatArray) -> float:
    """Power that two half-cycles of other tests leave after about such a jump to the same side; 0 for none.

    What an edge does that slips at fast impacts comes back in other tests, and a burst does not.
    """
    near = (np.sign(jumps) == np.sign(jump)) & (np.abs(np.log(np.abs(jumps / jump))) < _NEAR)
    return float(np.sort(powers[near])[-2]) if np.count_nonzero(near) > 1 else 0.0


def _usual(jump: FloatArray, power: FloatArray) -> tuple[float, float]:
    """Power that half-cycles usually leave: a part of its own, and one per square of the jump before."""
    columns = np.column_stack([np.ones_like(jump), jump**2])
    usual, kept = np.full(jump.size, float(np.median(power))), np.ones(jump.size, dtype=bool)
    parts = np.zeros(2)
    for _ in range(_ROUNDS):
        parts, _ = nnls((columns / usual[:, None])[kept], (power / usual)[kept])
        usual = np.maximum(columns @ parts, 1e-3 * float(np.median(power)))
        ratio = power / usual
        kept = ratio < USUAL_POWER * float(np.median(ratio))
    return float(parts[0]), float(parts[1])
