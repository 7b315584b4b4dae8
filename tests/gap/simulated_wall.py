"""Runs of the shipped rig from the simulated hardware, in memory and without real time."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from daq_app.config import load_rig, plan_tasks
from daq_app.config.rig import Rig
from daq_app.config.scaling import Scaling
from daq_app.gap.rocking_model.records import GapRun, Sensor, Survey
from sim_hardware.direct import synthesise_test

RIG = Path(__file__).parents[2] / "configs" / "fr1.toml"
LEVELS = (0.15, -0.25, 0.35, 0.40, -0.15, 0.25)


@cache
def short_rig() -> Rig:
    """The shipped rig with a short wait before the release and with scatter of r."""
    rig = load_rig(RIG)
    quick = {"upright_s": 0.5, "pull_s": 0.5, "hold_s": 1.2, "restitution_scatter": 0.004, "restitution": 0.9}
    return rig.model_copy(update={"simulation": rig.simulation.model_copy(update=quick)})


def simulate(
    effects: dict[str, dict[str, float]], levels: tuple[float, ...] = LEVELS, seed: int = 1
) -> list[GapRun]:
    """One run per level with calibration errors of 0.2 % besides `effects`."""
    rig = short_rig()
    plan = plan_tasks(rig)
    runs = []
    impacts = 0
    calibration = 0.002 * np.random.default_rng(seed).standard_normal(len(rig.channels))
    for number, level in enumerate(levels):
        test = synthesise_test(
            rig,
            plan,
            level,
            seed=seed * 100 + number,
            effects=effects,
            impacts_before=impacts,
            post_rest_s=1.0,
        )
        si = Scaling.of(rig.channels).to_si(test.readings) * (1.0 + calibration[:, None])
        offsets = np.zeros(len(rig.channels))
        for task in plan.tasks:
            for planned in task.channels:
                offsets[planned.rig_index] = planned.time_offset_s
        runs.append(
            GapRun(
                f"{number}",
                f"L{abs(level):.2f}",
                test.rate_hz,
                tuple(Sensor.from_channel(c) for c in rig.channels),
                si,
                Survey.from_specimen(rig.specimen),
                offsets,
                float(impacts),
            )
        )
        impacts += len(test.truth["impact_time_s"])  # type: ignore[arg-type]
    return runs
