"""LVDTs that are late: the motion is read from the wires, and the joint still says where the wall turns."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.core import Options
from daq_app.gap.core.policy import POLICY
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.coefficients import block_coefficients
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.motion.late_joint import lateness
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.prediction.true_motion import true_rotations
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.gap.simulated_campaign import simulate as longer_held
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35)
WALL = {"pivot_shift": {"a": 0.03}}


def _block(run: RockingRun, family: str) -> Block:
    return next(b for b in run.blocks if b.family == family)


@pytest.mark.parametrize("tau", [0.012, 0.03])
@pytest.mark.parametrize("effect", ["lag@lvdt", "filter_delay@lvdt", "slow_response@lvdt"])
def test_what_a_late_joint_shows_of_itself_is_what_it_shows_in_time(effect: str, tau: float) -> None:
    """But for what a slow response smears, which the effect predicts."""
    prompt = prepare(simulate(WALL, LEVELS))[0]
    for run, known in zip(prepare(simulate(WALL | {effect: {"tau": tau}}, LEVELS))[0], prompt, strict=True):
        assert (run.reference, known.reference) == ("wire", "lvdt")
        for family in ("joint", "twist"):
            seen, expected = _block(run, family), _block(known, family)
            assert seen.names == expected.names
            further_in = {"pivot_shift.a": WALL["pivot_shift"]["a"]}
            slow = _predicted(run, family, further_in | {f"{effect}.tau": tau})
            smeared = slow - _predicted(run, family, further_in)
            sd = np.sqrt(np.diag(seen.covariance) + np.diag(expected.covariance))
            np.testing.assert_array_less(np.abs(seen.values - smeared - expected.values), 4.0 * sd)
        assert abs(_block(run, "joint").values[0]) > 0.02, "the wall turns 30 mm further in"


def _predicted(run: RockingRun, family: str, effect: dict[str, float]) -> np.ndarray:
    """What the model makes of the coefficients of a family under an effect."""
    first = 0
    for block in run.blocks:
        if block.family == family:
            break
        first += len(block.names)
    return block_coefficients(run, _usual(run, effect))[first : first + len(_block(run, family).names)]


@pytest.mark.parametrize(
    "effect",
    [
        {"sliding": {"c": 0.006}},
        {"flexible_wall": {"gain": 0.008, "frequency": 11.0, "zeta": 0.015}},
        {"wire_cosine@wire": {"kappa": 0.05}},
    ],
    ids=lambda effect: next(iter(effect)),
)
def test_what_moves_the_wires_alone_is_predicted_where_the_motion_is_read_from_them(
    effect: dict[str, dict[str, float]],
) -> None:
    """The wall moves as it does without: behind the wires are the same peaks, and as much is left of
    times."""
    late = {"lag@lvdt": {"tau": 0.02}}
    (run,), (plain,) = (prepare(simulate(late | more, (0.35,)))[0] for more in (effect, {}))
    assert run.reference == plain.reference == "wire"
    known = {f"{name}.{key}": value for name, values in effect.items() for key, value in values.items()}
    behind = _peaks(plain, {})
    seen, told = (
        _peaks(run, values)[: behind.size] - behind[: run.swings.peak_rad.size] for values in ({}, known)
    )
    # How far the wires are off at rest each run finds for itself.
    assert np.std(told) < 0.2 * np.std(seen)
    left, ignored, before = _left_of_times(run, known), _left_of_times(run, {}), _left_of_times(plain, {})
    shared = sorted(set(left) & set(before))
    told = np.array([left[k] - before[k] for k in shared])
    seen = np.array([ignored[k] - before[k] for k in shared])
    assert np.std(told) < max(0.2 * np.std(seen), 5e-5)


@pytest.mark.parametrize(
    ("effect", "known"),
    [
        ({"pivot_shift": {"a": 0.05}}, {"pivot_shift.a": 0.05}),
        ({"rounded_edge": {"rho": 0.05}}, {"rounded_edge.rho": 0.05}),
    ],
    ids=lambda effect: next(iter(effect)),
)
def test_wires_that_the_motion_is_read_from_show_where_the_wall_turns(
    effect: dict[str, dict[str, float]], known: dict[str, float]
) -> None:
    """Behind them are the peaks that LVDTs show which are in time, of a wall that is held still."""
    late = {"lag@lvdt": {"tau": 0.02}}
    (run,), (prompt,) = (prepare(longer_held(more | effect, 11, levels=(0.4,)))[0] for more in (late, {}))
    assert (run.reference, prompt.reference) == ("wire", "lvdt")
    shown = _peaks(prompt, {})[: run.swings.peak_rad.size]
    # Families differ in calibration, which may be another at the other face, and in where they rest.
    alike = np.column_stack([shown, np.abs(shown), np.ones_like(shown)])
    seen, told = (_peaks(run, values)[: shown.size] - shown for values in ({}, known))
    seen, told = (off - alike @ np.linalg.lstsq(alike, off, rcond=None)[0] for off in (seen, told))
    assert np.std(told) < 0.5 * np.std(seen)


def test_wires_that_swing_show_higher_peaks_and_settle_after_impacts() -> None:
    late, swing = {"lag@lvdt": {"tau": 0.02}}, {"frequency": 24.0, "zeta": 0.2}
    (run,), (plain,) = (
        prepare(simulate(late | more, (0.35,)))[0] for more in ({"wire_inertia@wire": swing}, {})
    )
    assert run.reference == plain.reference == "wire"
    known = {f"wire_inertia@wire.{name}": value for name, value in swing.items()}
    behind = _peaks(plain, {})[: run.swings.peak_rad.size]
    seen, told = (_peaks(run, values)[: behind.size] - behind for values in ({}, known))
    assert np.std(told) < 0.2 * np.std(seen)
    left, ignored, before = _left_of_times(run, known), _left_of_times(run, {}), _left_of_times(plain, {})
    shared = sorted(set(left) & set(before))
    told = np.array([left[k] - before[k] for k in shared])
    seen = np.array([ignored[k] - before[k] for k in shared])
    assert np.median(np.abs(told)) < 0.5 * np.median(np.abs(seen))


def _usual(run: RockingRun, effect: dict[str, float]) -> dict[str, float]:
    model = RockingModel(run.survey)
    return {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))} | effect


def _peaks(run: RockingRun, effect: dict[str, float]) -> np.ndarray:
    """The wall's peaks as the model sees them behind those of the reference."""
    return true_rotations(run, _usual(run, effect))[0]


