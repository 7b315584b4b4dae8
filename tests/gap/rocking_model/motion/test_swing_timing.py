"""How late accelerometers are, from the smooth motion between impacts."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.coefficients import block_coefficients
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import examine, extract
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)


def _delay(run: RockingRun, family: str) -> tuple[float, float]:
    block = next(b for b in run.blocks if b.family == family)
    return float(block.values[0]), float(block.covariance[0, 0]) ** 0.5


def _with_another_shock(runs: list[GapRun], late_s: float) -> list[GapRun]:
    """The same with 30 m/s² more for 6 ms along the jump of each impact, `late_s` after it."""
    for run in runs:
        seen = examine(run)
        start = run.channels.shape[1] - seen.run.channels.shape[1] + late_s * run.rate_hz
        grid, release_s = seen.features.grid, seen.features.swings.release_s
        for time, jump in zip(grid.impact_s, grid.jumps, strict=True):
            first = round(start + (time + release_s) * run.rate_hz)
            for i in run.indices("accelerometer", "x"):
                run.channels[i, first : first + round(0.006 * run.rate_hz)] += 30.0 * np.sign(jump)
    return runs


@pytest.mark.parametrize("tau", [0.0, 3e-3, 0.03])
def test_a_delay_is_read_between_impacts(tau: float) -> None:
    for run in simulate({"lag@accelerometer": {"tau": tau}} if tau else {}, LEVELS):
        seen, sd = _delay(extract(run), "swing timing")
        assert sd < 1e-3
        assert abs(seen - tau) < 3.0 * sd + 2e-4


def test_zeros_that_walk_leave_a_delay_as_well_known() -> None:
    (still,), (walking,) = (simulate({"lag@accelerometer": {"tau": 3e-3}}, LEVELS[:1]) for _ in range(2))
    sensors = walking.indices("accelerometer", "x")
    for place, size in zip(sensors, np.linspace(-0.2, 0.3, len(sensors)), strict=True):
        time = np.linspace(0.0, 1.0, walking.channels.shape[1])
        walking.channels[place] += size * (time + 2.0 * time**2 - 2.5 * time**3)
    sure = _delay(extract(still), "swing timing")[1]
    seen, sd = _delay(extract(walking), "swing timing")
    assert sd < 1.2 * sure
    assert abs(seen - 3e-3) < 3.0 * sd + 2e-4


def test_the_form_of_an_impact_is_no_delay_between_impacts() -> None:
    before = [extract(run) for run in simulate({}, LEVELS)]
    after = [extract(run) for run in _with_another_shock(simulate({}, LEVELS), 0.01)]
    for first, second in zip(before, after, strict=True):
        moved = _delay(second, "impact timing")[0] - _delay(first, "impact timing")[0]
        assert abs(moved) > 5e-4, "the impacts themselves look late"
        seen, sd = _delay(first, "swing timing")
        assert _delay(second, "swing timing")[0] == pytest.approx(seen, abs=0.2 * sd)


@pytest.mark.parametrize("tau", [0.02, 0.03])
def test_impacts_behind_a_slow_filter_come_equally_late_in_all_runs(tau: float) -> None:
    """Its response is longer than an impact and lopsided: what is largest of it is sooner than its middle."""
    runs = simulate({"filter_delay@accelerometer": {"tau": tau}}, (0.25, -0.35, 0.4))
    seen = [_delay(extract(run), "impact timing") for run in runs]
    assert np.ptp([delay for delay, _ in seen]) < 2e-3
    for delay, sd in seen:
        assert abs(delay - tau) < 3.0 * sd
    sharp = [_delay(extract(run), "impact timing")[1] for run in simulate({}, LEVELS)]
    assert max(sharp) < 1e-3


def test_an_accelerometer_that_disagrees_makes_the_delay_of_all_doubtful() -> None:
    (run,) = simulate({}, LEVELS[:1])
    low, high = (next(i for i, s in enumerate(run.sensors) if s.id == name) for name in ("AC-1", "AC-2"))
    assert run.sensors[low].position_m[2] < run.sensors[high].position_m[2]
    sound = _delay(extract(run), "swing timing")[1]
    run.channels[low] = np.roll(run.channels[low], round(0.01 * run.rate_hz))
    assert _delay(extract(run), "swing timing")[1] > 2.0 * sound


def test_late_accelerometers_are_told_from_impacts_of_another_form() -> None:
    """By the impacts alone 3 ms are within what nobody knows of their form."""
    runs = simulate({"lag@accelerometer": {"tau": 3e-3}}, LEVELS)
    model = RockingModel(extract(runs[0]).survey)
    run = extract(runs[1])
    usual = {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}
    late, none = (
        block_coefficients(run, {**usual, **more}) for more in ({"lag@accelerometer.tau": 3e-3}, {})
    )
    assert np.flatnonzero(late != none).size == 2, "what the impacts show and what the motion shows"
    result = diagnose_runs(runs, only=("lag@accelerometer", "restitution_slope"))
    assert result.decision.effects == ("lag@accelerometer",)
    (tau,) = [p for p in result.effect_parameters if p.name.endswith("tau")]
    assert tau.low < 3e-3 < tau.high
    # Some of it any amplifier has; both together are well known.
    usual_s = next(p.value for p in result.parameters if p.name == "late_accelerometer")
    assert tau.value + usual_s == pytest.approx(3e-3, abs=5e-4)
