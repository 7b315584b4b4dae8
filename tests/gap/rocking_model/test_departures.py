"""Departures of the rocking model: what they predict, and what they say of a loss that is not viscous."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.core import Library, Options, fit
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.parallel import Workers
from daq_app.gap.core.judging.hypotheses import Hypotheses
from daq_app.gap.core.judging.other_forms import FreeForm
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.rocking_model.prediction.free_forms import with_uneven_loss
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.prediction.vector import half_cycle_table, kernel_vector, restitution_of
from daq_app.gap.rocking_model.study import prepare
from sim_hardware.dynamics import parameters as par
from tests.support.simulated_wall import simulate

LEVELS = (0.15, -0.25, 0.35, -0.40)
LIBRARY: Library = rocking_library()


def forms_on_top(effects: dict[str, dict[str, float]], name: str) -> list[FreeForm]:
    """Free forms on top of an effect that is taken for what is hidden in simulated runs."""
    runs = tuple(prepare(simulate(effects, LEVELS))[0])
    model = RockingModel(runs[0].survey)
    null = fit(model, runs)
    experiment = Experiment.of(model, runs)
    with Workers(experiment) as workers:
        study = Hypotheses(experiment, LIBRARY, Options(), workers)
        study.fits = {(): null, (name,): fit(model, runs, (LIBRARY[name],), null.known())}
        return study.free_forms((name,))


def test_a_drag_with_the_square_of_the_speed_is_steeper_than_viscous_damping() -> None:
    """The verdict's chance is small, and the departure says which way the loss differs."""
    forms = forms_on_top({"quadratic_drag": {"c": 0.1}}, "viscous")
    chances = {form.equation.partition(":")[0]: form.p_value for form in forms}
    assert max(form.excess for form in forms) > 6.0
    assert chances["loss steeper than ω"] < 2e-4
    assert chances["loss + damping that grows as ln φ"] < 0.02
    assert chances["loss + damping of either side's own, ± ζ"] > 0.1


def test_viscous_damping_does_not_depart_from_itself() -> None:
    assert max(form.excess for form in forms_on_top({"viscous": {"zeta": 0.006}}, "viscous")) < 3.0


@pytest.fixture(scope="module")
def run() -> RockingRun:
    return prepare(simulate({}, LEVELS[1:2]))[0][0]


def test_a_loss_of_either_side_is_damping_on_one_and_a_push_on_the_other(run: RockingRun) -> None:
    values = {
        p.name: p.mean
        for p in (*RockingModel(run.survey).nuisance, *RockingModel(run.survey).local_nuisance(run))
    }
    vector = kernel_vector(run, values)
    true, levels = run.swings.peak_rad, run.swings.levels
    plain = half_cycle_table(run, vector, true, levels)
    damped = vector.copy()
    damped[par.ZETA] = 1e-3
    known = half_cycle_table(run, damped, true, levels) - plain
    found = with_uneven_loss(run, {"loss_side.zeta": 1e-3}, vector, true, levels, plain) - plain
    np.testing.assert_allclose(found[true > 0], known[true > 0], rtol=0.03, atol=1e-8)
    np.testing.assert_allclose(found[true < 0], -known[true < 0], rtol=0.03, atol=1e-8)
    grown = with_uneven_loss(run, {"loss_growth.zeta": 1e-3}, vector, true, levels, plain) - plain
    share = np.log(np.abs(true) / (0.1 * run.survey.alpha_rad))
    np.testing.assert_allclose(grown, share[:, None] * known, rtol=0.03, atol=1e-8)


def test_a_curvature_of_r_is_neither_a_level_nor_a_slope_of_it(run: RockingRun) -> None:
    middle = 0.36 * run.survey.p_rad_s * run.survey.alpha_rad
    speeds = middle * np.array([1.0, 1.001, 0.5, 2.0])
    order = np.zeros(4, dtype=np.intp)

    def added(name: str) -> np.ndarray:
        found = restitution_of(run, {"r": 0.9, name: 0.1}, speeds, np.ones(4), order) - 0.9
        return np.asarray(found)

    for name in ("slope_power.c", "slope_square.c"):
        level, beside, slow, fast = added(name)
        assert abs(level) < 1e-12
        assert abs(beside) < 1e-6 * middle
        assert min(slow, fast) > 1e-4
    assert added("slope_square.c")[3] == pytest.approx(0.1 * middle**2)
    assert added("slope_power.c")[3] == pytest.approx(0.1 * middle * (2 * np.log(2.0) - 1.0))
