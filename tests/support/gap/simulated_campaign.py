"""Six tests of the simulated wall over the levels, in memory, for the studies of the gap diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from daq_app.config import load_rig, plan_tasks
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.gap.rocking_model.records import GapRun, Sensor, Survey
from sim_hardware.direct import synthesise_test

RIG = Path(__file__).parents[3] / "configs" / "fr1.toml"
LEVELS = (0.15, -0.25, 0.35, 0.40, -0.15, 0.25)
CALIBRATION = 0.002
SCATTER_OF_R = 0.004
Effects = Mapping[str, Mapping[str, float]]


@cache
def quick_rig(path: Path = RIG) -> Rig:
    """A rig with a short wait before the release, and with scatter of r where the file has none.

    The wait is long enough for the sway of the pull to die away: a release is judged against it.
    """
    rig = load_rig(path)
    quick: dict[str, float] = {"upright_s": 0.5, "pull_s": 0.5, "hold_s": 3.6}
    if not rig.simulation.restitution_scatter:
        quick["restitution_scatter"] = SCATTER_OF_R
    return rig.model_copy(update={"simulation": rig.simulation.model_copy(update=quick)})


def simulate(
    effects: Effects, seed: int, path: Path = RIG, levels: tuple[float, ...] = LEVELS, *, survey: Path = RIG
) -> list[GapRun]:
    """One run per level of the rig file `path`, as seen by a diagnosis that believes the file `survey`."""
    return campaign(quick_rig(path), quick_rig(survey), effects, seed, levels)


def campaign(
    rig: Rig,
    believed: Rig,
    effects: Effects,
    seed: int,
    levels: tuple[float, ...] = LEVELS,
    post_rest_s: float = 1.2,
) -> list[GapRun]:
    """One run per level: scatter of r, noise, calibration errors of 0.2 %, impacts counted through."""
    plan = plan_tasks(rig)
    offsets = np.zeros(len(rig.channels))
    for task in plan.tasks:
        for planned in task.channels:
            offsets[planned.rig_index] = planned.time_offset_s
    calibration = CALIBRATION * np.random.default_rng(seed).standard_normal(len(rig.channels))
    runs: list[GapRun] = []
    impacts = 0
    for number, level in enumerate(levels):
        test = synthesise_test(
            rig,
            plan,
            level,
            seed=seed * 100 + number,
            effects=effects,
            impacts_before=impacts,
            post_rest_s=post_rest_s,
        )
        runs.append(
            GapRun(
                f"{number}",
                f"L{abs(level):.2f}",
                test.rate_hz,
                tuple(Sensor.from_channel(c) for c in believed.channels),
                Scaling.of(rig.channels).to_si(test.readings) * (1.0 + calibration[:, None]),
                Survey.from_specimen(believed.specimen),
                offsets,
                float(impacts),
            )
        )
        impacts += len(test.truth["impact_time_s"])  # type: ignore[arg-type]
    return runs
