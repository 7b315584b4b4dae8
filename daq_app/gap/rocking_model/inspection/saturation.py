"""Does a channel stop short of its declared range? Seen against the rotation that the other family shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.run_findings import RunFinding
from daq_app.gap.rocking_model.motion.late_joint import lateness
from daq_app.gap.rocking_model.motion.rotation import (
    GRID_HZ,
    Wire,
    coarse,
    gridded,
    opening,
    reaches_its_range,
    rotation_of_faces,
    zeroed,
)
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.tolerances.inspection import (
    AS_FAR,
    BEYOND_FAMILY,
    FLAT_TOP,
    GOES_ON,
    IN_PROPORTION,
    LIMIT_SD,
    SAME_LIMIT,
    SHORTEST_TOP_S,
    STANDS_STILL,
    TOP_OF_REACH,
    TRAVELS_ON,
)

_OTHER: dict[Family, Family] = {"lvdt": "wire", "wire": "lvdt"}


def saturated(
    runs: Sequence[GapRun], steps: Mapping[str, float] = MappingProxyType({})
) -> tuple[list[GapRun], list[list[RunFinding]]]:
    """Runs with the ranges that the channels really have, and a finding per family: 1/limit, 0 for no limit.

    `steps` are those, m, of families and channels whose reading goes in steps: their tops are flat for that.
    """
    rotations = {family: [_rotation(run, family) for run in runs] for family in _OTHER}
    findings: list[list[RunFinding]] = [[] for _ in runs]
    limits: dict[str, float] = {}
    for family, other in _OTHER.items():
        ids = [runs[0].sensors[i].id for i in runs[0].indices(family)]
        roughness = [_roughness(run, other, steps.get(other, 0.0)) for run in runs]
        timed = [_in_step(a, b) for a, b in zip(rotations[family], rotations[other], strict=True)]
        cells = [
            [
                (0.0, 0.0) if family in steps or name in steps else _limit(run, name, rotation, rough)
                for name in ids
            ]
            for run, rotation, rough in zip(runs, timed, roughness, strict=True)
        ]
        table = np.array(cells).reshape(len(runs), len(ids), 2)
        # A limit is one in all runs: what a channel has gone beyond in another run was none.
        table[:, :, 0] *= table[:, :, 0] > SAME_LIMIT * table[:, :, 1].max(axis=0)
        clipped = [k for k in range(len(ids)) if np.any(table[:, k, 0] > 0.0)]
        # A faulty rotation makes all channels of the other family look wrong in the same way.
        for k in clipped:
            limits[ids[k]] = float(np.median(table[table[:, k, 0] > 0.0, k, 0]))
        key = ids[clipped[0]] if len(clipped) == 1 else family
        if len(clipped) > 1:
            # What ends a family ends all of it: on the side that hardly gets there no top looks flat, and one
            # that is 2 % short of its peak is a curvature to whoever reads the rotation from it.
            common = float(np.median([limits[ids[k]] for k in clipped]))
            reach = table[:, :, 1].max(axis=0)
            limits |= {
                name: common
                for name, far in zip(ids, reach, strict=True)
                if name not in limits and far < BEYOND_FAMILY * common
            }
        # Where several clip, those that travel furthest stand for them; zeros differ, so their middle does.
        furthest = max((limits[ids[k]] for k in clipped), default=0.0)
        chosen = [k for k in clipped if limits[ids[k]] > AS_FAR * furthest]
        for run_findings, row in zip(findings, table, strict=True):
            seen = [row[k, 0] for k in chosen if row[k, 0] > 0.0]
            usual = float(np.median(row[chosen or slice(None), 1])) if len(ids) else 0.0
            limit = float(np.median(seen)) if seen else 0.0
            value, sd = (1.0 / limit, LIMIT_SD / limit) if limit else (0.0, 0.6 / max(usual, 1e-6))
            run_findings.append(RunFinding(f"saturation@{key}", "inverse of the limit", "1/m", value, sd))
    return [_narrowed(run, limits) for run in runs], findings


def _narrowed(run: GapRun, limits: dict[str, float]) -> GapRun:
    if not limits:
        return run
    sensors = tuple(
        replace(
            s,
            range_si=(
                max(s.range_si[0], -FLAT_TOP * limits[s.id]),
                min(s.range_si[1], FLAT_TOP * limits[s.id]),
            ),
        )
        if s.id in limits
        else s
        for s in run.sensors
    )
    return replace(run, sensors=sensors)


def _rotation(run: GapRun, family: Family) -> FloatArray | None:
    """θ on the grid as the middle channel of a family shows it, from geometry alone."""
    rows: list[tuple[float, FloatArray]] = []
    for i in run.indices(family):
        sensor = run.sensors[i]
        if not run.reads(i) or reaches_its_range(run.aligned(i), sensor.range_si):
            continue
        values = gridded(run, i)
        if family == "wire" and sensor.anchor_m is not None:
            values = Wire(sensor, run.survey.half_base_m).rotation(values)
        rows.append((sensor.position_m[0], values))
    if family == "wire":
        return np.median([v for _, v in rows], axis=0) if len(rows) >= 2 else None
    return rotation_of_faces([v for _, v in rows], [x for x, _ in rows], run.survey.half_base_m, fewest=2)


def _in_step(mine: FloatArray | None, other: FloatArray | None) -> FloatArray | None:
    """The other family's rotation, as late as this family shows it, and drifting as little.

    Beside a rotation that comes sooner a late channel seems to stand still at the top while the wall
    moves on, and beside one that drifts a sound one seems to stop short. The drift is read below the tops.
    """
    if mine is None or other is None:
        return other
    place = np.arange(other.size, dtype=float)
    timed = np.interp(place - lateness(mine, other), place, other)
    below = np.abs(mine) < IN_PROPORTION[1] * np.abs(mine).max()
    columns = np.column_stack([place - place[-1], mine, np.ones_like(mine)])
    drift = np.linalg.lstsq(columns[below], (timed - mine)[below], rcond=None)[0][0]
    return np.asarray(timed - drift * columns[:, 0])


def _roughness(run: GapRun, family: Family, step: float) -> float:
    """Step of a family's readings as a share of what its middle channel travels."""
    travels = [float(np.abs(zeroed(run, i)).max()) for i in run.indices(family)] if step > 0.0 else []
    finite = [travel for travel in travels if np.isfinite(travel)]
    return step / max(float(np.median(finite)), step) if finite else 0.0


