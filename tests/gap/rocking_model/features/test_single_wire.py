"""One faulty wire among sound ones: what the model says of it is what the simulated rig shows."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.features.block import Block
from daq_app.gap.rocking_model.features.channel_response import channel
from daq_app.gap.rocking_model.inspection.inspect_runs import found_channels
from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import prepare
from tests.support.simulated_wall import simulate

LEVEL = (-0.35,)


def _block(key: str, given: dict[str, float]) -> tuple[Block, np.ndarray]:
    """The faulty wire's block, and what the model makes of the fault that it has."""
    (run,) = prepare(simulate({key: given}, LEVEL))[0]
    name = key.partition("@")[2]
    assert found_channels([run]) == {name: "wire"}
    block = next(b for b in run.blocks if b.kind == "channel")
    values = {f"{key}.{parameter}": value for parameter, value in given.items()}
    return block, channel(run, block, values)


@pytest.mark.parametrize(
    ("key", "given"),
    [
        ("drift@WP-1", {"rate": 8e-4}),
        ("wire_anchor@WP-2", {"height": 0.34}),
        ("wire_anchor@WP-3", {"height": -0.4}),
        ("wire_anchor@WP-2", {"height": -0.08}),
        ("wire_cosine@WP-4", {"kappa": 0.2}),
    ],
)
def test_a_wires_fault_acts_on_its_length(key: str, given: dict[str, float]) -> None:
    """The wall lifts on one side only, so height times θ is a curved picture of a wire's length."""
    block, predicted = _block(key, given)
    sd = np.sqrt(np.diag(block.covariance))
    sd[0] = np.hypot(sd[0], 1e-3)  # sound wires of the simulated rig differ in gain
    np.testing.assert_array_less(np.abs(block.values - predicted), 4.0 * sd)


def test_of_two_wires_that_may_be_wrong_it_is_the_one_without_which_the_base_stands_still() -> None:
    """Five wires at four heights leave one check: a gain of WP-1 or of WP-2 may explain the same."""
    gains = {"gain@WP-1": {"error": 0.013}, "gain@WP-2": {"error": -0.027}}
    assert found_channels(prepare(simulate(gains, LEVEL))[0]) == {"WP-2": "wire"}


def test_a_sag_of_the_lowest_wire_is_not_taken_for_one_of_all() -> None:
    """Among wires at four heights both bend the lowest against the others; one of all leaves more."""
    runs = simulate({"wire_cosine@WP-1": {"kappa": -0.17}}, LEVEL)
    assert found_channels(prepare(runs)[0]) == {"WP-1": "wire"}


def test_a_sag_of_the_lowest_wire_of_half_a_millimetre_is_seen() -> None:
    """Wires are straight to 0.1 % of their travel, and the lowest shows the least of its sag."""
    runs = simulate({"wire_cosine@WP-1": {"kappa": -0.06}}, LEVEL)
    assert np.abs(0.06 * (0.9 * 0.35 * runs[0].survey.alpha_rad) ** 2) < 6e-4
    assert found_channels(prepare(runs)[0]) == {"WP-1": "wire"}


@pytest.mark.parametrize("gains", [{"WP-2": -0.006}, {"WP-4": 0.008}])
def test_a_sag_of_the_lowest_wire_is_not_taken_for_a_fault_of_the_next(gains: dict[str, float]) -> None:
    """Without the next one a base that moves takes up most of the sag, and calibrations may make the rest."""
    errors = {f"gain@{name}": {"error": error} for name, error in gains.items()}
    runs = simulate({"wire_cosine@WP-1": {"kappa": -0.27}, **errors}, LEVEL)
    assert found_channels(prepare(runs)[0]) == {"WP-1": "wire"}


def test_a_gain_of_the_wire_that_is_scanned_after_the_lvdts_is_seen() -> None:
    """What leaks into it from the last LVDT looks like a gain and a side of one size, not like one alone."""
    runs = simulate({"gain@WP-1": {"error": -0.06}}, (-0.35, 0.25))
    assert found_channels(prepare(runs)[0]) == {"WP-1": "wire"}


@pytest.mark.parametrize("name", ["WP-1", "WP-5"])
def test_a_sound_wire_may_have_an_anchor_a_centimetre_off_and_not_six(name: str) -> None:
    """A laboratory measures anchors by tape: what that leaves is no cause."""
    key = f"wire_anchor@{name}"
    (run,) = prepare(simulate({key: {"height": 0.15}}, LEVEL))[0]
    block = next(b for b in run.blocks if b.kind == "channel")
    side = block.names.index("side")
    of_tape, of_a_mistake = (
        abs(channel(run, block, {f"{key}.height": off_m})[side]) for off_m in (0.01, 0.06)
    )
    assert of_tape < 1.05 * block.levers[side]
    assert of_a_mistake > 1.5 * block.levers[side]


def _leaking(runs: list[GapRun], share: float) -> list[GapRun]:
    """The runs with that share of the channel that is scanned before, in volts, in each but the first."""
    for run in runs:
        sensitivity = np.array([sensor.si_per_reading for sensor in run.sensors])[:, None]
        run.channels[1:] += share * sensitivity[1:] * (run.channels / sensitivity)[:-1]
    return runs


@pytest.mark.parametrize(
    ("share", "height", "found"),
    [(0.004, 0.15, {"WP-1": "wire"}), (0.008, 0.0, {}), (0.008, -0.15, {"WP-1": "wire"})],
)
def test_what_leaks_into_the_first_wire_is_told_by_other_channels(
    share: float, height: float, found: dict[str, str]
) -> None:
    """A share of the last LVDT looks like an anchor; the first of the other face says how large it is."""
    effects = {"wire_anchor@WP-1": {"height": height}} if height else {}
    assert found_channels(prepare(_leaking(simulate(effects, (-0.35, 0.25)), share))[0]) == found


@pytest.mark.parametrize(("height", "found"), [(-0.18, {"WP-2": "wire"}), (0.0, {})])
def test_a_wire_of_a_wall_that_turns_about_the_vertical_is_compared_with_the_others(
    height: float, found: dict[str, str]
) -> None:
    """Two wires beside each other differ by what such a wall turns; none of the two is wrong."""
    anchor = {"wire_anchor@WP-2": {"height": height}} if height else {}
    runs = simulate({"corner_twist": {"c": 0.003}, **anchor}, (-0.35, 0.25))
    assert found_channels(prepare(runs)[0]) == found
