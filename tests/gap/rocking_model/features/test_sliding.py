"""What wires show of a base that slides at impacts, beside a drift of all of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from daq_app.config.rig import G_M_S2
from daq_app.gap.core import Options
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.run_features import examine, extract
from daq_app.gap.rocking_model.prediction.true_motion import pause_at_impact
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.simulated_wall import simulate

LEVELS = (0.2, -0.28, 0.36, -0.24)
SLIP_S_M = 1e-3
"""m per rad/s: 0.2 mm at the usual impact."""


@pytest.fixture(scope="module")
def plain() -> tuple[GapRun, ...]:
    """Runs from the hold on, whose samples are those that their features are read from."""
    return tuple(examine(run).run for run in simulate({}, LEVELS))


def _slid(run: GapRun, share: float, uneven: float, seed: int) -> GapRun:
    """The run of a wall that slides after each impact by `SLIP_S_M` in so many shares, unevenly, towards +x.

    `uneven`: standard deviation of a step over its mean.
    """
    seen = extract(run)
    time_s = np.arange(run.channels.shape[1]) / run.rate_hz - seen.swings.release_s
    draw = np.random.default_rng(seed)
    moved = np.zeros_like(time_s)
    for at_s, speed in zip(seen.grid.impact_s, seen.grid.approach, strict=True):
        step = SLIP_S_M * share * abs(speed) * (1.0 + uneven * draw.standard_normal())
        moved += step * np.clip((time_s - at_s) / 0.01, 0.0, 1.0)
    return _wires_moved(run, moved)


def _wires_moved(run: GapRun, moved_m: np.ndarray) -> GapRun:
    changed = run.channels.copy()
    for i in run.indices("wire"):
        changed[i] += moved_m
    return replace(run, channels=changed)


def _drifting(run: GapRun, rate_m_s: float) -> GapRun:
    return _wires_moved(run, rate_m_s * np.arange(run.channels.shape[1]) / run.rate_hz)


def _read(run: GapRun) -> tuple[Block, float, float]:
    """The block, its drift, and the mean of its slips per speed."""
    (block,) = [block for block in extract(run).blocks if block.family == "slide"]
    return block, float(block.values[0]), float(np.mean(block.values[1:]))


def test_uneven_steps_add_up_to_the_slip_of_the_test(plain: tuple[GapRun, ...]) -> None:
    slips = [_read(_slid(run, 1.0, 0.5, k))[2] for k, run in enumerate(plain)]
    assert np.mean(slips) == pytest.approx(SLIP_S_M, rel=0.2)
    assert np.abs([_read(run)[2] for run in plain]).max() < 0.1 * SLIP_S_M


def test_a_drift_of_all_wires_is_no_slip_though_it_moves_them_as_far(plain: tuple[GapRun, ...]) -> None:
    for run in plain:
        block, drift, slip = _read(_drifting(run, 5e-4))
        assert drift == pytest.approx(5e-4 / extract(run).wire_height_m, rel=0.15)
        assert abs(slip) < 0.2 * SLIP_S_M
        assert np.sqrt(np.diag(block.covariance)).max() < 0.5 * SLIP_S_M


@pytest.mark.parametrize(
    "effects",
    [
        {"gain@wire": {"error": 0.03}},
        {"lag@wire": {"tau": 4e-3}},
        {"slow_response@wire": {"tau": 8e-3}},
        {"compliance": {"phi": 1e-3}},
        {"wire_anchor@wire": {"height": 0.1}},
    ],
    ids=lambda effects: next(iter(effects)),
)
def test_wires_that_are_off_in_another_way_do_not_step_to_one_side(
    effects: dict[str, dict[str, float]],
) -> None:
    slips = [_read(run)[2] for run in simulate(effects, LEVELS[:2])]
    assert np.abs(slips).max() < 0.1 * SLIP_S_M


def test_a_wall_that_slides_to_one_side_by_uneven_steps_is_said_to(plain: tuple[GapRun, ...]) -> None:
    shares = (1.1, 0.8, 1.3, 0.9)
    runs = [_slid(run, share, 0.5, k) for k, (run, share) in enumerate(zip(plain, shares, strict=True))]
    found = diagnose_runs(runs, Options(workers=1))
    assert (found.decision.verdict, found.decision.effects) == ("effect", ("sliding_on",))
    size = next(p for p in found.effect_parameters if p.name == "sliding_on.c")
    assert size.value == pytest.approx(SLIP_S_M, rel=0.3)


@pytest.mark.parametrize("rings", [False, True])
def test_wires_tell_their_drift_once_and_no_slide_of_a_wall_that_rings(rings: bool) -> None:
    effects = {"drift@wire": {"rate": 5e-4}}
    if rings:
        effects["flexible_wall"] = {"gain": 0.02, "frequency": 5.0, "zeta": 0.01}
    for run in prepare(simulate(effects, LEVELS[:2]))[0]:
        families = [block.family for block in run.blocks]
        assert families.count("steady") == rings and families.count("slide") == (not rings)
        (drift,) = [
            value
            for value, label in zip(run.features.values, run.features.labels, strict=True)
            if (label.channel, label.observable) == ("wire", "drift")
        ]
        assert drift == pytest.approx(5e-4 / run.wire_height_m, rel=0.3)


def test_a_drift_of_all_wires_is_said_to_be_one(plain: tuple[GapRun, ...]) -> None:
    found = diagnose_runs([_drifting(run, 5e-4) for run in plain], Options(workers=1))
    assert (found.decision.verdict, found.decision.effects) == ("effect", ("drift@wire",))


@pytest.mark.parametrize("square", [0.0, 1.0])
@pytest.mark.parametrize(("effect", "slip_s_m"), [("sliding", 0.004), ("sliding_on", -0.004)])
def test_a_simulated_wall_that_slides_is_diagnosed_with_its_way_and_its_law(
    effect: str, slip_s_m: float, square: float
) -> None:
    runs = simulate({effect: {"c": slip_s_m, "square": square}}, LEVELS)
    found = diagnose_runs(runs, Options(workers=1))
    assert (found.decision.verdict, found.decision.effects) == ("effect", (effect,))
    told = {p.name: p for p in found.effect_parameters}
    assert told[f"{effect}.c"].low < slip_s_m < told[f"{effect}.c"].high
    assert told[f"{effect}.square"].value == pytest.approx(square, abs=0.2)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_slip_at_an_impact_leaves_the_wall_behind_as_a_moving_floor_does(side: float) -> None:
    """A block that rises to `side` while its floor moves outwards for 4 ms, by SciPy, against the pause."""
    alpha, p, r, speed, c = 0.215, 2.2, 0.9, 0.3, 0.004
    slip_m, lasts_s = c * speed, 0.004

    def acceleration(t: float) -> float:
        turn = 2.0 * math.pi / lasts_s
        return slip_m / lasts_s * turn * math.sin(turn * t) if t < lasts_s else 0.0

    def passed_at(size: float) -> float:
        def rates(t: float, state: np.ndarray) -> list[float]:
            left = alpha - state[0]
            floor = size * acceleration(t) / G_M_S2
            return [state[1], -(p**2) * (math.sin(left) + floor * math.cos(left))]

        def level(_: float, state: np.ndarray) -> float:
            return float(state[0] - 0.0025)  # soon after the slip: the wall has hardly slowed down

        level.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(rates, (0.0, 1.0), [0.0, r * speed], events=level, max_step=2e-4, rtol=1e-10)
        return float(found.t_events[0][0])

    behind_s = passed_at(1.0) - passed_at(0.0)
    body = {"alpha": alpha, "p": p, "r": r}
    # The half-cycle before the impact is on the other side.
    before, speeds = np.array([-side]), np.array([speed])
    to_and_fro = pause_at_impact({**body, "sliding.c": c, "sliding.back": 1.0}, speeds, before)
    one_way = pause_at_impact({**body, "sliding_on.c": c, "sliding_on.back": 1.0}, speeds, before)
    assert to_and_fro[0] == pytest.approx(behind_s, rel=0.1)
    assert one_way[0] == pytest.approx(side * behind_s, rel=0.1)
    # As long at every impact where slips go with the speed, and twice as long at twice the speed where
    # friction stops them.
    stopped = {**body, "sliding.c": c, "sliding.back": 1.0, "sliding.square": 1.0}
    twice = pause_at_impact(stopped, np.array([0.2, 0.4]), np.array([-side, -side]))
    assert twice == pytest.approx([to_and_fro[0], 2.0 * to_and_fro[0]])
    assert pause_at_impact({**body, "sliding.c": c, "sliding.back": 0.0}, speeds, before)[0] == 0.0
