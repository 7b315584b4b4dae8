"""While a wall rocks, what it does that a rigid block with the survey's α does not is told beside r.

Slow noise is in the weights of the live r.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from daq_app.config import load_rig
from daq_app.rocking.live import Estimate
from studies.restitution.laboratory import LaboratoryTest, draw_test
from studies.restitution.live import (
    behind_slow_lvdts,
    behind_slow_wires,
    drifting_wires,
    live_estimates,
    round_edges,
    slowly_released,
    sticking_wire,
)
from studies.restitution.walls import SimulatedEffect, ringing_test

RIG = load_rig(Path(__file__).parents[3] / "configs" / "fr1.toml")
RINGING_SEED = 91001
"""Wires ring at 7 Hz; by their half-cycles alone impacts would seem to take time."""


@cache
def ringing() -> tuple[LaboratoryTest, list[Estimate]]:
    test = ringing_test(RIG, RINGING_SEED)
    return test, live_estimates(test)


@cache
def on_round_edges() -> tuple[LaboratoryTest, list[Estimate]]:
    test = round_edges(RIG, 91000)
    return test, live_estimates(test)


def test_a_wall_that_bends_is_told_while_it_rocks_and_its_r_stays_in_doubt():
    test, estimates = ringing()
    later = [estimate for estimate in estimates if len(estimate.impact_samples) >= 6]

    assert abs(later[-1].eav.r - test.truth["restitution"]) > 0.02
    assert all("the wall bends" in estimate.doubts[0] for estimate in later)


def test_a_wall_that_bends_is_judged_by_the_lvdts_at_its_base_and_no_family_is_called_slow_or_late():
    _, estimates = ringing()
    told = " ".join(doubt for estimate in estimates for doubt in estimate.doubts)

    assert not any(word in told for word in ("impacts take", "hops", "are slow", "late against"))


def test_zero_crossings_that_ringing_moves_are_not_taken_for_a_delay_of_the_wires():
    """They come up to 35 ms after the shocks, and "impact times are off, r is not" would be wrong."""
    mode = {"gain": 0.2, "frequency": 4.6, "zeta": 0.005}
    estimates = live_estimates(SimulatedEffect("flexible_wall", mode, ends_s=0.7).test(RIG, 91000))

    assert "the wall bends" in estimates[-1].doubts[0]
    assert not any("late against" in doubt for estimate in estimates for doubt in estimate.doubts)


@pytest.mark.parametrize(
    ("behind", "named", "lvdts_follow"),
    [(behind_slow_lvdts, "LVDTs are slow", False), (behind_slow_wires, "the wall bends", True)],
)
def test_a_wall_that_bends_is_told_live_behind_a_slow_family(behind, named, lvdts_follow):
    """A first order leaves more between the two families than the ringing, even one too short to be named."""
    test = behind(RIG, 78602)
    last = live_estimates(test)[-1]
    told = " ".join(last.doubts)

    assert abs(last.eav.r - test.truth["restitution"]) > 0.01
    assert "the wall bends" in last.doubts[0] and named in told
    assert ("takes r from the LVDTs" in told) == lvdts_follow


def test_wires_whose_zeros_move_are_told_while_the_wall_rocks():
    """All alike, so that no wire stands out: 0.1 mm/s makes the last r 0.02 to 0.03 wrong."""
    test = drifting_wires(RIG, 91000)
    last = live_estimates(test)[-1]

    assert abs(last.crt.r - test.truth["restitution"]) > 0.02
    assert "wires and LVDTs drift apart by +0.2" in " ".join(last.doubts)


def test_a_survey_whose_alpha_is_not_the_walls_is_told_with_what_it_makes_of_crt():
    _, estimates = on_round_edges()
    (doubt,) = estimates[-1].doubts

    assert "α is −26" in doubt and "CRT" in doubt


def test_doubts_of_the_wall_come_with_the_impact_that_shows_them_and_not_before():
    _, estimates = on_round_edges()
    first = next(estimate for estimate in estimates if estimate.doubts)

    assert len(first.impact_samples) == 8


def test_a_slow_release_is_told_with_the_first_impact():
    estimates = live_estimates(slowly_released(RIG, 91000))

    assert "the release was no clean one" in estimates[0].doubts[0]


@pytest.mark.parametrize("seed", [92000, 92001, 92002])
def test_a_rigid_block_in_an_ordinary_laboratory_raises_no_doubt_while_it_rocks(seed):
    test = draw_test(RIG, seed)

    assert {estimate.doubts for estimate in live_estimates(test)} == {()}


def test_the_last_half_cycles_which_slow_noise_hides_do_not_lead_the_live_r_astray():
    """By what points scatter about a curve alone, the speed before the last impact seems well known."""
    test = draw_test(RIG, 92021)
    errors = [
        abs(estimate.eav.r - test.truth["restitution"])
        for estimate in live_estimates(test)
        if estimate.eav.r is not None
    ]

    assert len(errors) > 10
    assert max(errors) < 0.005


def test_a_wire_that_sticks_is_told_while_the_wall_rocks():
    """The live r, which is that of all wires, is off by it."""
    test = sticking_wire(RIG, 91000)
    later = [estimate for estimate in live_estimates(test) if len(estimate.impact_samples) >= 6]

    assert all(any("wire WP-5 sticks" in doubt for doubt in estimate.doubts) for estimate in later)
