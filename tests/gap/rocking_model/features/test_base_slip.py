"""A base whose friction does not hold it: found between impacts, and its part in the motion known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from daq_app.config.rig import G_M_S2
from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import examine
from daq_app.gap.rocking_model.features.slips.base_slip import base_motion
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.inspect_runs import inspect, without_slip
from daq_app.gap.rocking_model.prediction.slipping import slip_effects
from daq_app.gap.rocking_model.records import GapRun, load_run
from daq_app.gap.rocking_model.study import diagnose_prepared, diagnose_runs, model_and_library, prepare
from daq_app.rocking.families.base.slip import BaseSlip
from daq_app.rocking.theory.friction import push, slips_as_it_rocks, slips_below
from tests.support.gap.blind_case import blind_case, slippery_base
from tests.support.gap.simulated_campaign import simulate


@pytest.fixture(scope="module")
def slippery(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[RockingRun], float]:
    """Runs of a wall that a contact engine moves, and the friction of its base."""
    pytest.importorskip("mujoco", reason="the extra 'contact' is not installed")
    files, friction = slippery_base(tmp_path_factory.mktemp("slippery"), runs=3, place=0)
    return prepare([load_run(file) for file in files])[0], friction


def test_its_friction_is_that_of_the_base(slippery: tuple[list[RockingRun], float]) -> None:
    runs, friction = slippery
    (finding,) = [f for f in findings_of(runs) if f.name == "sliding@base"]

    assert runs[0].slip is not None
    assert runs[0].slip.friction == pytest.approx(friction, rel=0.015)
    assert np.all(runs[0].slip.along > 0.0)
    assert finding.material and finding.family == "contact"
    assert "lets the base slip" in finding.words


def test_what_the_base_does_at_impacts_is_a_part_of_its_slip(
    slippery: tuple[list[RockingRun], float],
) -> None:
    library = model_and_library(slippery[0])[1]
    assert {"sliding", "sliding_on", "corner_twist"}.isdisjoint(library)
    assert "viscous" in library


def test_what_it_does_to_the_motion_is_taken_out(slippery: tuple[list[RockingRun], float]) -> None:
    """Without that the answer is something unknown, or a cause that is not there."""
    runs, _ = slippery
    model, library = model_and_library(runs)
    some = library.without(
        *(name for name in library if name not in ("viscous", "coulomb", "restitution_slope"))
    )
    result = diagnose_prepared(model, runs, some)
    assert result.decision.effects == ("sliding@base",)
    assert result.rest.unknown < 0.2

    held = [_as_on_a_base_that_holds(run, run.slip) for run in runs if run.slip is not None]
    without = diagnose_prepared(model, held, some)
    assert without.rest.unknown > 0.9 or without.decision.effects


def _as_on_a_base_that_holds(run: RockingRun, slip: BaseSlip) -> RockingRun:
    """The run with what the slip does to its motion, and nothing known of a slip."""
    moved = run.features.values + slip_effects(run, slip).sum(axis=1)
    features = replace(run.features, values=moved)
    loadings = run.fixed_loadings[:, :-2]
    return replace(run, slip=None, findings=(), features=features, fixed_loadings=loadings)


@pytest.fixture(scope="module")
def one_edge(tmp_path_factory: pytest.TempPathFactory) -> list[GapRun]:
    """Tests of a wall that walks by centimetres, for one of its edges slips; its LVDTs are not late."""
    pytest.importorskip("mujoco", reason="the extra 'contact' is not installed")
    files, _ = blind_case(
        tmp_path_factory.mktemp("edge"), "contact", "slippery_edge", seed=73, runs=3, usual=False
    )
    return [load_run(file) for file in files]


def test_a_wall_that_walks_spoils_no_other_sensor(one_edge: list[GapRun]) -> None:
    """The rotation by the wires is off by the walk, and accelerometers feel it."""
    runs, limits = prepare(one_edge)
    material = [finding.name for finding in findings_of(runs) if finding.material]

    assert material == ["sliding@base"]
    assert not [text for text in limits if "AC-" in text]
    cleaned = inspect(one_edge)
    examined = [examine(run) for run in cleaned.runs]
    walked = [base_motion(entry.run, entry.features.grid) for entry in examined]
    slip = runs[0].slip
    assert slip is not None and min(slip.along) == pytest.approx(0.0, abs=0.1 * max(slip.along))
    still = [examine(run) for run in without_slip(cleaned, slip).runs]
    rest = [base_motion(entry.run, entry.features.grid) for entry in still]
    for before, after in zip(walked, rest, strict=True):
        assert before is not None and after is not None
        assert np.ptp(before[0]) > 5e-3
        assert np.ptp(after[0]) < 0.15 * np.ptp(before[0])


def test_the_answer_about_a_wall_that_walks_is_the_slip(one_edge: list[GapRun]) -> None:
    result = diagnose_runs(one_edge, only=("sliding", "viscous", "restitution_slope"))
    assert "sliding@base" in result.decision.effects
    assert result.decision.verdict in ("effect", "pair")


def test_sound_walls_and_walls_that_turn_or_ring_show_none() -> None:
    ringing = {"yaw": {"kick": 0.03, "frequency": 5.0, "zeta": 0.03}}
    for effect in ({}, ringing, {"corner_twist": {"c": 0.004}}):
        runs, _ = prepare(simulate(effect, 5, levels=(0.3, -0.4)))
        assert runs[0].slip is None, effect


def test_wires_that_drift_show_none() -> None:
    """The base seems to move on and on to one side: outwards on one edge, inwards on the other."""
    runs, _ = prepare(simulate({"drift@wire": {"rate": -2e-3}}, 5, levels=(0.2, -0.2, 0.3, -0.4)))
    assert runs[0].slip is None


def _run() -> RockingRun:
    (run,), _ = prepare(simulate({}, 5, levels=(0.3,)))
    return run


def test_slips_are_those_of_the_equation_of_motion() -> None:
    """By the law of friction beside the linear block, step by step, in one half-cycle."""
    survey = _run().survey
    alpha, p = survey.alpha_rad, survey.p_rad_s
    below = 0.012
    for peak in (0.006, 0.03):
        half_s = math.acosh(alpha / (alpha - peak)) / p
        time_s = np.linspace(-half_s, half_s, 40_001)
        pushed = below - alpha + (alpha - peak) * np.cosh(p * time_s)
        speed = slip = 0.0
        for value in pushed[:-1]:
            speed = max(speed + value * (time_s[1] - time_s[0]), 0.0)
            slip += speed * (time_s[1] - time_s[0])
        found = slips_below(below, np.array([peak]), alpha, p)
        assert found.slip[0] == pytest.approx(slip, rel=0.02)
        assert found.end[0] == pytest.approx(speed, rel=0.02)
    assert push(below, alpha, p, 1.5) < push(0.0, alpha, p, 1.5)


def test_an_edge_that_an_impact_sets_off_slips_on_until_it_has_stopped() -> None:
    survey = _run().survey
    alpha, p, peak, below, begin = survey.alpha_rad, survey.p_rad_s, 0.04, 0.012, 4e-4
    half_s = math.acosh(alpha / (alpha - peak)) / p

    def rotation(time_s: FloatArray) -> FloatArray:
        return np.asarray(alpha - (alpha - peak) * np.cosh(p * (time_s - half_s)))

    def slower(time_s: float, state: FloatArray) -> list[float]:
        return [state[1], below - float(rotation(np.array(time_s)))]

    def stopped(_: float, state: FloatArray) -> float:
        return float(state[1])

    stopped.terminal, stopped.direction = True, -1.0  # type: ignore[attr-defined]

    def slides(speed: float) -> float:
        first = solve_ivp(slower, (0.0, half_s), [0.0, speed], events=stopped, rtol=1e-9, atol=1e-15)
        return float(first.y[0, -1])

    alone = slips_below(below, np.array([peak]), alpha, p)
    both = slips_below(below, np.array([peak]), alpha, p, np.array([begin]))
    assert both.slip[0] - alone.slip[0] == pytest.approx(slides(begin) - slides(0.0), rel=0.05)
    time_s = np.arange(0.0, 2.0 * half_s, 0.005)
    _, way = slips_as_it_rocks(np.array([below, below]), rotation(time_s), 0.005, np.array([0.0, begin]))
    assert way[-1] == pytest.approx([alone.slip[0], both.slip[0]], rel=0.05)


def test_a_slip_moves_half_cycles_as_a_moving_floor_does() -> None:
    """Falls of the block on an edge that slips, by SciPy, against the loading's first order."""
    run = _run()
    survey = run.survey
    alpha, p = survey.alpha_rad, survey.p_rad_s
    below, along = 0.02, 10.0

    def crossing(peak: float, level: float, size: float) -> float:
        def rates(_: float, state: FloatArray) -> list[float]:
            left = alpha - state[0]
            floor = size * max(below - state[0], 0.0) / G_M_S2
            return [state[1], -(p**2) * (math.sin(left) + floor * math.cos(left))]

        def passed(_: float, state: FloatArray) -> float:
            return float(state[0] - level)

        passed.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(rates, (0.0, 3.0), [peak, 0.0], events=passed, rtol=1e-10, atol=1e-13)
        return float(found.t_events[0][0])

    slip = BaseSlip(below, 0.15, np.array([along, along]), np.zeros(2), 1e-3, 1e-5, 0.0, 1e-5)
    columns = slip_effects(run, slip)
    count = run.swings.levels.shape[1]
    seen = 0
    for row, (ka, a, kb, b) in enumerate(run.places.tolist()):
        peak = abs(float(run.swings.peak_rad[ka]))
        if ka != kb or max(a, b) >= count or ka == 0 or peak > below:
            continue
        ends = [float(run.swings.levels[ka, place]) for place in (a, b)]
        added = [crossing(peak, level, along) - crossing(peak, level, 0.0) for level in ends]
        assert columns[row, 0] == pytest.approx(added[1] - added[0], rel=0.1, abs=2e-6)
        seen += 1
    assert seen > 4
