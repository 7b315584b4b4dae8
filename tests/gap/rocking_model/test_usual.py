"""What any wall and rig has of some effects is no cause; more of it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core import Options, fit
from daq_app.gap.core.fitting.fit import effects_of
from daq_app.gap.core.result import NO_CAUSE
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.prediction.usual import of_bed
from daq_app.gap.rocking_model.prediction.vector import half_cycle_table, kernel_vector
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, model_and_library, prepare
from daq_app.gap.rocking_model.tolerances.sensors import STRAIGHTEST_LVDT
from sim_hardware.dynamics import parameters as par
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35, 0.4, -0.2)
USUAL = {
    "base_tilt": {"beta": 6e-4},
    "winkler": {"theta_c": 4e-7},
    "restitution_slope": {"k": 3e-3},
    "restitution_asymmetry": {"d": 3e-4},
    "filter_delay@lvdt": {"tau": 1.5e-3},
}


def test_a_bed_a_lean_and_late_amplifiers_are_parameters_of_any_wall() -> None:
    """Each comes out with its size: the springs and the tilt are the simulator's own effects."""
    runs, _ = prepare(simulate(USUAL, LEVELS))
    values = fit(RockingModel(runs[0].survey), runs).values
    assert values["bed"][0] ** 2 == pytest.approx(4e-7, rel=0.2)
    assert values["lean"][0] + values["uneven"][0] == pytest.approx(6e-4, abs=4e-4), (
        "the gains of the two faces feign some of it"
    )
    for name in ("late_wire", "late_accelerometer"):
        assert values[name][1] < -1.5e-3 < values[name][2], "the LVDTs are late, and time counts from them"


def test_a_bed_acts_as_the_root_of_its_first_uplift() -> None:
    """To first order: what 0.1 µrad does to times and speeds is √0.1 of what 1 µrad does."""
    run = prepare(simulate({}, LEVELS[:1]))[0][0]
    survey = run.survey
    block = {"alpha": survey.alpha_rad, "p": survey.p_rad_s, "half_base": survey.half_base_m, "omega0": 0.0}
    vector = kernel_vector(run, block | {"lean": 0.0, "uneven": 0.0})
    peaks, levels = run.swings.peak_rad, run.swings.levels
    stiff = half_cycle_table(run, vector, peaks, levels)
    vector[par.WINKLER] = 1e-7
    soft = half_cycle_table(run, vector, peaks, levels)
    large = np.abs(peaks) > 5e-3
    np.testing.assert_allclose(
        math.sqrt(1e-7) * of_bed(run)[large], (soft - stiff)[large], rtol=0.05, atol=2e-6
    )


@pytest.mark.heavy
@pytest.mark.timeout(600)
def test_what_any_wall_has_is_no_cause_and_is_told() -> None:
    decision = diagnose_runs(simulate(USUAL, LEVELS), Options(causes=1)).decision
    assert decision.verdict in NO_CAUSE, decision.sentence
    assert "usual" in decision.sentence


@pytest.mark.heavy
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("effect", "named"),
    [
        ({"base_tilt": {"beta": 2.5e-3}}, {"base_tilt", "eccentric_mass", "alpha_asymmetry"}),
        ({"winkler": {"theta_c": 3e-5}}, {"winkler"}),
        ({"restitution_slope": {"k": 0.03}}, {"restitution_slope"}),
        ({"filter_delay@lvdt": {"tau": 0.012}}, {"filter_delay@lvdt", "lag@lvdt"}),
    ],
)
def test_more_than_any_wall_has_is_a_cause(effect: dict[str, dict[str, float]], named: set[str]) -> None:
    decision = diagnose_runs(simulate(USUAL | effect, LEVELS, seed=2), Options(causes=1)).decision
    assert decision.verdict not in NO_CAUSE, decision.sentence
    assert decision.effects and set(decision.effects) <= named, decision.sentence


def not_straight(runs: list[GapRun], share: float) -> list[GapRun]:
    """The same runs, whose LVDTs read an S beside the opening, of about this share of their range.

    Those at x < 0 have half of that in common.
    """
    rng = np.random.default_rng(4)
    shares = {s.id: share * rng.standard_normal() for s in runs[0].sensors if s.family == "lvdt"}
    bent = []
    for run in runs:
        channels = run.channels.copy()
        for place in run.indices("lvdt"):
            sensor = run.sensors[place]
            low, high = sensor.range_si
            odd = shares[sensor.id] + (0.5 * share if sensor.position_m[0] < 0.0 else 0.0)
            channels[place] += (
                odd * (high - low) * np.sin(2.0 * math.pi * (channels[place] - low) / (high - low))
            )
        bent.append(replace(run, channels=channels))
    return bent


def test_lvdts_that_are_not_straight_are_no_spring() -> None:
    """Within a data sheet's 0.25 %: p and α stay, and no cable is seen."""
    runs, _ = prepare(not_straight(simulate({}, (0.25, -0.35, 0.4, -0.2)), 1e-3))
    assert 1e-3 < runs[0].lvdt_curves < 4e-3
    model, library = model_and_library(runs)
    found = fit(model, runs)
    for name, true in (("alpha", runs[0].survey.alpha_rad), ("p", runs[0].survey.p_rad_s)):
        value, low, high = found.values[name]
        assert low < true < high, (name, value, low, high)
    held = fit(model, runs, effects_of(("residual_cable",), library))
    assert held.log_evidence < found.log_evidence + 3.0


def test_straight_lvdts_are_known_to_be_straight() -> None:
    runs, _ = prepare(simulate({}, (0.25, -0.35)))
    assert {run.lvdt_curves for run in runs} == {STRAIGHTEST_LVDT}
