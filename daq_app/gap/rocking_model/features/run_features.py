"""All features of one run, put together for the core."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core import FeatureSet, Label
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.block import scalar_block
from daq_app.gap.rocking_model.features.families import sensor_families
from daq_app.gap.rocking_model.features.families.wires import leaked_turn
from daq_app.gap.rocking_model.features.family import Scene
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.slips.base_walk import beside_slips
from daq_app.gap.rocking_model.motion import swings as sw
from daq_app.gap.rocking_model.motion.hold import from_hold
from daq_app.gap.rocking_model.motion.motion_grid import make_grid
from daq_app.gap.rocking_model.motion.quiet import quiet
from daq_app.gap.rocking_model.motion.release_speed import release_speed
from daq_app.gap.rocking_model.motion.rotation import (
    Rotation,
    mean_rotation,
    noise_of_wires,
    straight_line,
    wire_height,
    wires_of,
)
from daq_app.gap.rocking_model.records import GapRun, Survey


@dataclass(frozen=True, slots=True)
class Examined:
    """A run cut to its test, its joint, and its features."""

    run: GapRun
    joint: Rotation
    features: RockingRun
    wanted: str = ""
    """Which rotation was asked for (`examine`)."""

    def after(self, impacts: float) -> Examined:
        """The same of a run that so many impacts went before; no feature depends on them."""
        features = replace(self.features, impacts_before=impacts)
        return replace(self, run=replace(self.run, impacts_before=impacts), features=features)


def extract(run: GapRun) -> RockingRun:
    """Features of a run. Raises `CannotDiagnose` where it holds no rocking motion."""
    return examine(run).features


def examine(run: GapRun, reference: str = "") -> Examined:
    """Features of a run with what they were made from.

    `reference` ``wire`` overrides the LVDTs, ``late`` as well, but keeps what their joint shows of itself.
    """
    wanted = reference
    run, joint = from_hold(run)
    reference, theta, noise, notes = _reference(run, joint, wanted)
    swings = sw.find_swings(theta, noise, run.survey.p_rad_s, run.rate_hz, run.name)
    grid = make_grid(theta, joint.valid, swings, run.rate_hz, run.survey)
    if run.slip is not None:
        grid = beside_slips(grid, run.slip)
    scene = Scene(run, joint, grid, swings, reference, quiet(run, grid), wanted == "late")
    seen = (block for family in sensor_families() for block in family.observe(scene))
    blocks = tuple(block for block in seen if block is not None)
    initial_speed = release_speed(theta, noise, swings, run.survey, run.rate_hz)
    if initial_speed is not None:
        entry = ("speed away from upright", "rad/s", initial_speed[0], initial_speed[1] ** 2)
        blocks = (*blocks, scalar_block("release", (entry,), grid))
    rows, places = _times(swings, reference, run.survey)
    peaks = np.arange(1, swings.peak_s.size)
    amplitude, order = swings.peak_rad, swings.peak_s / swings.peak_s[-1]
    for k in peaks:
        relative = [swings.peak_sd[j] / abs(amplitude[j]) for j in (k, k - 1)]
        of_peak = "peak", "log peak after impact", "1", float(amplitude[k - 1]), float(order[k])
        rows.append((np.log(abs(amplitude[k])), np.hypot(*relative), Label(reference, *of_peak)))
    features = RockingRun(
        run.name,
        run.level,
        FeatureSet.of(rows),
        run.survey,
        swings,
        places,
        np.flatnonzero(places[:, 0] != places[:, 2]),
        peaks,
        (),
        grid,
        reference,
        run.impacts_before,
        *_wire_heights(run),
        np.zeros((len(rows), 0)),
        notes,
        wires=wires_of(run),
        leaked=leaked_turn(run) if reference == "wire" else np.zeros(0),
    )
    return Examined(run, joint, features.with_blocks(blocks), wanted)


def _reference(run: GapRun, joint: Rotation, wanted: str) -> tuple[str, FloatArray, float, tuple[str, ...]]:
    """The rotation that the dynamics are read from: LVDTs, or wires where the LVDTs reach their range."""
    notes = tuple(f"{run.name}: {name} left out, it disagrees with its family." for name in joint.left_out)
    if joint.whole and not wanted:
        return "lvdt", joint.theta, joint.noise_rad, notes
    theta = mean_rotation(run)
    if theta is None:
        limit = () if joint.whole else (f"{run.name}: LVDTs reach their range.",)
        return "lvdt", joint.theta, joint.noise_rad, (*notes, *limit)
    why = "LVDTs reach their range" if not joint.whole else "the LVDTs are not fit for it"
    note = f"{run.name}: {why}; its motion is read from the wires."
    return "wire", theta, noise_of_wires(run, theta), (*notes, note)


def _times(
    swings: sw.Swings, reference: str, survey: Survey
) -> tuple[list[tuple[float, float, Label]], NDArray[np.intp]]:
    """Time features of all half-cycles: parts of the fall and rise, over the top, across the impact.

    (value, sd, label) of each, and its crossings as in `RockingRun.places`.
    """
    rows: list[tuple[float, float, Label]] = []
    places: list[tuple[int, int, int, int]] = []
    count = swings.levels.shape[1]
    last = swings.peak_s[-1]

    def crossing(k: int, place: int) -> tuple[float, float]:
        if place < count:
            return float(swings.fall_s[k, place]), float(swings.fall_sd[k, place])
        return float(swings.rise_s[k, place - count]), float(swings.rise_sd[k, place - count])

    def add(observable: str, phase: str, ka: int, a: int, kb: int, b: int) -> None:
        (ta, sa), (tb, sb) = crossing(ka, a), crossing(kb, b)
        if not np.isfinite(ta + tb + sa + sb):
            return
        sd = float(np.sqrt(sa**2 + sb**2 + _from_peak_error(swings, survey, ka, a, kb, b) ** 2))
        size, order = float(swings.peak_rad[ka]), float(swings.peak_s[ka] / last)
        rows.append((tb - ta, sd, Label(reference, phase, observable, "s", size, order)))
        places.append((ka, a, kb, b))

    for k in range(swings.peak_s.size):
        used = len(sw.RELEASE_FRACTIONS) if k == 0 else len(sw.FRACTIONS)
        for j in range(1, used):
            phase = "release" if k == 0 else "swing"
            add(f"fall time {j}" if k else "first fall time", phase, k, j - 1, k, j)
        if k > 0:
            for j in range(1, used):
                add(f"rise time {j}", "swing", k, count + j, k, count + j - 1)
            add("time over the top", "peak", k, count, k, 0)
        if k + 1 < swings.peak_s.size:
            add("time across the impact", "impact", k, used - 1, k + 1, count + len(sw.FRACTIONS) - 1)
    return rows, np.array(places, dtype=np.intp)


def _wire_heights(run: GapRun) -> tuple[float, float, float, float]:
    """How a displacement u of every wire, and κ u² of every wire, act on their mean rotation and base.

    The mean has the weights z²: Σ z² (u/z) / Σ z² for a displacement, Σ z² (κ z² θ²/z) / Σ z² for κ u².
    The base is where the straight line through the displacements over z ends; last, how far that seems to
    move with the rotation where each wire has another calibration: the root of the sum of their squares.
    """
    z = run.positions(run.indices("wire"))[:, 2]
    if not z.size:
        return 1.0, 1.0, 0.0, 0.0
    at_base = straight_line(z)[0]
    return (
        wire_height(run),
        float(np.sum(z**3) / np.sum(z**2)),
        float(at_base @ z**2),
        float(np.linalg.norm(at_base * z)),
    )


def _from_peak_error(swings: sw.Swings, survey: Survey, ka: int, a: int, kb: int, b: int) -> float:
    """What the error of a measured peak does to the time between two crossings of its half-cycle, s.

    Near the top |θ| = φ − ½ c t², so a level h below the peak is passed √(2h/c) from it, and that changes
    by 1/√(2 h c) per rad of the peak. Over the top both sides add up; in the fall or the rise the level
    near the peak changes more than the lower one. The held rotation is an unknown of the fit itself.
    """
    count = swings.levels.shape[1]
    if ka != kb or ka == 0:
        return 0.0
    peak = abs(float(swings.peak_rad[ka]))
    curvature = survey.p_rad_s**2 * max(np.sin(survey.alpha_rad - peak), 0.01)
    below = peak - np.array([float(swings.levels[ka, place % count]) for place in (a, b)])
    each = 1.0 / np.sqrt(2.0 * np.maximum(below, 1e-6) * curvature)
    over_the_top = a >= count > b
    changed = each.sum() if over_the_top else abs(each[1] - each[0])
    return float(swings.peak_sd[ka] * changed)
