"""Make the cases of a blind check: worlds drawn from a seed, written, labelled and sealed."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.config import Rig, parse_rig
from daq_app.gap.blind.layout import CASE_PREFIX, SEAL_FILE
from daq_app.gap.blind.making.case_files import write_case
from daq_app.gap.blind.making.detectability import detectability
from daq_app.gap.blind.making.mix import Category, case_generator, category_of, draw_effects, draw_named
from daq_app.gap.blind.names import accepted_names
from daq_app.gap.blind.seal import seal_case
from daq_app.gap.blind.world.campaign import MadeRun, World, draw_world, in_laboratory
from daq_app.gap.blind.world.contact.motion import require_engine
from daq_app.gap.blind.world.laboratories.numerics import Engine
from daq_app.gap.blind.world.laboratories.table import Laboratory, laboratory
from daq_app.workers import run_all

_EPOCH_UTC_NS: Final = 1_767_225_600 * 10**9
"""2026-01-01: campaigns start within the hundred days after it."""


@dataclass(frozen=True, slots=True)
class Order:
    """What is to be made."""

    seed: int
    out: Path
    labels: Path
    rig_texts: tuple[str, ...]
    """Rig files, letter by letter; the cases take turns."""
    n_runs: int = 6
    engine: Engine | None = None
    """None for the laboratory's own engines."""
    laboratory: str = "own"
    alone: str = ""
    """The one imperfection of the laboratory that is switched on; all if empty."""
    hidden: str = ""
    """The effect that every case hides, or `mix.NOTHING`; the mix if empty."""

    def place(self) -> Laboratory:
        """Raises `ValueError` for a laboratory or an imperfection that does not exist."""
        lab = laboratory(self.laboratory)
        return lab.alone(self.alone) if self.alone else lab

    def engine_of(self, index: int) -> Engine:
        """What moves the wall of case `index`."""
        engines = laboratory(self.laboratory).engines
        return self.engine or engines[index % len(engines)]


def case_name(index: int) -> str:
    """Folder name of case `index` (from 0)."""
    return f"{CASE_PREFIX}{index + 1:04d}"


def make_cases(
    order: Order, indices: Sequence[int], workers: int, done: Callable[[int, int], None] | None = None
) -> None:
    """Make the cases that are not there yet, on `workers` processes; `done` as `workers.run_all` calls it.

    A case that is sealed already is left alone, so that an interrupted making goes on where it stopped.
    Raises `ValueError` for labels within reach, `EngineMissing` where a contact engine is wanted.
    """
    check_apart(order.out, order.labels)
    order.place()
    if any(order.engine_of(index) == "contact" for index in indices):
        require_engine()
    todo = [index for index in indices if not (order.out / case_name(index) / SEAL_FILE).exists()]
    run_all(partial(make_case, order), todo, workers, done)


def check_apart(out: Path, labels: Path) -> None:
    """Raise `ValueError` if the labels would lie within reach, in the folder of the cases."""
    cases, kept = out.resolve(), labels.resolve()
    if kept == cases or cases in kept.parents:
        raise ValueError(f"the labels ({labels}) must not lie within the folder of the cases ({out})")


def make_case(order: Order, index: int) -> str:
    """Draw, write, label and seal one case; returns its name."""
    name = case_name(index)
    world, rig_text, rng = draw_case(order, index)
    start = _EPOCH_UTC_NS + int(rng.integers(100 * 86_400)) * 10**9
    made = write_case(order.out / name, name, world, rig_text, start)
    label = _label(name, order.seed, _category(order, index, world), world, made)
    seal_case(order.out / name, label, order.labels / f"{name}.json")
    return name


def draw_case(order: Order, index: int) -> tuple[World, str, np.random.Generator]:
    """The world of a case and the text of its rig file."""
    place, engine = order.place(), order.engine_of(index)
    rng = case_generator(order.seed, index)
    rig_text = order.rig_texts[index % len(order.rig_texts)]
    if place.rates_hz:
        rig_text = _sampled_at(rig_text, place.rates_hz[index // len(order.rig_texts) % len(place.rates_hz)])
    rig: Rig = parse_rig(rig_text, "rig file of the blind check")
    effects = (
        draw_named(order.hidden, rig, rng, engine)
        if order.hidden
        else draw_effects(order.seed, index, rig, rng, engine, place.wide)
    )
    world = draw_world(rig, effects, order.n_runs, rng, engine)
    return in_laboratory(world, place, order.seed, index), rig_text, rng


def _sampled_at(rig_text: str, rate_hz: float) -> str:
    """The rig file with another sampling rate."""
    return re.sub(r"(?m)^rate_hz = [\d.]+", f"rate_hz = {rate_hz:.1f}", rig_text, count=1)


def _category(order: Order, index: int, world: World) -> Category:
    if not order.hidden:
        return category_of(order.seed, index, order.place().wide)
    if not world.effects:
        return "null"
    return "single" if world.effects[0].kind == "library" else "outside"


def _label(name: str, seed: int, category: str, world: World, made: Sequence[MadeRun]) -> dict[str, Any]:
    wall, around = world.wall, world.surroundings
    return {
        "case": name,
        "seed": seed,
        "category": category,
        "engine": world.engine,
        "laboratory": around.laboratory,
        "imperfections": dict(around.sizes),
        "usual": [asdict(effect) for effect in world.usual],
        "numerics": asdict(around.numerics),
        "shock": asdict(around.shock),
        "effects": [
            {**asdict(e), "targets": list(e.targets), "accept": list(accepted_names(e.name))}
            for e in world.effects
        ],
        "detectability": [detectability(world, effect) for effect in world.effects],
        "wall": {**asdict(wall), "alpha": wall.alpha, "p": wall.p},
        "nominal": {"alpha": world.rig.specimen.alpha0_rad, "p": world.rig.specimen.p_rad_s},
        "runs": [
            {
                "test": run.plan.test,
                "theta0": run.plan.theta0,
                "release_s": run.plan.hold_s,
                "impacts": len(run.motion.impacts),
                "rest_s": run.plan.hold_s + run.motion.rest_s,
                "restitution": [impact.restitution for impact in run.motion.impacts],
            }
            for run in made
        ],
    }
