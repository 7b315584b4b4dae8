"""A diagnosis goes through its stages once: no run is examined again because somebody asks for it again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np
import pytest

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.run_cache import RunCache
from daq_app.gap.rocking_model.study import prepare
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35, 0.3, -0.2)


@dataclass(frozen=True, slots=True)
class CountedRun(GapRun):
    """A run that counts how often each of its channels is read, over all stages that are made from it."""

    readings: Counter[str] = field(default_factory=Counter)

    def aligned(self, index: int) -> FloatArray:
        self.readings[self.sensors[index].id] += 1
        return GapRun.aligned(self, index)


@pytest.fixture(scope="module")
def runs() -> list[GapRun]:
    return simulate({}, LEVELS)


def _counted(run: GapRun) -> CountedRun:
    return CountedRun(**{f.name: getattr(run, f.name) for f in fields(GapRun) if f.init})


def test_each_stage_reads_the_channels_of_four_runs_once(runs: list[GapRun]) -> None:
    """Wiring, ranges, joint and features each read a channel; a second examination reads all again."""
    counted = [_counted(run) for run in runs]
    prepare(counted)
    for run in counted:
        assert max(run.readings.values()) <= 12
        assert run.readings.total() <= 9 * len(run.sensors)


def test_a_part_of_a_prediction_is_worked_out_again_only_for_values_that_it_asks_for() -> None:
    cache, made = RunCache(), Counter[str]()

    def swings(values: Mapping[str, float]) -> float:
        made["swings"] += 1
        return values["alpha"] + values.get("viscous.zeta", 0.0)

    given = {"alpha": 0.2, "gain": 0.01}
    for changed in ({}, {"gain": 0.02}, {"alpha": 0.21}, {"gain": 0.03}, {"viscous.zeta": 0.1}):
        given |= changed
        assert cache.part("swings", given, swings) == given["alpha"] + given.get("viscous.zeta", 0.0)
    assert made["swings"] == 3


def test_a_part_within_a_part_counts_for_both() -> None:
    cache = RunCache()

    def outer(values: Mapping[str, float]) -> float:
        return 2.0 * cache.part("inner", values, lambda inner: inner["p"])

    assert [cache.part("outer", {"p": p, "other": k}, outer) for p, k in ((1.0, 0), (1.0, 1), (3.0, 1))] == [
        2.0,
        2.0,
        6.0,
    ]


def test_what_a_fit_asked_before_does_not_change_what_it_is_told(runs: list[GapRun]) -> None:
    """Predictions from a full cache are those from an empty one."""
    run = prepare(runs[:1])[0][0]
    model = RockingModel(run.survey)
    values = {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}
    before = model.predict(run, values).features
    for name in values:
        model.predict(run, {**values, name: values[name] + 1e-4})
    fresh = prepare(runs[:1])[0][0]
    moved = {**values, "p": values["p"] * 1.001, "cal_wire": 1e-3}
    np.testing.assert_array_equal(model.predict(run, values).features, before)
    np.testing.assert_array_equal(model.predict(run, moved).features, model.predict(fresh, moved).features)
