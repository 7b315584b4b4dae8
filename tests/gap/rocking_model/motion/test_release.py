"""The speed at the release is found with its sign, run by run, and a clean release claims none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core import fit
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.gap.simulated_campaign import simulate
from tests.support.simulated_wall import short_rig
from tests.support.simulated_wall import simulate as held_briefly

SPEED_RAD_S = 0.012


def _features(run: RockingRun) -> tuple[float, float]:
    block = next(b for b in run.blocks if b.family == "release")
    return float(block.values[0]), float(block.covariance[0, 0]) ** 0.5


def test_a_wall_thrown_up_and_one_pushed_down_are_told_apart() -> None:
    """Both fall through the held rotation alike; a fit of the times alone would know |ω₀| only."""
    up = simulate({"initial_velocity": {"omega": SPEED_RAD_S}}, 11, levels=(0.35,))
    down = simulate({"initial_velocity": {"omega": -SPEED_RAD_S}}, 12, levels=(-0.35,))
    runs, _ = prepare([*up, *down])
    for run, true in zip(runs, (SPEED_RAD_S, -SPEED_RAD_S), strict=True):
        found, sd = _features(run)
        assert found == pytest.approx(true, abs=3 * sd)
        assert sd < 0.3 * SPEED_RAD_S
    result = fit(RockingModel(runs[0].survey), runs, (rocking_library()["initial_velocity"],))
    common, _, _ = result.values["initial_velocity.omega"]
    for local, true in zip(result.local_values, (SPEED_RAD_S, -SPEED_RAD_S), strict=True):
        own, low, high = local["initial_velocity.own"]
        assert common + low < true < common + high
        assert common + own == pytest.approx(true, rel=0.15)


def test_pushes_of_one_hand_have_one_size() -> None:
    """Each test has its own push, and what they have in common is the effect's size."""
    runs, _ = prepare(simulate({"initial_velocity": {"omega": -SPEED_RAD_S}}, 12, levels=(-0.35, 0.25)))
    result = fit(RockingModel(runs[0].survey), runs, (rocking_library()["initial_velocity"],))
    _, low, high = result.values["initial_velocity.omega"]
    assert low < -SPEED_RAD_S < high < 0.0


def test_impacts_too_small_to_be_timed_are_counted_for_what_wears() -> None:
    """Files do not say how many impacts the wall has had, and half-cycles under 2 mrad are not timed."""
    runs = simulate({"crushing": {"loss": 0.02}}, 11, levels=(0.4, 0.2, 0.3))
    true = [run.impacts_before for run in runs]
    assert true[0] == 0.0 < true[1] < true[2]
    prepared, _ = prepare([replace(run, impacts_before=0.0) for run in runs])
    assert [run.impacts_before for run in prepared] == pytest.approx(true, rel=0.06)
    result = fit(RockingModel(prepared[0].survey), prepared, (rocking_library()["crushing"],))
    assert result.values["crushing.loss"][0] == pytest.approx(0.02, rel=0.06)


def test_a_wall_that_rises_further_on_its_other_side_is_let_go_where_it_was_held() -> None:
    """The side with the larger α holds more energy: let go there, the wall comes higher on the other."""
    (run,), _ = prepare(simulate({"alpha_asymmetry": {"delta": 0.03}}, 11, levels=(0.4,)))
    held, opposite = np.abs(run.swings.peak_rad[:2])
    assert opposite > 1.03 * held
    assert held == pytest.approx(0.4 * run.survey.alpha_rad, rel=0.02)
    assert run.swings.release_s > 1.0


def test_a_clean_or_a_slow_release_claims_no_speed() -> None:
    clean = simulate({}, 11, levels=(0.35,))
    slow = simulate({"slow_release": {"tau": 0.04}}, 12, levels=(0.25,))
    for run in prepare([*clean, *slow])[0]:
        found, sd = _features(run)
        assert abs(found) < 2.5 * sd
        assert sd > 1e-3


def test_how_evenly_a_wall_is_let_go_is_found() -> None:
    """A force that is paid out evenly does not die away: one form for all would leave milliseconds."""
    true = {"tau": 0.08, "even": 1.0}
    runs, _ = prepare(simulate({"slow_release": true}, 12, levels=(0.25, 0.4)))
    result = fit(RockingModel(runs[0].survey), runs, (rocking_library()["slow_release"],))
    for name, value in true.items():
        _, low, high = result.values[f"slow_release.{name}"]
        assert low <= value <= high, name
    assert result.values["slow_release.even"][1] > 0.5
    # What clean releases scatter by; with an exponential alone it grows to the 1.6 ms at which it is held.
    assert result.sigmas["scatter of releases"] < 8e-5


def test_a_cable_that_holds_on_is_found_beside_sensors_that_are_slow() -> None:
    """It grips at the same share of every pull: a free scatter of the releases takes up all that it does."""
    effects = ("slow_response@lvdt", "residual_cable")
    runs = []
    for place, level in enumerate((-0.15, -0.25, -0.35, -0.4, -0.405, -0.41)):
        held = abs(level) * short_rig().specimen.alpha0_rad
        given = {"slow_response@lvdt": {"tau": 0.008}, "residual_cable": {"k": 0.2, "slack": 0.6 * held}}
        (run,) = held_briefly(given, (level,))
        runs.append(replace(run, name=f"FR1-L{min(place, 3) + 1}-{place}", level=f"L{min(place, 3) + 1}"))
    found = diagnose_runs(runs, only=effects)
    assert set(found.decision.effects) == set(effects)
    stiffness = next(p for p in found.effect_parameters if p.name == "residual_cable.k")
    # Four prior sd from none: the prior alone draws it a thirtieth nearer.
    assert stiffness.value == pytest.approx(0.2, rel=0.1)
    assert stiffness.high - stiffness.low < 0.04
