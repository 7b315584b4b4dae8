"""Readings that go in steps: how far wrong what is read from them may be, and what can still be read."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.config.rig import Family
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.simulated_wall import simulate

LEVELS = (0.2, -0.28, 0.36)


def _in_steps(runs: list[GapRun], family: Family, step: float, zero: float) -> list[GapRun]:
    """The runs with a family's readings rounded, from a zero so many steps beside a whole one."""
    for run in runs:
        for i in run.indices(family):
            rest = run.channels[i, -600:].mean()
            run.channels[i] = np.round((run.channels[i] - rest) / step + zero) * step
    return runs


def _read(run: RockingRun) -> tuple[FloatArray, FloatArray]:
    """(values, sd) of what is read from wires against LVDTs."""
    blocks = [b for b in run.blocks if b.family in ("wire", "base")]
    values = np.concatenate([b.values for b in blocks])
    return values, np.sqrt(np.concatenate([np.diag(b.covariance) for b in blocks]))


@pytest.mark.parametrize("zero", [-0.4, 0.0, 0.2])
def test_steps_make_errors_of_the_size_that_is_allowed_for(zero: float) -> None:
    exact = prepare(simulate({}, LEVELS))[0]
    coarse = prepare(_in_steps(simulate({}, LEVELS), "wire", 3.7e-3, zero))[0]
    off = []
    for a, b in zip(exact, coarse, strict=True):
        (sound, _), (stepped, sd) = _read(a), _read(b)
        off.append((stepped - sound) / sd)
    assert np.abs(off).max() < 3.5
    # No more than is needed: what is told nothing is not known.
    assert 0.2 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_wall_that_slides_is_seen_by_wires_in_steps() -> None:
    runs = _in_steps(simulate({"sliding": {"c": 0.006}}), "wire", 3.7e-3, 0.0)
    found = diagnose_runs(runs)
    assert set(found.decision.effects) == {"quantisation@wire", "sliding"}
    slid = next(p for p in found.effect_parameters if p.name == "sliding.c")
    assert slid.value == pytest.approx(0.006, abs=0.0015)
