"""A channel that rings by itself after impacts: a loose bracket, which no motion of the wall explains.

What the others of its family leave of a channel is correlated with a ring-down after each impact. A ring
begins at every impact in the same phase; noise and a cable that an impact whips begin in any.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.oscillations.rings import cleaner
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.inspection.channel_families import alike_in_all
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import gridded, sample_noise
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import BY_ITSELF, IN_PHASE, LONE

ComplexArray = NDArray[np.complex128]
_FAMILIES: tuple[Family, ...] = ("lvdt", "wire")
_HZ = np.arange(8.0, 62.0, 3.0)
"""Steps of a ring's own width; above it a reading averaged over 5 ms shows little."""
_DECAY_S = 0.1
"""A ring of any damping from a few per cent up has most of its power in common with one that dies so soon."""

_SLOW_S = np.array([5e-3, 1e-2, 2e-2, 4e-2])
"""Decays by which slow sensors follow an impact, in one phase as well; they are taken out."""


@dataclass(frozen=True, slots=True)
class _Kicks:
    """What k channels do after the impacts of all runs."""

    shown: ComplexArray
    """Correlation with a ring-down of unit size, (k, impacts, frequencies), SI, in units of equal noise."""
    pushes: FloatArray
    """Jump of the speed, rad/s, times the size of that ring-down, (impacts, frequencies)."""

    @classmethod
    def of(cls, seen: Sequence[tuple[Grid, NDArray[np.bool_], FloatArray]]) -> _Kicks | None:
        """`seen`: grid, samples used (m,) and signals (k, m) of each run; None without an impact to use."""
        shown: list[ComplexArray] = []
        pushes: list[FloatArray] = []
        for grid, pick, signals in seen:
            for part, basis in cleaner(grid, pick, slow=False):
                impact = int(np.searchsorted(grid.impact_s, grid.time_s[part[0]], side="right")) - 1
                if impact < 0:
                    continue
                since = grid.time_s[part] - grid.impact_s[impact]
                decays = np.exp(-since[:, None] / _SLOW_S)
                basis = np.linalg.qr(np.hstack([basis, decays]))[0]
                beyond = signals[:, part] - (signals[:, part] @ basis) @ basis.T
                wave = np.exp((2j * np.pi * _HZ - 1.0 / _DECAY_S) * since[:, None])
                wave -= basis @ (basis.T @ wave)
                size = np.sqrt(np.sum(np.abs(wave) ** 2, axis=0))
                shown.append(beyond @ wave.conj() / size)
                pushes.append(grid.jumps[impact] * size)
        return cls(np.stack(shown, axis=1), np.array(pushes)) if shown else None

    def in_phase(self, *, turned: bool) -> tuple[ComplexArray, FloatArray]:
        """What rings in one phase after all impacts, by channel and frequency, (k, frequencies) each.

        Its size per jump, SI per rad/s, and its power over that of any phases: 1 where none is common.
        `turned`: its sign is that of the jump.
        """
        pushes = self.pushes if turned else np.abs(self.pushes)
        along = np.einsum("kif,if->kf", self.shown, pushes)
        usual = np.einsum("kif,if->kf", np.abs(self.shown) ** 2, pushes**2)
        # A sine is half a wave of positive frequency and half one of negative.
        sizes = 2.0 * along / np.sum(pushes**2, axis=0)
        return np.asarray(sizes), np.asarray(np.abs(along) ** 2 / np.maximum(usual, 1e-300))


@dataclass(frozen=True, slots=True)
class _Ring:
    """The clearest ring of one channel: size in m per rad/s, gain in nats."""

    name: str
    frequency_hz: float
    size: float
    gain: float


def lone_rings(
    runs: Sequence[GapRun], grids: Sequence[Grid], examined: Sequence[str] = ()
) -> list[list[RunFinding]]:
    """Findings of channels that ring by themselves, run by run. No effect explains them.

    `examined` are the channels that are not used with their family.
    """
    findings: list[list[RunFinding]] = [[] for _ in runs]
    wall = _Kicks.of([_accelerations(run, grid) for run, grid in zip(runs, grids, strict=True)])
    if wall is None or not len(wall.shown):
        return findings  # without accelerometers a bracket is not told from a wall
    for family in _FAMILIES:
        ring = _lone(runs, grids, family, tuple(examined), wall)
        if ring is None:
            continue
        index = runs[0].place(ring.name)
        noise = float(np.median([sample_noise(run.channels[index], run.rate_hz) for run in runs]))
        words = f"ringing at {ring.frequency_hz:.0f} Hz after impacts"
        for row, grid in zip(findings, grids, strict=True):
            value = ring.size * float(np.abs(grid.jumps).max(initial=0.0))
            sd = value / np.sqrt(2.0 * ring.gain)
            row.append(RunFinding(f"ringing@{ring.name}", words, "m", value, sd, noise=noise))
    return findings


def _lone(
    runs: Sequence[GapRun], grids: Sequence[Grid], family: Family, examined: tuple[str, ...], wall: _Kicks
) -> _Ring | None:
    data = alike_in_all(runs, grids, family, examined)
    if not data:
        return None
    beside = runs[0].positions([runs[0].place(name) for name in data[0].ids])[:, 1:2]
    design = data[0].design
    apart, unturned = (_beyond(columns) for columns in (design, np.hstack([design, beside])))
    kicks = _Kicks.of([(grid, one.pick, apart @ one.signals) for grid, one in zip(grids, data, strict=True)])
    if kicks is None:
        return None
    still = replace(kicks, shown=np.einsum("jk,kif->jif", unturned, kicks.shown))
    best: _Ring | None = None
    for turned in (True, False):
        sizes, gains = kicks.in_phase(turned=turned)
        # Nor a wall that turns about the vertical, which two wires at its ends show the most of.
        gains = np.minimum(gains, still.in_phase(turned=turned)[1])
        # A wall that rings accelerates by ω² times what it moves, at all its places.
        moved = wall.in_phase(turned=turned)[0] / (2.0 * np.pi * _HZ) ** 2
        of_wall = np.median(np.abs(moved), axis=0)
        for place, column in itertools.product(range(len(gains)), range(_HZ.size)):
            gain = float(gains[place, column])
            if gain < max(IN_PHASE, best.gain if best else 0.0):
                continue
            pattern = apart[:, place]
            size = float(np.abs(pattern @ sizes[:, column]) / (pattern @ pattern))
            share = size**2 * float(pattern @ pattern) / float(np.sum(np.abs(sizes[:, column]) ** 2))
            if share > LONE and size > BY_ITSELF * of_wall[column]:
                best = _Ring(data[0].ids[place], float(_HZ[column]), size, gain)
    return best


def _beyond(design: FloatArray) -> FloatArray:
    """What is left of signals, (k, k), by a motion in which each has its row of the design (k, n)."""
    return np.asarray(np.eye(len(design)) - design @ np.linalg.pinv(design))


def _accelerations(run: GapRun, grid: Grid) -> tuple[Grid, NDArray[np.bool_], FloatArray]:
    """Grid, samples away from the shocks (m,), and what the accelerometers along the motion show, (k, m)."""
    rows = [gridded(run, i) for i in run.steady_accelerometers("x")]
    signals = np.array(rows, dtype=np.float64).reshape(-1, grid.time_s.size)
    moving = (grid.time_s > 0.0) & (grid.time_s < grid.rest_s)
    return grid, moving & ~grid.near_impact, signals
