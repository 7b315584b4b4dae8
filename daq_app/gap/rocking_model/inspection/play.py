"""Play of a single wire: its reading stays where the wall turns back, and follows behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.channel_shapes import shape_columns
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.features.shapes import with_play
from daq_app.gap.rocking_model.inspection.channel_families import ChannelFamily, alike_in_all, beside
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import PLAY_GAIN, PLAY_M, PLAY_STEPS

_PLAYS_M = np.geomspace(PLAY_M, 16.0 * PLAY_M, 9)


@dataclass(frozen=True, slots=True)
class _Play:
    """The play that explains most of what one wire of one run shows beyond the others."""

    size_m: float
    sd_m: float
    explained: float
    """Share of what gain, lag, curvature, side and drift leave."""


def plays(
    runs: Sequence[GapRun], grids: Sequence[Grid], examined: Sequence[str], steps_m: Mapping[str, float]
) -> list[list[RunFinding]]:
    """Findings of wires with more play than a sound drum has, run by run. No effect explains them.

    `examined` are the channels that are not used with their family; `steps_m` those of families and channels
    whose readings go in steps. Such a reading stays where the wall turns back as well, for a step.
    """
    findings: list[list[RunFinding]] = [[] for _ in runs]
    data = alike_in_all(runs, grids, "wire", examined)
    for name in data[0].ids if data else ():
        without = tuple(other for other in examined if other != name)
        seen = [_play(family, name, without) for family in data]
        explained, size_m = np.median([(play.explained, play.size_m) for play in seen], axis=0)
        step_m = max(steps_m.get("wire", 0.0), steps_m.get(name, 0.0))
        if explained < PLAY_GAIN or size_m < max(PLAY_M, PLAY_STEPS * step_m):
            continue
        for row, play in zip(findings, seen, strict=True):
            row.append(RunFinding(f"play@{name}", "play", "m", play.size_m, play.sd_m))
    return findings


def _play(data: ChannelFamily, name: str, without: tuple[str, ...]) -> _Play:
    other = beside(data, name, without)
    e, pick = other.expected, other.pick
    columns = shape_columns(other)
    basis = np.linalg.qr(columns / np.abs(columns).max(axis=0))[0]

    def beyond(values: FloatArray) -> FloatArray:
        picked = values[pick]
        return np.asarray(picked - basis @ (basis.T @ picked))

    left = beyond(other.measured - e)
    power = max(float(left @ left), 1e-300)
    best = _Play(0.0, PLAY_M, 0.0)
    for size, shown in zip(_PLAYS_M.tolist(), with_play(e, _PLAYS_M), strict=True):
        shape = beyond(shown - e)
        square = max(float(shape @ shape), 1e-300)
        share = float(shape @ left) / square
        explained = share**2 * square / power if share > 0.0 else 0.0
        if explained > best.explained:
            noise = np.sqrt(power * (1.0 - explained) / left.size / square)
            best = _Play(size * share, float(size * noise), explained)
    return best