def _left_of_times(run: RockingRun, effect: dict[str, float]) -> dict[tuple[int, ...], float]:
    """What the model leaves of each time feature, s, by its crossings."""
    predicted = RockingModel(run.survey).predict(run, _usual(run, effect)).features
    left = run.features.values - predicted
    return dict(zip(map(tuple, run.places.tolist()), left.tolist(), strict=False))


def test_joints_that_reach_their_limit_or_go_in_steps_say_nothing() -> None:
    for effect in ({"saturation@lvdt": {"limit": 0.03}}, {"quantisation@lvdt": {"step": 1e-3}}):
        (run,) = prepare(simulate(effect, (0.4,)))[0]
        assert run.reference == "wire"
        assert not {"joint", "twist"} & {block.family for block in run.blocks}


def test_lateness_is_that_of_a_record() -> None:
    time = np.arange(1200) / 200.0
    after = np.maximum(time - 1.0, 0.0)
    motion = np.exp(-0.9 * after) * np.cos(2.0 * np.pi * 0.8 * after)
    late = np.interp(time - 0.013, time, motion)
    assert lateness(late, motion) / 200.0 == pytest.approx(0.013, abs=3e-4)
    assert lateness(motion, late) / 200.0 == pytest.approx(-0.013, abs=3e-4)


@pytest.mark.heavy
def test_late_lvdts_do_not_hide_where_the_wall_turns() -> None:
    """Without the joint a pivot further in and edges worn round have the same dynamics at these levels."""
    runs = simulate(WALL | {"lag@lvdt": {"tau": 0.012}})
    result = diagnose_runs(runs, Options(), only=("pivot_shift", "rounded_edge", "lag@lvdt"))
    assert set(result.decision.effects) == {"pivot_shift", "lag@lvdt"}
    assert result.decision.confidence > 0.99 * (1.0 - POLICY.unforeseen)
