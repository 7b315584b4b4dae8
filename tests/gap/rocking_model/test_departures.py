"""Departures of the rocking model: what they predict, and what they say of a loss that is not viscous."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core import Library, Options, fit
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.fitting.parallel import Workers
from daq_app.gap.core.judging.hypotheses import Hypotheses
from daq_app.gap.core.judging.other_forms import FreeForm
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.library import rocking_library
from daq_app.gap.rocking_model.prediction.free_forms import departed
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.prediction.vector import (
    HalfCycles,
    half_cycle_table,
    kernel_vector,
    restitution_of,
)
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import prepare
from sim_hardware.dynamics import Body, Release, Restitution, simulate_motion
from sim_hardware.dynamics import parameters as par
from tests.support.gap.simulated_campaign import campaign
from tests.support.simulated_wall import short_rig, simulate

LEVELS = (0.15, -0.25, 0.35, -0.40)
LIBRARY: Library = rocking_library()


def forms_on_top(effects: dict[str, dict[str, float]], name: str) -> list[FreeForm]:
    """Free forms on top of an effect that is taken for what is hidden in simulated runs."""
    return forms_of(simulate(effects, LEVELS), name)


def forms_of(recorded: list[GapRun], name: str) -> list[FreeForm]:
    """The same of any runs."""
    runs = tuple(prepare(recorded)[0])
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


def at_priors(run: RockingRun) -> dict[str, float]:
    """Every parameter of a run at the centre of its prior."""
    model = RockingModel(run.survey)
    return {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}


def half_cycles(run: RockingRun, index: int, value: float) -> HalfCycles:
    """Those of a wall with one of the simulator's parameters."""
    vector = kernel_vector(run, at_priors(run))
    vector[index] = value
    true, levels = run.swings.peak_rad, run.swings.levels
    return HalfCycles(vector, true, levels, half_cycle_table(run, vector, true, levels))


def assert_opposite(run: RockingRun, departure: str, index: int, value: float) -> None:
    """A departure does on one side what the simulator's parameter does, and on the other its opposite."""
    plain = half_cycles(run, index, 0.0)
    known = half_cycles(run, index, value).table - plain.table
    found, side = departed(run, {departure: value}, plain) - plain.table, np.sign(plain.true)
    assert set(side.tolist()) == {-1.0, 1.0}
    np.testing.assert_allclose(found, side[:, None] * known, rtol=0.03, atol=1e-8)


def test_a_loss_of_either_side_is_damping_on_one_and_a_push_on_the_other(run: RockingRun) -> None:
    assert_opposite(run, "loss_side.zeta", par.ZETA, 1e-3)


def test_a_loss_that_grows_is_a_damping_that_goes_with_the_logarithm_of_the_peak(run: RockingRun) -> None:
    plain = half_cycles(run, par.ZETA, 0.0)
    known = half_cycles(run, par.ZETA, 1e-3).table - plain.table
    grown = departed(run, {"loss_growth.zeta": 1e-3}, plain) - plain.table
    share = np.log(np.abs(plain.true) / (0.1 * run.survey.alpha_rad))
    np.testing.assert_allclose(grown, share[:, None] * known, rtol=0.03, atol=1e-8)


def test_no_hypothesis_makes_the_scatter_of_r_look_smaller(run: RockingRun) -> None:
    """A peak tells r by the survey's slope: one that grew with α would pull α and the pivots along."""
    model, values = RockingModel(run.survey), at_priors(run)
    further_in = {**values, "half_base": values["half_base"] + 0.01, "pivot_shift.a": 0.01}
    further_in["alpha"] += 0.01 / values["half_base"] * values["alpha"]
    one, other = (model.predict(run, v).loadings["scatter of r"] for v in (values, further_in))
    assert np.count_nonzero(one) == run.peaks.size
    np.testing.assert_array_equal(one, other)
    # ω²/2p² = cos(α − φ) − cos α, by differences.
    peaks, alpha = np.abs(run.swings.peak_rad[run.peaks]), run.survey.alpha_rad
    height = [np.cos(alpha - share * peaks) - np.cos(alpha) for share in (0.999, 1.001)]
    slopes = 0.5 * np.log(height[1] / height[0]) / np.log(1.001 / 0.999)
    np.testing.assert_allclose(1.0 / one[one != 0.0], slopes, rtol=1e-4)


def test_uneven_edges_roll_on_one_side_and_bite_on_the_other(run: RockingRun) -> None:
    assert_opposite(run, "uneven_edges.rho", par.EDGE_RADIUS, 5e-4)


