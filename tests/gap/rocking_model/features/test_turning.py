"""What wires at both ends of the wall show of its turning about the vertical."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core import Options
from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.coefficients import block_coefficients, repeatability
from daq_app.gap.rocking_model.features.differences import of_shapes
from daq_app.gap.rocking_model.features.rocking_run import RockingRun
from daq_app.gap.rocking_model.features.run_features import examine, extract
from daq_app.gap.rocking_model.features.slips.impact_steps import step_terms, turn_share, turns
from daq_app.gap.rocking_model.prediction.model import RockingModel
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.simulated_wall import simulate

TURN_S = 2e-3


@pytest.fixture(scope="module")
def plain() -> GapRun:
    """A run from the hold on, whose samples are those that its features are read from."""
    (run,) = simulate({}, (0.35,))
    return examine(run).run


def _turn_block(run: GapRun) -> Block:
    (block,) = [block for block in extract(run).blocks if block.family == "turn"]
    return block


def _turns(run: GapRun) -> np.ndarray:
    return np.asarray(_turn_block(run).values)


def _with(run: GapRun, wire: str, moved_m: np.ndarray) -> GapRun:
    changed = run.channels.copy()
    changed[next(i for i, sensor in enumerate(run.sensors) if sensor.id == wire)] += moved_m
    return replace(run, channels=changed)


def _turning_at_one_edge(plain: GapRun, settling_s: float) -> GapRun:
    """The run of a wall that turns at each impact on one edge, with that time constant."""
    seen = extract(plain)
    time_s = np.arange(plain.channels.shape[1]) / plain.rate_hz - seen.swings.release_s
    turned = np.zeros_like(time_s)
    for at_s, speed in zip(seen.grid.impact_s, seen.grid.approach, strict=True):
        if speed < 0.0:
            turned -= TURN_S * abs(speed) * np.expm1(-np.maximum(time_s - at_s, 0.0) / settling_s)
    run = plain
    for sensor in plain.sensors:
        if sensor.family == "wire" and sensor.position_m[1]:
            run = _with(run, sensor.id, -sensor.position_m[1] * turned)
    return run


def test_impacts_of_one_side_that_turn_the_wall_a_little_are_seen(plain: GapRun) -> None:
    turned = _turns(_turning_at_one_edge(plain, 1e-4))
    assert np.mean(turned) == pytest.approx(TURN_S / 2.0, rel=0.15)
    assert abs(np.mean(_turns(plain))) < 0.05 * TURN_S


@pytest.mark.parametrize("settling_s", [0.01, 0.02])
def test_a_wall_that_takes_a_while_to_turn_turns_as_far(plain: GapRun, settling_s: float) -> None:
    seen = extract(plain)
    (block,) = [block for block in seen.blocks if block.family == "turn"]
    at_once, slowly = (_turns(_turning_at_one_edge(plain, constant_s)) for constant_s in (1e-4, settling_s))
    of_size = of_shapes(seen, block, step_terms(seen, turns(seen, _usual(seen) | {"corner_twist.c": TURN_S})))
    alternating = _usual(seen) | {"corner_twist.c": TURN_S, "corner_twist.alternation": np.pi / 2.0}
    forms = np.column_stack([of_size, of_shapes(seen, block, step_terms(seen, turns(seen, alternating)))])
    strength = np.linalg.lstsq(forms, slowly - at_once, rcond=None)[0]
    assert np.max(np.abs(strength)) < 0.02


def test_play_of_a_wire_and_a_zero_that_walks_are_no_turning(plain: GapRun) -> None:
    seen = extract(plain)
    time_s = np.arange(plain.channels.shape[1]) / plain.rate_hz - seen.swings.release_s
    side = np.full_like(time_s, -np.sign(seen.grid.approach[0]))
    for at_s, speed in zip(seen.grid.impact_s, seen.grid.approach, strict=True):
        side[time_s > at_s] = np.sign(speed)
    played = _turns(_with(plain, "WP-5", 3e-4 * side))
    assert abs(np.mean(played)) < 0.05 * TURN_S
    walked = _turns(_with(plain, "WP-5", 2e-5 * np.maximum(time_s, 0.0)))
    assert abs(np.mean(walked)) < 0.05 * TURN_S


def test_a_wall_with_wires_in_one_plane_says_nothing_of_its_turning(plain: GapRun) -> None:
    ends = tuple(s.id for s in plain.sensors if s.family == "wire" and s.position_m[1])
    assert not [block for block in extract(plain.excluding(ends)).blocks if block.family == "turn"]


@pytest.mark.parametrize(
    "alternation", [0.0, np.pi / 4, -np.pi / 2], ids=["on and on", "one edge", "back and forth"]
)
def test_a_simulated_wall_that_turns_about_its_corners_is_predicted(alternation: float) -> None:
    given = {"c": TURN_S, "alternation": alternation}
    (run,) = simulate({"corner_twist": given}, (0.35,))
    seen = extract(run)
    (block,) = [block for block in seen.blocks if block.family == "turn"]
    values = _usual(seen) | {f"corner_twist.{key}": value for key, value in given.items()}
    told = of_shapes(seen, block, step_terms(seen, turns(seen, values)))
    assert np.max(np.abs(told)) > 0.3 * TURN_S
    np.testing.assert_allclose(block.values, told, atol=0.03 * TURN_S)


def test_impacts_are_as_fast_as_those_of_the_wall_and_not_of_the_survey() -> None:
    (run,) = simulate({"corner_twist": {"c": TURN_S, "alternation": 0.0}}, (0.35,))
    true = run.survey
    believed = replace(true, alpha_rad=0.95 * true.alpha_rad, p_rad_s=0.96 * true.p_rad_s)
    seen = extract(replace(run, survey=believed))
    (block,) = [block for block in seen.blocks if block.family == "turn"]
    wall = {"alpha": true.alpha_rad, "p": true.p_rad_s, "corner_twist.c": TURN_S}
    told = of_shapes(seen, block, step_terms(seen, turns(seen, wall)))
    np.testing.assert_allclose(block.values, told, atol=0.03 * TURN_S)


@pytest.mark.parametrize(("family", "coefficient"), [("slide", "slip 1"), ("base", "slip per speed")])
def test_a_turn_that_wires_of_one_end_take_for_something_else_is_predicted(
    plain: GapRun, family: str, coefficient: str
) -> None:
    given = {"c": 5.0 * TURN_S, "alternation": np.pi / 4}
    still, turning = (_of_one_end(run) for run in (plain, *simulate({"corner_twist": given}, (0.35,))))
    before, after = (next(b for b in run.blocks if b.family == family) for run in (still, turning))
    values = _usual(turning) | {f"corner_twist.{key}": value for key, value in given.items()}
    told = of_shapes(
        turning,
        after,
        step_terms(turning, turns(turning, values), turn_share(turning, of_base=family == "base")),
    )
    sd, still_sd = (np.sqrt(np.diag(block.covariance)) for block in (after, before))
    where = after.names.index(coefficient)
    assert abs(told[where]) > 3.0 * (sd if family == "base" else still_sd)[where]
    if family == "slide":
        # Its errors are those by which single wires differ, and what slides repeat by comes on top.
        sd = np.hypot(sd, [repeatability(after, i) for i in range(sd.size)])
    np.testing.assert_array_less(np.abs(after.values - before.values - told), 0.6 * sd)


def _of_one_end(run: GapRun) -> RockingRun:
    """The run without the wires at the other end of the wall."""
    kept = [i for i, s in enumerate(run.sensors) if not (s.family == "wire" and s.position_m[1] > 0.0)]
    return extract(replace(run, channels=run.channels[kept], sensors=tuple(run.sensors[i] for i in kept)))


def test_a_wall_that_turns_at_the_impacts_of_one_edge_is_diagnosed() -> None:
    runs = simulate({"corner_twist": {"c": 1.5e-3, "alternation": -np.pi / 4}}, (0.25, -0.35))
    found = diagnose_runs(runs, Options(workers=1))
    assert found.decision.effects == ("corner_twist",) and found.decision.verdict == "effect"
    size, alternation = (
        next(p for p in found.effect_parameters if p.name == f"corner_twist.{name}")
        for name in ("c", "alternation")
    )
    assert size.low < 1.5e-3 < size.high
    assert alternation.low < -np.pi / 4 < alternation.high


@pytest.mark.parametrize(
    "effect",
    [
        {"yaw": {"kick": 0.13, "frequency": 4.0, "zeta": 0.04}},
        {"twist": {"kick": 0.1, "frequency": 3.0, "zeta": 0.03}},
    ],
    ids=lambda effect: next(iter(effect)),
)
def test_a_wall_that_rings_slowly_about_the_vertical_is_no_turn_that_stays(
    plain: GapRun, effect: dict[str, dict[str, float]]
) -> None:
    (ringing,) = simulate(effect, (0.35,))
    values = {f"{name}.{key}": value for name, given in effect.items() for key, value in given.items()}
    (run,), (still,) = (prepare([each])[0] for each in (ringing, plain))
    block, before = (next(b for b in each.blocks if b.family == "turn") for each in (run, still))
    told = block_coefficients(run, _usual(run) | values) - block_coefficients(run, _usual(run))
    first = sum(len(b.names) for b in run.blocks[: run.blocks.index(block)])
    told = told[first : first + len(block.names)]
    sd, quiet_sd = (np.sqrt(np.diag(b.covariance)) for b in (block, before))
    assert np.max(np.abs(told) / quiet_sd) > 2.5, "taken for turns, they would count"
    np.testing.assert_array_less(np.abs(block.values - before.values - told), 0.2 * sd)


def test_a_kick_that_goes_with_the_speed_is_many_jumps_and_a_cause_all_the_same() -> None:
    """A wall loses a tenth of its speed: an eighth of the speed is more than the jump itself."""
    runs = simulate({"yaw": {"kick": 3.0, "frequency": 4.0, "zeta": 0.04}}, (0.25, -0.35, 0.3))
    result = diagnose_runs(runs, only=("yaw", "twist", "flexible_wall", "restitution_slope"))
    assert result.decision.effects == ("yaw",)
    (kick,) = (p for p in result.effect_parameters if p.name == "yaw.kick")
    assert kick.value == pytest.approx(3.0, rel=0.05)


def _usual(run: RockingRun) -> dict[str, float]:
    model = RockingModel(run.survey)
    return {p.name: p.mean for p in (*model.nuisance, *model.local_nuisance(run))}


def _one_over_f(n: int, rng: np.random.Generator) -> np.ndarray:
    """Noise of rms one whose power goes with 1/f, (n,)."""
    harmonics = np.arange(1, n // 2 + 1)
    parts = rng.normal(size=harmonics.size) + 1j * rng.normal(size=harmonics.size)
    noise = np.fft.irfft(np.concatenate([[0.0], parts / np.sqrt(harmonics)]), n)
    return np.asarray(noise / noise.std())


def test_turns_in_noise_with_a_spectrum_of_1_over_f_are_within_their_errors() -> None:
    """White noise and a walk alone state half of what such noise makes of them."""
    rng = np.random.default_rng(5)
    squares = []
    for run in simulate({}, (0.15, -0.25, 0.35, 0.40, -0.15, 0.25), seed=42):
        for name in ("WP-1", "WP-2", "WP-3", "WP-4", "WP-5"):
            run = _with(run, name, 4e-4 * _one_over_f(run.channels.shape[1], rng))
        block = _turn_block(examine(run).run)
        squares.append(np.mean(block.values**2 / np.diag(block.covariance)))
    assert np.sqrt(np.mean(squares)) < 1.4
