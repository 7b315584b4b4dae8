"""Where the gap is: a map of channel × phase × observable, from the residuals of one hypothesis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.features import FloatArray, Label, Run
from daq_app.gap.core.policy import Policy


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of the map."""

    channel: str
    phase: str
    observable: str
    band: str
    unit: str
    n: int
    rms: float
    """Physical size, in `unit`."""
    in_noise: float
    """Rms over noise and scatter; about 1 when nothing is missing."""
    in_sensor_noise: float
    """Rms over measurement noise alone."""
    repeatable: float | None
    """Share of the residual's variance that repeats over runs of one level; None without repetitions."""
    grows_with_amplitude: float
    """Rank correlation of |residual| with the size of the motion."""
    grows_with_time: float
    """Rank correlation of |residual| with the time within the run."""


@dataclass(frozen=True, slots=True)
class GapMap:
    """All cells, largest in noise units first, and the sentence that goes with the picture."""

    cells: tuple[Cell, ...]
    sentence: str


def gap_map(
    residuals: Sequence[FloatArray],
    scales: Sequence[FloatArray],
    runs: Sequence[Run],
    policy: Policy,
) -> GapMap:
    """The map of residuals; `scales`, (n,) for each run, is what features scatter by if nothing is missing.

    Take the scales from the best hypothesis: those of a hypothesis that misfits have grown to
    swallow the misfit.
    """
    rows: dict[tuple[str, ...], list[_Row]] = {}
    for index, (run, residual, scale) in enumerate(zip(runs, residuals, scales, strict=True)):
        for k, label in enumerate(run.features.labels):
            key = (label.channel, label.phase, label.observable, label.band, label.unit)
            row = _Row(run.level, index, residual[k], run.features.sd[k], scale[k], label)
            rows.setdefault(key, []).append(row)
    cells = sorted(map(_cell, rows.values()), key=lambda c: -c.in_noise)
    return GapMap(tuple(cells), _sentence(cells, policy))


@dataclass(frozen=True, slots=True)
class _Row:
    level: str
    run: int
    residual: float
    sd: float
    scale: float
    label: Label


def _cell(rows: Sequence[_Row]) -> Cell:
    residual, label = np.array([r.residual for r in rows]), rows[0].label
    return Cell(
        label.channel,
        label.phase,
        label.observable,
        label.band,
        label.unit,
        len(rows),
        rms=float(np.sqrt(np.mean(residual**2))),
        in_noise=float(np.sqrt(np.mean((residual / np.array([r.scale for r in rows])) ** 2))),
        in_sensor_noise=float(np.sqrt(np.mean((residual / np.array([r.sd for r in rows])) ** 2))),
        repeatable=_repeatable(rows),
        grows_with_amplitude=_rank_correlation(np.abs(residual), np.abs([r.label.amplitude for r in rows])),
        grows_with_time=_rank_correlation(np.abs(residual), np.array([r.label.order for r in rows])),
    )


def _repeatable(rows: Sequence[_Row]) -> float | None:
    """Share of variance common to runs of one level, from the analysis of variance over repetitions."""
    common, total, repeated = 0.0, 0.0, False
    for level in {r.level for r in rows}:
        by_run: dict[int, list[float]] = {}
        for row in rows:
            if row.level == level:
                by_run.setdefault(row.run, []).append(row.residual)
        if len(by_run) < 2:
            continue
        repeated = True
        length = min(len(v) for v in by_run.values())
        stack = np.array([v[:length] for v in by_run.values()])
        within = float(np.mean(np.var(stack, axis=0, ddof=1)))
        mean_square = float(np.mean(np.mean(stack, axis=0) ** 2))
        common += max(mean_square - within / len(stack), 0.0)
        total += max(mean_square - within / len(stack), 0.0) + within
    if not repeated:
        return None
    return common / total if total > 0 else 0.0


def _rank_correlation(first: FloatArray, second: FloatArray) -> float:
    if first.size < 4 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    ranks = [np.argsort(np.argsort(v)).astype(float) for v in (first, second)]
    return float(np.corrcoef(ranks[0], ranks[1])[0, 1])


def _sentence(cells: Sequence[Cell], policy: Policy) -> str:
    """What the map says, in one sentence."""
    if not cells:
        return "There is nothing to compare."
    worst = cells[0]
    if worst.in_noise < policy.within_noise:
        return (
            f"Everywhere within noise and scatter; the largest cell, {worst.observable} of {worst.channel} "
            f"({worst.phase}), is {worst.in_noise:.1f} times its noise."
        )
    loudest = worst.in_noise
    loud = [c for c in cells if c.in_noise >= min(max(2.0, policy.loud_share * loudest), loudest)]
    channels = {c.channel for c in loud}
    spread = f"{worst.channel} alone" if len(channels) == 1 else f"{len(channels)} channels or families"
    trend = ""
    if worst.grows_with_amplitude > 0.5:
        trend = ", growing with amplitude"
    elif worst.grows_with_time > 0.5:
        trend = ", growing with time"
    repeat = ""
    if worst.repeatable is not None and math.isfinite(worst.repeatable):
        repeat = f"; {100 * worst.repeatable:.0f} % of it repeats from run to run"
    return (
        f"The gap is largest in the {worst.observable} of {worst.channel} ({worst.phase}): "
        f"{worst.rms:.3g} {worst.unit} rms, {worst.in_noise:.1f} times noise and scatter, "
        f"in {spread}{trend}{repeat}."
    )
