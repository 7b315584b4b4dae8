"""A channel that rings by itself after impacts: a loose bracket, which no motion of the wall explains.

What the others of its family leave of a channel is correlated with a ring-down after each impact. A ring
begins at every impact in the same phase; noise and a cable that an impact whips begin in any.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.oscillations.rings import cleaner
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.inspection.channel_families import channel_family
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import sample_noise
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import IN_PHASE, LONE

ComplexArray = NDArray[np.complex128]
_FAMILIES: tuple[Family, ...] = ("lvdt", "wire")
_HZ = np.arange(8.0, 62.0, 3.0)
_DECAY_S = 0.1


@dataclass(frozen=True, slots=True)
class _Kicks:
    """What the channels of a family do after the impacts of all runs."""

    ids: tuple[str, ...]
    apart: FloatArray
    """What each channel shows of a signal of each alone, (k, k)."""
    shown: ComplexArray
    """Correlation with a ring-down of unit size, (k, impacts, frequencies), SI, in units of equal noise."""
    pushes: FloatArray
    """Jump of the speed, rad/s, times the size of that ring-down, (impacts, frequencies)."""
    largest: tuple[float, ...]
    """Largest jump of each run, rad/s."""


def lone_rings(runs: Sequence[GapRun], grids: Sequence[Grid]) -> list[list[RunFinding]]:
    """Findings of channels that ring by themselves, run by run. No effect explains them."""
    findings: list[list[RunFinding]] = [[] for _ in runs]
    for family in _FAMILIES:
        kicks = _kicks(runs, grids, family)
        found = _lone(kicks) if kicks is not None else None
        if kicks is None or found is None:
            continue
        name, frequency_hz, size, gain = found
        index = next(i for i, sensor in enumerate(runs[0].sensors) if sensor.id == name)
        noise = float(np.median([sample_noise(run.channels[index], run.rate_hz) for run in runs]))
        words = f"ringing at {frequency_hz:.0f} Hz after impacts"
        for row, jump in zip(findings, kicks.largest, strict=True):
            value = size * jump
            sd = value / np.sqrt(2.0 * gain)
            row.append(RunFinding(f"ringing@{name}", words, "m", value, sd, noise=noise))
    return findings


def _kicks(runs: Sequence[GapRun], grids: Sequence[Grid], family: Family) -> _Kicks | None:
    """None where a run has too few channels, or all have no impacts that are followed by half a cycle."""
    shown: list[ComplexArray] = []
    pushes: list[FloatArray] = []
    ids: tuple[str, ...] = ()
    for run, grid in zip(runs, grids, strict=True):
        data = channel_family(run, grid, family)
        if data is None or (ids and data.ids != ids):
            return None
        ids = data.ids
        apart = np.eye(len(ids)) - data.design @ np.linalg.pinv(data.design)
        left = apart @ data.signals
        for part, basis in cleaner(grid, data.pick, slow=False):
            impact = int(np.searchsorted(grid.impact_s, grid.time_s[part[0]], side="right")) - 1
            if impact < 0:
                continue
            since = grid.time_s[part] - grid.impact_s[impact]
            wave = np.exp((2j * np.pi * _HZ - 1.0 / _DECAY_S) * since[:, None])
            wave -= basis @ (basis.T @ wave)
            size = np.sqrt(np.sum(np.abs(wave) ** 2, axis=0))
            shown.append(left[:, part] @ wave.conj() / size)
            pushes.append(grid.jumps[impact] * size)
    if not shown:
        return None
    largest = tuple(float(np.abs(grid.jumps).max(initial=0.0)) for grid in grids)
    return _Kicks(ids, apart, np.stack(shown, axis=1), np.array(pushes), largest)


def _lone(kicks: _Kicks) -> tuple[str, float, float, float] | None:
    """Channel, frequency in Hz, size in m per rad/s and gain in nats of the clearest ring of one channel."""
    best: tuple[str, float, float, float] | None = None
    power = np.abs(kicks.shown) ** 2
    for pushes in (kicks.pushes, np.abs(kicks.pushes)):
        # Of phases that have nothing to do with each other this is 1 in the mean, of any sizes.
        along = np.einsum("kif,if->kf", kicks.shown, pushes)
        gains = np.abs(along) ** 2 / np.maximum(np.einsum("kif,if->kf", power, pushes**2), 1e-300)
        sizes = along / np.sum(pushes**2, axis=0)
        for place, column in itertools.product(range(len(kicks.ids)), range(_HZ.size)):
            gain = float(gains[place, column])
            if gain < max(IN_PHASE, best[3] if best else 0.0):
                continue
            pattern = kicks.apart[:, place]
            size = pattern @ sizes[:, column] / (pattern @ pattern)
            share = abs(size) ** 2 * (pattern @ pattern) / np.sum(np.abs(sizes[:, column]) ** 2)
            if share > LONE:
                best = kicks.ids[place], float(_HZ[column]), float(abs(size)), gain
    return best
