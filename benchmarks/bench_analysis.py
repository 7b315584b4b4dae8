"""Analysis of rocking tests: cost online and offline, and how near to the truth r comes."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

import numpy as np

from benchmarks.support.effort import Effort
from benchmarks.support.figure import Figure
from daq_app.config import Rig, Scaling, TaskPlan, load_rig, plan_tasks
from daq_app.rocking import AnalysisOptions, LiveAnalyser, TestAnalysis, TestRecord, analyse_record
from daq_app.rocking.live import Estimate
from sim_hardware.direct import SynthesisedTest, synthesise_test

RIG = Path(__file__).parents[1] / "configs" / "fr1.toml"
_BLOCK = 400
_RECORD_S = 20.0
_RUNS = 5
_LEVELS = (("L1", 0.15, 0.01), ("L2", 0.25, 0.003), ("L3", 0.35, 0.003), ("L4", 0.40, 0.003))
"""Name, φ, and the largest error of r that is aimed at."""
_RESTITUTIONS = (0.82, 0.86, 0.895, 0.93, 0.95)


def _tare(rig: Rig, test: SynthesisedTest) -> dict[str, float]:
    means = test.readings[:, : test.upright_samples].mean(axis=1)
    return {c.id: float(mean - c.offset) for c, mean in zip(rig.channels, means, strict=True)}


def _record(rig: Rig, plan: TaskPlan, test: SynthesisedTest) -> TestRecord:
    offsets = {c.channel.id: c.time_offset_s for task in plan.tasks for c in task.channels}
    si = Scaling.of(rig.channels, _tare(rig, test)).to_si(test.readings)
    return TestRecord.from_array(rig, test.rate_hz, si, time_offsets_s=offsets)


def live(rig: Rig, test: SynthesisedTest) -> tuple[float, Estimate]:
    """Processor seconds per second of data, and the last estimate."""
    blocks = [
        np.ascontiguousarray(test.readings[:, start : start + _BLOCK])
        for start in range(0, test.readings.shape[1], _BLOCK)
    ]
    analyser = LiveAnalyser(rig, test.rate_hz, _tare(rig, test))
    estimate: Estimate | None = None
    begun = time.process_time()
    for index, block in enumerate(blocks):
        estimate = analyser.process(index * _BLOCK, block).estimate or estimate
    used = time.process_time() - begun
    assert estimate is not None
    return used * test.rate_hz / test.readings.shape[1], estimate


def offline(record: TestRecord, options: AnalysisOptions) -> tuple[float, TestAnalysis]:
    """Wall-clock seconds of one analysis, and the analysis."""
    begun = time.perf_counter()
    analysis = analyse_record(record, options)
    return time.perf_counter() - begun, analysis


def _accuracy(rig: Rig, plan: TaskPlan, effort: Effort) -> list[Figure]:
    """Largest |error| of r over r = 0.82 … 0.95, both estimators, online and offline."""
    figures = []
    restitutions = effort.of(_RESTITUTIONS, _RESTITUTIONS[:1])
    for name, phi, aim in effort.of(_LEVELS, _LEVELS[:1]):
        online, after, theta0 = [0.0], [0.0], [0.0]
        for seed, r in enumerate(restitutions):
            test = synthesise_test(rig, plan, phi if seed % 2 else -phi, seed, restitution=r)
            _, estimate = live(rig, test)
            analysis = analyse_record(_record(rig, plan, test), AnalysisOptions(bias_runs=0, fit=False))
            online += [abs((found.r or np.inf) - r) for found in (estimate.eav, estimate.crt)]
            after += [abs((analysis.estimates[key].r or np.inf) - r) for key in ("eav", "crt")]
            truth = test.truth["theta0_rad"]
            assert isinstance(truth, float)
            theta0.append(abs(estimate.theta0_rad - truth) / rig.specimen.alpha0_rad)
        note = "largest of r = 0.82 … 0.95, both sides, EAV and CRT"
        runs = 2 * len(restitutions)
        figures.append(Figure(f"error of r online, {name}", max(online), "", runs, aim, note=note))
        figures.append(Figure(f"error of r offline, {name}", max(after), "", runs, aim, note=note))
        figures.append(Figure(f"error of θ0/α, {name}", max(theta0), "", len(restitutions), 0.005))
    return figures


def figures(effort: Effort) -> list[Figure]:
    """All figures of the analysis."""
    rig = load_rig(RIG)
    plan = plan_tasks(rig)
    runs = effort.of(_RUNS, 1)
    test = synthesise_test(rig, plan, 0.35, 1, restitution=0.895)
    extra = max(
        0.5, effort.of(_RECORD_S, 0.0) - test.readings.shape[1] / test.rate_hz + rig.acquisition.post_rest_s
    )
    test = synthesise_test(rig, plan, 0.35, 1, restitution=0.895, post_rest_s=extra)
    seconds = test.readings.shape[1] / test.rate_hz
    live(rig, test)  # first calls import and compile
    online = [live(rig, test)[0] for _ in range(runs)]
    record = _record(rig, plan, test)
    whole = [offline(record, AnalysisOptions())[0] for _ in range(runs)]
    bare = [offline(record, AnalysisOptions(bias_runs=0, keep_series=False))[0] for _ in range(runs)]
    begun = time.process_time()
    offline(record, AnalysisOptions())
    processor = time.process_time() - begun
    note = f"41 × 4000 Hz, L3, {seconds:.0f} s"
    return [
        Figure(
            "online analysis, share of a core", 100 * statistics.median(online), "%", runs, 3.0, note=note
        ),
        Figure("analysis of a 20 s run", statistics.median(whole), "s", runs, 0.3, note=note + ", with bias"),
        Figure("processor time of it", processor, "s", note="one run; BLAS threads included"),
        Figure("the same without simulated bias", statistics.median(bare), "s", runs, 1.0),
        *_accuracy(rig, plan, effort),
    ]
