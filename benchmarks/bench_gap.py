"""Cost of the gap diagnosis: features of a run, one prediction, a whole diagnosis with the full library."""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.figure import Figure
from daq_app.config import load_rig, plan_tasks
from daq_app.config.scaling import Scaling
from daq_app.gap.core import Options, fit
from daq_app.gap.rocking_model.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun, Sensor, Survey
from daq_app.gap.rocking_model.run_features import extract
from daq_app.gap.rocking_model.study import diagnose_runs
from sim_hardware.direct import synthesise_test

_RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_LEVELS = (0.15, -0.25, 0.35, -0.40)
_RUNS = 12


def _runs() -> list[GapRun]:
    rig = load_rig(_RIG)
    quick = {"upright_s": 0.5, "pull_s": 0.5, "hold_s": 1.2, "restitution_scatter": 0.004}
    rig = rig.model_copy(update={"simulation": rig.simulation.model_copy(update=quick)})
    plan = plan_tasks(rig)
    offsets = np.zeros(len(rig.channels))
    for task in plan.tasks:
        for planned in task.channels:
            offsets[planned.rig_index] = planned.time_offset_s
    runs = []
    for number in range(_RUNS):
        level = _LEVELS[number % len(_LEVELS)]
        test = synthesise_test(
            rig, plan, level, seed=number, effects={"viscous": {"zeta": 0.006}}, post_rest_s=1.0
        )
        runs.append(
            GapRun(
                f"{number}",
                f"L{abs(level):.2f}",
                test.rate_hz,
                tuple(Sensor.from_channel(c) for c in rig.channels),
                Scaling.of(rig.channels).to_si(test.readings),
                Survey.from_specimen(rig.specimen),
                offsets,
            )
        )
    return runs


def _median_ms(action: Callable[[], object], count: int) -> float:
    times = []
    for _ in range(count):
        start = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def figures() -> list[Figure]:
    """Measured on all cores of the machine."""
    runs = _runs()
    features = [extract(run) for run in runs]
    model = RockingModel(features[0].survey)
    found = fit(model, features[:2])
    values = {key: value for key, (value, _, _) in (found.values | found.local_values[0]).items()}
    step = iter(np.linspace(0.0, 1e-3, 100_000))

    def predict() -> None:
        # Another α every time, so that the remembered half-cycles are of no use.
        model.predict(features[0], {**values, "alpha": values["alpha"] * (1 + float(next(step)))})

    start = time.perf_counter()
    result = diagnose_runs(runs, Options(workers=os.cpu_count() or 1))
    seconds = time.perf_counter() - start
    named = " + ".join(result.which[0].effects) or "nothing missing"
    return [
        Figure("features of a run, 41 channels", _median_ms(lambda: extract(runs[0]), 5), "ms", 5),
        Figure(
            "prediction of a run, half-cycles and all channels", _median_ms(predict, 300), "ms", 300, aim=0.5
        ),
        Figure(
            f"diagnosis of {_RUNS} runs, full library, all channels",
            seconds,
            "s",
            1,
            aim=30.0,
            note=f"{os.cpu_count()} cores; {result.decision.verdict}: {named}",
        ),
    ]
