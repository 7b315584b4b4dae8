"""The runs of one case: levels and repetitions of one wall, with the effects that it hides."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config import Rig, plan_tasks
from daq_app.gap.blind.world.course import Course, follow
from daq_app.gap.blind.world.effects.catalogue import Drawn
from daq_app.gap.blind.world.events.mechanics import Release
from daq_app.gap.blind.world.events.motion import Followed
from daq_app.gap.blind.world.events.scene import Scene
from daq_app.gap.blind.world.laboratories.numerics import Engine, Numerics
from daq_app.gap.blind.world.laboratories.table import Chain, Laboratory, draw_sizes
from daq_app.gap.blind.world.sensors.bench_chain import bench_readings
from daq_app.gap.blind.world.sensors.chain import (
    CALIBRATION_TOLERANCE,
    Calibration,
    draw_calibration,
    readings,
)
from daq_app.gap.blind.world.sensors.faults import Fault, Place
from daq_app.gap.blind.world.sensors.field_chain import field_readings
from daq_app.gap.blind.world.sensors.installation import Installation, draw_installation
from daq_app.gap.blind.world.shock import Shock, draw_shock
from daq_app.gap.blind.world.sway import Sway, draw_sway
from daq_app.gap.blind.world.usual import draw_usual
from daq_app.gap.blind.world.wall import Wall, draw_wall, off_survey

LEVELS: Final = {"L1": 0.15, "L2": 0.25, "L3": 0.35, "L4": 0.40}
_AFTER_REST_S = 1.0
_BETWEEN_RUNS_S = 420.0
_RELEASE_SCATTER = 0.01
_SHORTEST_S = 1.5
"""Shortest part of a record before the release and after the rest."""
_SURROUNDINGS = 0x5AB0
_USUAL = 0x0507
"""Tell the random numbers of a case's surroundings, and of what is usual there, from those of its wall."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Everything that a laboratory decides for one case; the defaults are those of `own`."""

    laboratory: str = "own"
    chain: Chain = "own"
    sizes: Mapping[str, float] = field(default_factory=dict)
    """Imperfection → its size."""
    numerics: Numerics = field(default_factory=Numerics)
    shock: Shock = field(default_factory=Shock)
    installation: Installation | None = None
    """None where everything stands as the rig file says."""


def draw_surroundings(
    laboratory: Laboratory, rig: Rig, sizes: Mapping[str, float], rng: np.random.Generator
) -> Surroundings:
    """Surroundings with imperfections of these sizes."""
    form = laboratory.shocks[int(rng.integers(len(laboratory.shocks)))]
    return Surroundings(
        laboratory=laboratory.name,
        chain=laboratory.chain,
        sizes=sizes,
        numerics=laboratory.numerics.draw(rng),
        shock=draw_shock(form, sizes["impact_shock"], rng) if "impact_shock" in sizes else Shock(),
        installation=draw_installation(rig, sizes, rng),
    )


@dataclass(frozen=True, slots=True)
class PlannedRun:
    """One run of a case before it happens."""

    test: str
    level: str
    theta0: float
    side: int
    hold_s: float
    omega0: float
    seed: int
    campaign_s: float
    rest_s: float = _AFTER_REST_S
    """How long the record goes on after the wall has come to rest."""
    sway: Sway | None = None


@dataclass(frozen=True, slots=True)
class MadeRun:
    """One run of a case: its readings and, for the label, how it went."""

    plan: PlannedRun
    readings: NDArray[np.float64]
    """(channels, n), unit of each channel's reading."""
    motion: Followed


