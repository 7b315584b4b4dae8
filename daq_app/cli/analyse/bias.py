"""Bias of the methods over the whole chain: simulated wall, sensors, converters, analysis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from daq_app.config import Rig, Scaling, plan_tasks

if TYPE_CHECKING:
    from daq_app.rocking import RestitutionEstimate, TestAnalysis


def with_whole_chain_bias(analysis: TestAnalysis, rig: Rig, runs: int) -> TestAnalysis:
    """The analysis with the bias found on `runs` simulated tests of its amplitude, side and r.

    Unlike the bias that comes with an analysis (rotation and its noise only), these tests go through
    every sensor of the rig and the converters, with the tare taken as before a test. The simulated
    wall is the ideal one: no scatter of r, no effects.
    """
    from daq_app.rocking import AnalysisOptions, TestRecord, analyse_record
    from daq_app.rocking.analysis.bias import bias_by
    from sim_hardware.direct import synthesise_test

    values = [
        e.r for key in ("eav", "crt") if (e := analysis.estimates.get(key)) is not None and e.r is not None
    ]
    if not values or runs < 1:
        return analysis
    r = min(sum(values) / len(values), 0.999)
    ideal = rig.simulation.model_copy(
        update={"restitution_scatter": 0.0, "theta0_scatter": 0.0, "effects": {}, "semi_rigid": False}
    )
    rig = rig.model_copy(update={"simulation": ideal})
    plan = plan_tasks(rig)
    offsets = {c.channel.id: c.time_offset_s for task in plan.tasks for c in task.channels}

    def analyse(seed: int) -> Mapping[str, RestitutionEstimate]:
        test = synthesise_test(rig, plan, analysis.side * analysis.theta0_over_alpha, seed, restitution=r)
        means = test.readings[:, : test.upright_samples].mean(axis=1)
        tare = {c.id: float(mean - c.offset) for c, mean in zip(rig.channels, means, strict=True)}
        si = Scaling.of(rig.channels, tare).to_si(test.readings)
        record = TestRecord.from_array(rig, test.rate_hz, si, time_offsets_s=offsets)
        options = AnalysisOptions(fit=False, bias_runs=0, keep_series=False)
        return analyse_record(record, options).estimates

    return replace(analysis, bias={**analysis.bias, **bias_by(analyse, r, runs)})