def _limit(run: GapRun, name: str, rotation: FloatArray | None, rough: float) -> tuple[float, float]:
    """(limit, reach) of a channel in m; limit 0 where it follows as far as the rotation goes.

    `rough` is the share of its largest by which the rotation itself goes in steps.
    """
    i = run.place(name)
    if rotation is None or not run.reads(i):
        return 0.0, 0.0
    mine = np.abs(gridded(run, i))
    # A channel stops at a reading, wherever its zero has gone since.
    aligned = run.aligned(i)
    reading = np.abs(coarse(aligned, run.rate_hz))
    furthest = float(reading.max())
    if reaches_its_range(aligned, run.sensors[i].range_si):
        return 0.0, furthest
    expected = _expected(run, i, rotation)
    limit = _stops_at(mine, reading, expected, rotation, rough)
    if limit > 0.0:
        # A channel that alone is late stands still, too, while a rotation that comes sooner moves on.
        place = np.arange(rotation.size, dtype=float)
        late = np.interp(place - lateness(mine, expected), place, rotation)
        limit = _stops_at(mine, reading, _expected(run, i, late), late, rough)
    return limit, furthest


def _expected(run: GapRun, i: int, rotation: FloatArray) -> FloatArray:
    """Size of what a channel reads of a rotation, both (m,), m."""
    sensor, half = run.sensors[i], run.survey.half_base_m
    if sensor.family == "wire" and sensor.anchor_m is not None:
        return np.abs(Wire(sensor, half).shortening(rotation))
    return opening(rotation, sensor.position_m[0], half)


def _stops_at(
    mine: FloatArray, reading: FloatArray, expected: FloatArray, rotation: FloatArray, rough: float
) -> float:
    """Reading, m, at which a channel stands still while the rotation moves on; 0 where it does not.

    `mine`, `reading`, `expected`: size of what it shows from its rest, from zero, and should show, (m,), m.
    """
    # On the side of its largest reading only: the other side may have another gain, and where the zero
    # is far off it may travel further there without an end.
    side = np.sign(rotation[int(np.argmax(reading))])
    same = np.sign(rotation) == side
    largest = float(mine[same].max(initial=0.0))
    below = same & (mine > IN_PROPORTION[0] * largest) & (mine < IN_PROPORTION[1] * largest)
    top = same & (mine > FLAT_TOP * largest)
    if below.sum() < 20 or top.sum() < round(SHORTEST_TOP_S * GRID_HZ):
        return 0.0
    gain = float(np.median(mine[below] / np.maximum(expected[below], 1e-9)))
    reach = gain * expected[top]
    if float(np.quantile(reach, TOP_OF_REACH)) <= (GOES_ON + rough) * largest:
        return 0.0
    # Standing still while the rotation moves on is clipping; following at another rate is not.
    noise = float(np.std(mine[-40:]))
    travel = float(np.ptp(np.quantile(reach, (0.01, 0.99))))
    moved = float(np.ptp(np.quantile(mine[top], (0.05, 0.95))))
    goes_on = travel > (TRAVELS_ON[0] + rough) * largest + TRAVELS_ON[1] * noise
    stopped = goes_on and moved < STANDS_STILL[0] * travel + STANDS_STILL[1] * noise
    return float(np.median(reading[top])) if stopped else 0.0
