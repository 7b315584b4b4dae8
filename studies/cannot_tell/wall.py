"""Runs of one wall from the blind check's generator, whole or with less than was recorded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from daq_app.config import Rig, Scaling, load_rig, plan_tasks
from daq_app.gap.blind.world.campaign import MadeRun, PlannedRun, World
from daq_app.gap.blind.world.effects.catalogue import ENTRIES, Drawn
from daq_app.gap.blind.world.sensors.chain import draw_calibration
from daq_app.gap.blind.world.wall import draw_wall
from daq_app.gap.rocking_model.records import GapRun, Sensor, Survey

_RIG = Path(__file__).parents[2] / "configs" / "fr1.toml"
_HOLD_S = 2.4
_BETWEEN_S = 420.0


@dataclass(frozen=True, slots=True)
class Recorded:
    """What of a campaign is recorded."""

    levels: tuple[float, ...]
    """θ0/α of each run with its side, in the order of the tests."""
    without: tuple[str, ...] = ()
    """Sensor families that are not there."""
    hold_s: float = _HOLD_S
    """Record before the release."""


@cache
def _rig() -> Rig:
    return load_rig(_RIG)


def truth_of(name: str, value: float, others: dict[str, float] | None = None) -> Drawn:
    """An effect of the generator with its strength; behind ``@`` the family all of whose channels have it."""
    effect, _, family = name.partition("@")
    entry = ENTRIES[effect]
    targets = tuple(c.id for c in _rig().channels if c.family == family)
    parameters = {entry.parameter: value, **(others or {})}
    return Drawn(effect, entry.family, entry.kind, parameters, targets, math.nan)


def simulate(truth: Drawn, everything: Recorded, seed: int) -> list[GapRun]:
    """All runs with all sensors: a wall, its calibration errors and its campaign drawn from `seed`."""
    rig, rng = _rig(), np.random.default_rng([seed, 17])
    wall, calibration = draw_wall(rig.specimen, rng), draw_calibration(rig, rng)
    planned = []
    for number, level in enumerate(everything.levels):
        side = 1 if level > 0 else -1
        planned.append(
            PlannedRun(
                test=f"{rig.specimen.name}-L{round(100 * abs(level))}-{number}",
                level=f"L{round(100 * abs(level))}",
                theta0=level * rig.specimen.alpha0_rad * (1.0 + 0.01 * rng.standard_normal()),
                side=side,
                hold_s=everything.hold_s,
                omega0=float(-side * abs(3e-4 * rng.standard_normal())),
                seed=int(rng.integers(2**62)),
                campaign_s=number * _BETWEEN_S,
            )
        )
    world = World(rig, wall, calibration, (truth,), tuple(planned))
    return [_gap_run(world, run) for run in world.make()]


def _gap_run(world: World, run: MadeRun) -> GapRun:
    """The run as a diagnosis gets it: engineering units, with the nominal survey of the rig file."""
    rig = world.rig
    offsets = {c.channel.id: c.time_offset_s for task in plan_tasks(rig).tasks for c in task.channels}
    return GapRun(
        name=run.plan.test,
        level=run.plan.level,
        rate_hz=rig.acquisition.rate_hz,
        sensors=tuple(Sensor.from_channel(channel) for channel in rig.channels),
        channels=Scaling.of(rig.channels, world.calibration.tare_reading).to_si(run.readings),
        survey=Survey.from_specimen(rig.specimen),
        time_offset_s=np.array([offsets[channel.id] for channel in rig.channels]),
        start_utc_ns=1 + round(run.plan.campaign_s * 1e9),
    )


def part_of(runs: Sequence[GapRun], everything: Recorded, wanted: Recorded) -> list[GapRun]:
    """The first runs, without some families and with a shorter record before the release."""
    cut = round((everything.hold_s - wanted.hold_s) * runs[0].rate_hz)
    kept = []
    for run in runs[: len(wanted.levels)]:
        rows = [row for row, sensor in enumerate(run.sensors) if sensor.family not in wanted.without]
        kept.append(
            replace(
                run,
                sensors=tuple(run.sensors[row] for row in rows),
                channels=run.channels[rows, cut:],
                time_offset_s=run.time_offset_s[rows],
            )
        )
    return kept
