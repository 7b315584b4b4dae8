"""Accelerometers along z: one that is off is found; what the wall or all of them do is no fault of one."""

from __future__ import annotations

import pytest

from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.inspect_runs import found_channels
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.simulated_wall import simulate

LEVELS = (-0.35, 0.3)
ALL = tuple(f"AC-{k}" for k in range(1, 9))


def _scaled(factors: dict[str, float], effects: dict[str, dict[str, float]] | None = None) -> list[GapRun]:
    runs = simulate(effects or {}, LEVELS)
    for run in runs:
        for i, sensor in enumerate(run.sensors):
            run.channels[i] *= factors.get(sensor.id, 1.0)
    return runs


def test_a_gain_of_one_accelerometer_along_z_is_likeliest_on_two_runs() -> None:
    """It shows once in each run, so that two runs leave a chance to the model's own discrepancy there."""
    result = diagnose_runs(
        _scaled({"AC-7": 1.06}), only=("gain@AC-7", "drift@AC-7", "gain@accelerometer", "pivot_shift")
    )
    assert result.best == ("gain@AC-7",)
    assert result.which[0].probability > 0.7
    (size,) = (e for e in result.effect_parameters if e.name == "gain@AC-7.error")
    assert size.low < 0.06 < size.high
    assert size.high - size.low < 0.06


@pytest.mark.parametrize(
    ("factors", "effects"),
    [
        ({}, {}),
        (dict.fromkeys(ALL, 1.06), {}),
        # As if the wall stood on other edges than those of the survey.
        ({"AC-7": 1.06, "AC-8": 1.06}, {}),
        ({}, {"pivot_shift": {"a": 0.03}}),
    ],
)
def test_what_all_of_them_show_is_no_fault_of_one(
    factors: dict[str, float], effects: dict[str, dict[str, float]]
) -> None:
    prepared, _ = prepare(_scaled(factors, effects))
    assert found_channels(prepared) == {}


@pytest.mark.parametrize("late_s", [0.004, 0.03])
def test_a_delay_of_all_of_them_is_no_fault_of_one(late_s: float) -> None:
    runs = simulate({}, LEVELS)
    for run in runs:
        late = round(late_s * run.rate_hz)
        for i in run.indices("accelerometer"):
            run.channels[i, late:] = run.channels[i, :-late].copy()
    prepared, _ = prepare(runs)
    assert found_channels(prepared) == {}


def test_one_along_z_and_one_along_x_are_examined_one_by_one() -> None:
    prepared, _ = prepare(_scaled({"AC-8": 0.93, "AC-3": 1.07}))
    assert found_channels(prepared) == {"AC-3": "accelerometer", "AC-8": "accelerometer"}
    assert findings_of(prepared) == ()