def test_the_joint_shows_where_uneven_edges_turn(run: RockingRun) -> None:
    values = at_priors(run)
    place = next(k for k, block in enumerate(run.blocks) if block.family == "joint")
    names = run.blocks[place].names
    model, own = RockingModel(run.survey), {}
    for radius in (0.0, 0.01):
        features = model.predict(run, {**values, "uneven_edges.rho": radius}).features
        own[radius] = features[-sum(len(block.names) for block in run.blocks) :]
    first = sum(len(block.names) for block in run.blocks[:place])
    moved = (own[0.01] - own[0.0])[first : first + len(names)]
    told = dict(zip(names, moved, strict=True))
    assert told["pivot left against right"] == pytest.approx(-0.01, rel=0.01)
    assert told["pivot with rotation, left against right"] == pytest.approx(0.005, rel=0.01)
    assert abs(told["pivot"]) < 1e-4


def test_unequal_edges_do_not_depart_from_themselves() -> None:
    forms = {
        form.name: form for form in forms_on_top({"alpha_asymmetry": {"delta": 0.004}}, "alpha_asymmetry")
    }
    assert forms["uneven_edges"].excess < 2.0
    assert forms["uneven_edges"].log_bayes < 1.0
    assert forms["free_geometry"].excess < 2.0


def broken_once(loss: float) -> list[GapRun]:
    """Runs of a wall whose α falls by a share after the first, and stays."""
    rig = short_rig()
    whole, *_ = simulate({}, LEVELS)
    alpha = rig.specimen.alpha0_rad * (1.0 - loss)
    cracked = rig.model_copy(update={"specimen": rig.specimen.model_copy(update={"alpha0_rad": alpha})})
    first = prepare([whole])[0][0].swings.impacts
    runs = campaign(cracked, rig, {}, 1, LEVELS, post_rest_s=1.0)[1:]
    return [whole, *(replace(run, impacts_before=run.impacts_before + first) for run in runs)]


def wear_power(recorded: list[GapRun]) -> FreeForm:
    return next(form for form in forms_of(recorded, "crushing") if form.name == "wear_power")


def test_a_wall_that_breaks_once_is_not_worn_steadily() -> None:
    form = wear_power(broken_once(0.02))
    assert form.excess > 6.0
    assert form.log_bayes > 5.0


def test_steady_wear_does_not_depart_from_itself() -> None:
    form = wear_power(simulate({"crushing": {"loss": 0.01}}, LEVELS))
    assert form.excess < 2.0
    assert form.log_bayes < -1.0


def test_after_many_impacts_a_faster_wear_is_a_larger_one(run: RockingRun) -> None:
    """ln(N/100) hardly changes within a test of a wall that has had a thousand impacts."""
    worn = replace(run, impacts_before=1000.0)
    model, values = RockingModel(run.survey), at_priors(run)
    sound = model.predict(worn, values).features
    faster = model.predict(worn, {**values, "crushing.loss": 0.0, "wear_power.loss": 1e-4}).features - sound
    larger = model.predict(worn, {**values, "crushing.loss": 1e-4 * np.log(10.0)}).features - sound
    assert np.linalg.norm(larger) > 0.0
    assert np.linalg.norm(faster - larger) < 0.03 * np.linalg.norm(larger)


def test_a_curvature_of_r_is_neither_a_level_nor_a_slope_of_it(run: RockingRun) -> None:
    middle = 0.36 * run.survey.p_rad_s * run.survey.alpha_rad
    speeds = middle * np.array([1.0, 1.001, 0.5, 2.0])
    order = np.zeros(4, dtype=np.intp)

    def added(name: str) -> np.ndarray:
        values = {"r": 0.9, "r_slope": 0.0, "r_sides": 0.0, name: 0.1}
        found = restitution_of(run, values, speeds, np.ones(4), order) - 0.9
        return np.asarray(found)

    for name in ("slope_power.c", "slope_square.c"):
        level, beside, slow, fast = added(name)
        assert abs(level) < 1e-12
        assert abs(beside) < 1e-6 * middle
        assert min(slow, fast) > 1e-4
    assert added("slope_square.c")[3] == pytest.approx(0.1 * middle**2)
    assert added("slope_power.c")[3] == pytest.approx(0.1 * middle * (2 * np.log(2.0) - 1.0))


@pytest.mark.parametrize(
    ("name", "parameter", "size"), [("eccentric_mass", "e", 3e-3), ("alpha_asymmetry", "delta", -2e-3)]
)
def test_unequal_levers_make_r_of_the_two_sides_that_of_the_simulator(
    run: RockingRun, name: str, parameter: str, size: float
) -> None:
    survey = run.survey
    body = Body(survey.alpha_rad, survey.p_rad_s, survey.half_base_m / math.sin(survey.alpha_rad), 5000.0)
    motion = simulate_motion(body, Release(0.07), Restitution(0.9), {name: {parameter: size, "plastic": 0.7}})
    before, after = motion.velocity_before_rad_s[:4], motion.velocity_after_rad_s[:4]
    values = {**at_priors(run), "r": 0.9, f"{name}.{parameter}": size, f"{name}.plastic": 0.7}
    found = restitution_of(run, values, np.abs(before), -np.sign(before), np.arange(4))
    assert abs(found[0] - found[1]) > 5e-4
    assert found == pytest.approx(after / before, abs=1e-9)