@dataclass(frozen=True, slots=True)
class World:
    """All that is true in one case."""

    rig: Rig
    wall: Wall
    calibration: Calibration
    effects: tuple[Drawn, ...]
    runs: tuple[PlannedRun, ...]
    engine: Engine = "events"
    surroundings: Surroundings = field(default_factory=Surroundings)
    usual: tuple[Drawn, ...] = ()
    """What any wall and rig has of some effects; what is hidden under the same name takes its place."""

    @property
    def mechanical(self) -> dict[str, dict[str, float]]:
        """Effects on the wall, the floor and the clock by name; those on channels are `faults`."""
        return {e.name: e.parameters for e in (*self.usual, *self.effects) if not e.targets}

    @property
    def faults(self) -> tuple[Fault, ...]:
        return tuple(
            Fault(e.name, e.parameters, e.targets) for e in (*self.usual, *self.effects) if e.targets
        )

    def make(self) -> Iterator[MadeRun]:
        """The runs in their order; the wall wears from one to the next."""
        rate_hz = self.rig.acquisition.rate_hz
        clock = 1.0 + self.mechanical.get("clock", {}).get("error", 0.0)
        largest = max(abs(run.theta0) for run in self.runs)
        impacts = 0
        for index, run in enumerate(self.runs):
            course = self.course(index, impacts)
            motion = course.motion
            # A clock that runs wrong takes sample k at k/(rate·clock), and the file says k/rate.
            n = round((run.hold_s + motion.rest_s + run.rest_s) * rate_hz)
            time_s = np.arange(n) / (rate_hz * clock) - run.hold_s
            scene = replace(course.scene(time_s), shock=self.surroundings.shock)
            rng = np.random.default_rng([run.seed, 2])
            values = self._readings(scene, rng, Place(run.campaign_s, largest))
            impacts += len(motion.impacts)
            yield MadeRun(run, values, motion)

    def _readings(self, scene: Scene, rng: np.random.Generator, place: Place) -> NDArray[np.float64]:
        around = self.surroundings
        if around.installation is None:
            skew = {c.channel.id: c.time_offset_s for t in plan_tasks(self.rig).tasks for c in t.channels}
            return readings(self.rig, scene, self.faults, self.calibration, skew, rng, place)
        read = {"bench": bench_readings, "field": field_readings}[around.chain]
        return read(around.installation, scene, self.faults, self.calibration, around.sizes, rng, place)

    def course(self, index: int, impacts_before: int = 0) -> Course:
        """One run: how the wall moves and what its sensors see of that."""
        run = self.runs[index]
        omega0 = run.omega0
        if "initial_velocity" in self.mechanical:
            # Each run its own push, of one sign.
            push = np.random.default_rng([run.seed, 3]).uniform(0.6, 1.4)
            omega0 += run.side * push * self.mechanical["initial_velocity"]["omega_rad_s"]
        release = Release(run.theta0, omega0, run.hold_s, run.seed, index, impacts_before)
        numerics = self.surroundings.numerics
        return follow(self.engine, self.wall, self.mechanical, release, numerics, run.sway)


def draw_world(
    rig: Rig,
    effects: Sequence[Drawn],
    n_runs: int,
    rng: np.random.Generator,
    engine: Engine = "events",
) -> World:
    """A wall, its sensors and its campaign around the given effects, as in the laboratory `own`."""
    wall = draw_wall(rig.specimen, rng)
    calibration = draw_calibration(rig, rng)
    order = list(LEVELS) + [list(LEVELS)[int(i)] for i in rng.integers(0, len(LEVELS), max(0, n_runs - 4))]
    order = sorted(order[:n_runs])
    if rng.uniform() < 0.3:
        order = [order[int(i)] for i in rng.permutation(n_runs)]
    both_sides = rng.uniform() < 0.3
    first_side = int(rng.choice([-1, 1]))
    runs: list[PlannedRun] = []
    seen: dict[str, int] = {}
    started = 0.0
    for level in order:
        seen[level] = seen.get(level, 0) + 1
        side = int(rng.choice([-1, 1])) if both_sides else first_side
        theta0 = side * LEVELS[level] * rig.specimen.alpha0_rad
        runs.append(
            PlannedRun(
                test=f"{rig.specimen.name}-{level}-{seen[level]}",
                level=level,
                theta0=theta0 * (1.0 + _RELEASE_SCATTER * rng.standard_normal()),
                side=side,
                hold_s=float(rng.uniform(2.0, 2.8)),
                omega0=float(-side * abs(3e-4 * rng.standard_normal())),
                seed=int(rng.integers(2**62)),
                campaign_s=started,
            )
        )
        started += _BETWEEN_RUNS_S * math.exp(0.3 * rng.standard_normal())
    return World(rig, wall, calibration, tuple(effects), tuple(runs), engine)


def in_laboratory(world: World, laboratory: Laboratory, seed: int, index: int) -> World:
    """The same case in a laboratory: the sizes of its imperfections are those of place `index` of a seed."""
    if laboratory.chain == "own":
        return world
    rng = np.random.default_rng([seed, index, _SURROUNDINGS])
    around = draw_surroundings(laboratory, world.rig, draw_sizes(laboratory, seed, index), rng)
    sizes = around.sizes
    return replace(
        world,
        wall=off_survey(world.wall, world.rig.specimen, sizes),
        calibration=draw_calibration(world.rig, rng, sizes.get("calibration", CALIBRATION_TOLERANCE)),
        runs=tuple(_run_in_laboratory(run, sizes, rng) for run in world.runs),
        surroundings=around,
        usual=draw_usual(world.rig, sizes, np.random.default_rng([seed, index, _USUAL])),
    )


def _run_in_laboratory(run: PlannedRun, sizes: Mapping[str, float], rng: np.random.Generator) -> PlannedRun:
    scatter, longest = sizes.get("release_scatter", 0.0), sizes.get("record_length", 0.0)
    missed, before, after = rng.standard_normal(), rng.uniform(), rng.uniform()
    sway = draw_sway(sizes.get("sway", 0.0), rng)
    planned = replace(
        run, theta0=run.theta0 * (1.0 + scatter * missed), sway=sway if "sway" in sizes else None
    )
    if not longest:
        return planned
    spare = longest - _SHORTEST_S
    return replace(planned, hold_s=_SHORTEST_S + before * spare, rest_s=_SHORTEST_S + after * spare)
