"""Cost of the gap diagnosis: a run's features, one prediction, whole diagnoses, and how they grow."""

from __future__ import annotations

import os
import resource
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.bench_simulation import SCIPY_RUNS, TRAJECTORIES, least_s, scipy_run, trajectory_s
from benchmarks.support.byte_code import byte_code_of
from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.config import load_rig, plan_tasks
from daq_app.config.scaling import Scaling
from daq_app.gap.core import Options, diagnose, fit
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import extract
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun, Sensor, Survey
from daq_app.gap.rocking_model.run_cache import RunCache
from daq_app.gap.rocking_model.study import diagnose_runs, model_and_library, prepare
from sim_hardware.direct import synthesise_test

_RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_LEVELS = (0.15, -0.25, 0.35, -0.40)
_RUNS = 12
_DIAGNOSES = 3
_GROWTH = ((3, 1.0), (6, 1.0), (12, 1.0), (6, 0.25), (6, 0.5))
"""Diagnoses that show how the cost grows: number of runs, share of the library."""


def _runs(count: int) -> list[GapRun]:
    rig = load_rig(_RIG)
    quick = {"upright_s": 0.5, "pull_s": 0.5, "hold_s": 1.2, "restitution_scatter": 0.004}
    rig = rig.model_copy(update={"simulation": rig.simulation.model_copy(update=quick)})
    plan = plan_tasks(rig)
    offsets = np.zeros(len(rig.channels))
    for task in plan.tasks:
        for planned in task.channels:
            offsets[planned.rig_index] = planned.time_offset_s
    runs = []
    for number in range(count):
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


def _growth(prepared: list[RockingRun], diagnoses: Sequence[tuple[int, float]]) -> list[Figure]:
    """Fits of a diagnosis in processor time of one core: by number of runs, and by size of the library."""
    model, library = model_and_library(prepared)
    names = [effect.name for effect in library.named]
    found = []
    for runs, share in diagnoses:
        kept = library.without(*names[round(share * len(names)) :])
        fresh = [replace(run, cache=RunCache()) for run in prepared[:runs]]
        start = time.process_time()
        diagnose(model, fresh, kept, Options(workers=1))
        spent = time.process_time() - start
        effects = len(kept.named)
        found.append(Figure(f"fits of {runs} runs, {effects} effects", spent, "s of one core", 1))
    return found


def figures(effort: Effort) -> list[Figure]:
    """Measured on all cores of the machine."""
    count, diagnoses = effort.of(_RUNS, 3), effort.of(_DIAGNOSES, 2)
    considered = effort.of((), ("viscous",))
    runs = _runs(count)
    features = [extract(run) for run in runs[:2]]
    model = RockingModel(features[0].survey)
    found = fit(model, features)
    values = {key: value for key, (value, _, _) in (found.values | found.local_values[0]).items()}
    step = iter(np.linspace(0.0, 1e-3, 100_000))

    def predict() -> None:
        # Another α every time, so that the remembered half-cycles are of no use.
        model.predict(features[0], {**values, "alpha": values["alpha"] * (1 + float(next(step)))})

    cores = os.cpu_count() or 1
    times = []
    with byte_code_of("daq_app.gap.rocking_model.study"):
        for _ in range(diagnoses):
            start = time.perf_counter()
            result = diagnose_runs(runs, Options(workers=cores), considered)
            times.append(time.perf_counter() - start)
    memory = [
        resource.getrusage(who).ru_maxrss / 1e3 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    ]
    named = " + ".join(result.best) or "nothing missing"
    repetitions, scipy_runs = effort.of(TRAJECTORIES, 1), effort.of(SCIPY_RUNS, 1)
    slow, fast = trajectory_s(200.0, repetitions), trajectory_s(4000.0, repetitions)
    scipy_s = least_s(lambda: scipy_run(1e-9, 200.0, 55), scipy_runs)
    return [
        Figure("features of a run, 41 channels", _median_ms(lambda: extract(runs[0]), 5), "ms", 5),
        Figure(
            "prediction of a run, half-cycles and all channels", _median_ms(predict, 300), "ms", 300, aim=0.5
        ),
        Figure("10 s simulated, θ at 200 Hz", slow * 1e3, "ms", repetitions, aim=0.1, note="least"),
        Figure("10 s simulated, θ at 4 kHz", fast * 1e3, "ms", repetitions, aim=0.5, note="least"),
        Figure(
            "solve_ivp with events / this simulator",
            scipy_s / slow,
            "×",
            scipy_runs,
            note="DOP853, rtol 1e-9, 200 Hz",
        ),
        Figure(
            f"diagnosis of {count} runs, full library, all channels",
            times[0],
            "s",
            1,
            aim=5.0,
            note=f"{cores} cores, features and start of all included; {result.decision.verdict}: {named}",
        ),
        Figure("the same once more, processes there", statistics.median(times[1:]), "s", diagnoses - 1),
        Figure(
            "largest memory of the process that leads", memory[0], "MB", 1, note=f"{count} runs in memory"
        ),
        Figure("largest memory of a process that fits", memory[1], "MB", 1),
        *_growth(prepare(runs)[0], effort.of(_GROWTH, ((3, 0.05),))),
    ]
