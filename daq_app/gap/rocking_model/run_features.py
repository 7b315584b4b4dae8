"""All features of one run, put together for the core."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import FeatureSet, Label
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model import swings as sw
from daq_app.gap.rocking_model.records import GapRun, Survey
from daq_app.gap.rocking_model.rotation import Rotation, joint_rotation, sample_noise, wall_rotation
from daq_app.gap.rocking_model.sensor_blocks import GRID_HZ, Block, Grid, blocks_of, coarse, make_grid

_SMALLEST_LOADING = 1e-3


@dataclass(frozen=True, slots=True)
class RockingRun:
    """A run as the core sees it, with what the rocking model needs to predict its features."""

    name: str
    level: str
    features: FeatureSet
    survey: Survey
    swings: sw.Swings
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
    block_loadings: FloatArray
    """(n, k): measurement covariance of the blocks as loadings."""
    notes: tuple[str, ...] = ()
    cache: dict[Any, Any] = field(default_factory=dict, compare=False)


def extract(run: GapRun) -> RockingRun:
    """Features of a run. Raises `CannotDiagnose` where it holds no rocking motion."""
    run, joint = _from_hold(run)
    reference, theta, noise, notes = _reference(run, joint)
    swings = sw.find_swings(theta, noise, run.rate_hz, run.name)
    grid = make_grid(theta, joint.valid, swings, run.rate_hz)
    blocks = tuple(blocks_of(run, joint, grid, swings, reference).values())
    values, sds, labels, places = _times(swings, reference, run.survey)
    peaks = np.arange(1, swings.peak_s.size)
    amplitude, order = swings.peak_rad, swings.peak_s / max(swings.peak_s[-1], 1e-9)
    for k in peaks:
        values.append(float(np.log(abs(amplitude[k]))))
        relative = [swings.peak_sd[j] / abs(amplitude[j]) for j in (k, k - 1)]
        sds.append(float(np.hypot(*relative)))
        labels.append(
            Label(reference, "peak", "log peak after impact", "1", float(amplitude[k - 1]), float(order[k]))
        )
    first = len(values)
    for block in blocks:
        for name, unit, value, variance in zip(
            block.names, block.units, block.values, np.diag(block.covariance), strict=True
        ):
            values.append(float(value))
            sds.append(_SMALLEST_LOADING * float(np.sqrt(variance)) + 1e-15)
            labels.append(Label(block.family, "run", name, unit, float(abs(amplitude[0])), 0.5))
    loadings = _block_loadings(blocks, first, len(values))
    features = FeatureSet(np.array(values), np.array(sds), tuple(labels))
    return RockingRun(
        run.name,
        run.level,
        features,
        run.survey,
        swings,
        places,
        np.flatnonzero(places[:, 0] != places[:, 2]),
        peaks,
        blocks,
        grid,
        reference,
        run.impacts_before,
        _wire_height(run),
        loadings,
        notes,
    )


BEFORE_RELEASE_S = 1.0


def _from_hold(run: GapRun) -> tuple[GapRun, Rotation]:
    """The record from one second before the release on: the pull and the wait before are no test."""
    joint = joint_rotation(run)
    step = max(round(run.rate_hz / GRID_HZ), 1)
    theta = np.abs(coarse(joint.theta, run.rate_hz))
    largest = float(theta.max())
    held = np.flatnonzero(theta > 0.98 * largest)
    below = np.flatnonzero(theta < 0.5 * largest)
    # The release ends the first stay near the largest rotation; a later peak never comes that high.
    after = below[below > held[0]]
    release = held[held < after[0]][-1] if after.size else held[-1]
    start = int(release * step - BEFORE_RELEASE_S * run.rate_hz)
    if start < 0.5 * run.rate_hz:
        return run, joint
    cut = replace(run, channels=np.ascontiguousarray(run.channels[:, start:]))
    return cut, joint_rotation(cut)


def _reference(run: GapRun, joint: Rotation) -> tuple[str, FloatArray, float, tuple[str, ...]]:
    """The rotation that the dynamics are read from: LVDTs, or wires where the LVDTs reach their range."""
    notes = tuple(f"{run.name}: {name} left out, it disagrees with its family." for name in joint.left_out)
    if joint.whole:
        return "lvdt", joint.theta, joint.noise_rad, notes
    rows, heights, _ = wall_rotation(run)
    if len(rows) == 0:
        return "lvdt", joint.theta, joint.noise_rad, (*notes, f"{run.name}: LVDTs reach their range.")
    theta = np.average(rows, axis=0, weights=heights**2)
    note = f"{run.name}: LVDTs reach their range; its motion is read from the wires."
    return "wire", theta, sample_noise(theta, run.rate_hz), (*notes, note)


def _times(
    swings: sw.Swings, reference: str, survey: Survey
) -> tuple[list[float], list[float], list[Label], NDArray[np.intp]]:
    """Time features of all half-cycles: parts of the fall and rise, over the top, across the impact."""
    values: list[float] = []
    sds: list[float] = []
    labels: list[Label] = []
    places: list[tuple[int, int, int, int]] = []
    count = swings.levels.shape[1]
    last = max(swings.peak_s[-1], 1e-9)

    def crossing(k: int, place: int) -> tuple[float, float]:
        if place < count:
            return float(swings.fall_s[k, place]), float(swings.fall_sd[k, place])
        return float(swings.rise_s[k, place - count]), float(swings.rise_sd[k, place - count])

    def add(observable: str, phase: str, ka: int, a: int, kb: int, b: int) -> None:
        (ta, sa), (tb, sb) = crossing(ka, a), crossing(kb, b)
        if not np.isfinite(ta + tb + sa + sb):
            return
        values.append(tb - ta)
        sds.append(float(np.sqrt(sa**2 + sb**2 + _from_peak_error(swings, survey, ka, a, kb, b) ** 2)))
        labels.append(
            Label(
                reference, phase, observable, "s", float(swings.peak_rad[ka]), float(swings.peak_s[ka] / last)
            )
        )
        places.append((ka, a, kb, b))

    for k in range(swings.peak_s.size):
        used = len(sw.RELEASE_FRACTIONS) if k == 0 else len(sw.FRACTIONS)
        for j in range(1, used):
            phase = "release" if k == 0 else "swing"
            add(f"fall time {j}" if k else f"first fall time {j}", phase, k, j - 1, k, j)
        if k > 0:
            for j in range(1, used):
                add(f"rise time {j}", "swing", k, count + j, k, count + j - 1)
            add("time over the top", "peak", k, count, k, 0)
        if k + 1 < swings.peak_s.size:
            add("time across the impact", "impact", k, used - 1, k + 1, count + len(sw.FRACTIONS) - 1)
    return values, sds, labels, np.array(places, dtype=np.intp)


def _wire_height(run: GapRun) -> float:
    heights = np.array([run.sensors[i].position_m[2] for i in run.indices("wire")])
    return float(np.sum(heights**2) / np.sum(heights)) if heights.size else 1.0


def _from_peak_error(swings: sw.Swings, survey: Survey, ka: int, a: int, kb: int, b: int) -> float:
    """What the error of a measured peak does to the time over the top of it, s.

    Near the top |θ| = φ − ½ c t², so the time between two crossings of a level h below the peak,
    2 √(2h/c), changes by 2/√(2 h c) per rad of the peak.
    """
    count = swings.levels.shape[1]
    if ka != kb or not a >= count > b:
        return 0.0
    peak = abs(float(swings.peak_rad[ka]))
    curvature = survey.p_rad_s**2 * max(np.sin(survey.alpha_rad - peak), 0.01)
    below = max(peak - float(swings.levels[ka, b]), 1e-6)
    return float(2.0 * swings.peak_sd[ka] / np.sqrt(2.0 * below * curvature))


def _block_loadings(blocks: tuple[Block, ...], first: int, n: int) -> FloatArray:
    columns = []
    row = first
    for block in blocks:
        k = len(block.names)
        matrix = np.zeros((n, k))
        jitter = 1e-12 * np.diag(np.diag(block.covariance))
        matrix[row : row + k] = np.linalg.cholesky(block.covariance + jitter)
        columns.append(matrix)
        row += k
    return np.hstack(columns) if columns else np.zeros((n, 0))
