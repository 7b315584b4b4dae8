"""Make the cases of a blind check: worlds drawn from a seed, written, labelled and sealed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.config import Rig, parse_rig
from daq_app.gap.blind.layout import CASE_PREFIX, SEAL_FILE
from daq_app.gap.blind.making.case_files import write_case
from daq_app.gap.blind.making.detectability import detectability
from daq_app.gap.blind.making.mix import case_generator, category_of, draw_effects
from daq_app.gap.blind.names import accepted_names
from daq_app.gap.blind.seal import seal_case
from daq_app.gap.blind.world.campaign import MadeRun, World, draw_world
from daq_app.gap.blind.world.contact.motion import require_engine
from daq_app.gap.blind.world.course import Engine

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
    engine: Engine = "events"


def case_name(index: int) -> str:
    """Folder name of case `index` (from 0)."""
    return f"{CASE_PREFIX}{index + 1:04d}"


def make_cases(order: Order, indices: Sequence[int], workers: int) -> Iterator[str]:
    """Make the cases that are not there yet, on `workers` processes; yields names as they are done.

    A case that is sealed already is left alone, so that an interrupted making goes on where it stopped.
    Raises `ValueError` for labels within reach, `EngineMissing` where a contact engine is wanted.
    """
    check_apart(order.out, order.labels)
    if order.engine == "contact":
        require_engine()
    todo = [index for index in indices if not (order.out / case_name(index) / SEAL_FILE).exists()]
    if workers <= 1:
        for index in todo:
            yield make_case(order, index)
        return
    # spawn on every platform: a forked child of a program with threads may hang.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = [pool.submit(make_case, order, index) for index in todo]
        try:
            for job in as_completed(jobs):
                yield job.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


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
    label = _label(name, order.seed, category_of(order.seed, index), world, made)
    seal_case(order.out / name, label, order.labels / f"{name}.json")
    return name


def draw_case(order: Order, index: int) -> tuple[World, str, np.random.Generator]:
    """The world of a case and the text of its rig file."""
    rig_text = order.rig_texts[index % len(order.rig_texts)]
    rig: Rig = parse_rig(rig_text, "rig file of the blind check")
    rng = case_generator(order.seed, index)
    effects = draw_effects(order.seed, index, rig, rng, order.engine)
    return draw_world(rig, effects, order.n_runs, rng, order.engine), rig_text, rng


def _label(name: str, seed: int, category: str, world: World, made: Sequence[MadeRun]) -> dict[str, Any]:
    wall = world.wall
    return {
        "case": name,
        "seed": seed,
        "category": category,
        "engine": world.engine,
        "effects": [
            {**asdict(e), "targets": list(e.targets), "accept": list(accepted_names(e.name))}
            for e in world.effects
        ],
        "detectability": [detectability(world, effect) for effect in world.effects],
        "wall": {**asdict(wall), "alpha": wall.alpha, "p": wall.p},
        "nominal": {
            "alpha": world.rig.specimen.alpha0_rad,
            "p": world.rig.specimen.p_rad_s,
        },
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
