"""Walls that slide or turn on their base at impacts, which wires show and LVDTs do not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq_app.config import load_rig
from daq_app.rocking import AnalysisOptions, TestAnalysis, analyse_record
from daq_app.rocking.families.base.steps import base_steps
from studies.restitution.laboratory import LaboratoryTest, draw_test
from studies.restitution.walls import mean_r_of_impacts

RIG = load_rig(Path(__file__).parents[2] / "configs" / "fr1.toml")
SEED = 6301
OPTIONS = AnalysisOptions(fit=False, bias_runs=0, keep_series=False)


def drawn(effects: dict[str, dict[str, float]], seed: int = SEED) -> tuple[LaboratoryTest, TestAnalysis]:
    test = draw_test(RIG, seed, effects=effects)
    return test, analyse_record(test.record(), OPTIONS)


def warned(analysis: TestAnalysis) -> list[tuple[str, str]]:
    return [(f.family, f.kind) for f in analysis.findings if f.severity == "warning"]


@pytest.mark.parametrize("slip_m_s", [0.002, 0.006, 0.02])
def test_r_of_a_wall_that_slides_at_its_impacts_is_that_of_the_lvdts(slip_m_s: float) -> None:
    """With the wires r is up to 0.009 off; they lean, drift and leap by what is the wall's."""
    test, analysis = drawn({"sliding": {"c": slip_m_s}})

    assert warned(analysis) == [("wires", "slide")]
    (finding,) = [f for f in analysis.findings if f.kind == "slide"]
    largest = slip_m_s * np.abs(test.truth["velocity_before_rad_s"]).max()
    assert finding.size == pytest.approx(largest, rel=0.2)
    assert "slides" in finding.text and finding.treatment == "left out"
    assert analysis.verdict.trust == "remarks"
    assert analysis.verdict.used == ("LVDTs",)
    assert analysis.verdict.r == pytest.approx(mean_r_of_impacts(test), abs=0.0015)


@pytest.mark.parametrize("turn_rad", [0.0002, 0.002])
@pytest.mark.parametrize("seed", [SEED, 78400])
def test_a_base_that_gives_way_steps_by_as_much_at_slow_impacts_as_at_fast_ones(
    turn_rad: float, seed: int
) -> None:
    """With the wires r is up to 0.07 off, and a drift or a hop seems to be the cause."""
    test, analysis = drawn({"compliance": {"phi": turn_rad}}, seed)

    assert [(family, kind) for family, kind in warned(analysis) if family != "wall"] == [("wires", "slide")]
    assert analysis.verdict.used == ("LVDTs",)
    assert analysis.verdict.r == pytest.approx(mean_r_of_impacts(test), abs=0.0015)


def test_r_of_a_wall_that_slides_is_doubted_where_the_lvdts_do_not_reach_far_enough() -> None:
    test = draw_test(RIG, SEED, effects={"sliding": {"c": 0.006}})
    rows = [k for k, channel in enumerate(RIG.channels) if channel.family == "lvdt"]
    short = 0.7 * test.si[rows].max()
    si = test.si.copy()
    si[rows] = np.minimum(si[rows], short)
    channels = tuple(
        channel.model_copy(update={"range_si": (channel.range_si[0], short)})
        if channel.family == "lvdt"
        else channel
        for channel in RIG.channels
    )
    rig = RIG.model_copy(update={"channels": channels})

    analysis = analyse_record(replace(test, rig=rig, si=si).record(), OPTIONS)

    assert ("wires", "slide") in warned(analysis)
    assert analysis.verdict.trust == "doubtful"


@pytest.mark.parametrize("turn_s", [0.002, -0.006])
def test_a_wall_that_turns_about_the_vertical_is_told_and_no_wire_is_blamed(turn_s: float) -> None:
    test, analysis = drawn({"corner_twist": {"c": turn_s}})

    assert warned(analysis) == [("wall", "turn")]
    assert analysis.verdict.trust == "remarks"
    assert analysis.verdict.r == pytest.approx(mean_r_of_impacts(test), abs=0.0015)


@pytest.mark.parametrize("late_s", [0.002, 0.03])
def test_wires_that_are_late_do_not_slide(late_s: float) -> None:
    _, analysis = drawn({"lag@wire": {"tau": late_s}})

    assert {family for family, _ in warned(analysis)} == {"wires"}
    assert not {"slide", "turn"} & {f.kind for f in analysis.findings}


def test_steps_without_a_relation_to_speed_are_none_of_the_base() -> None:
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, 8.0, 1e-3)
    rotation = 0.05 * np.exp(-time_s / 4.0) * np.cos(2.0 * np.pi * time_s)
    impacts = np.arange(0.25, 8.0, 0.5)
    places = np.array([0.0, -0.5, 0.5])
    square = np.cumsum(np.isin(np.arange(time_s.size), np.searchsorted(time_s, impacts)))
    slope = np.gradient(rotation, time_s)
    at = slope[np.searchsorted(time_s, impacts)]
    slides = np.concatenate([[0.0], np.cumsum(2e-3 * at)])[square]
    scatter = np.concatenate([[0.0], np.cumsum(rng.normal(0.0, 5e-4, impacts.size))])[square]

    by_speed = base_steps(time_s, rotation, np.tile(slides, (3, 1)), places, impacts)
    by_chance = base_steps(time_s, rotation, np.tile(scatter, (3, 1)), places, impacts)
    turning = base_steps(time_s, rotation, places[:, None] * slides, places, impacts)

    assert by_speed.slide_m == pytest.approx(2e-3 * np.abs(at).max(), rel=0.02)
    assert by_speed.turn_rad == 0.0
    assert (by_chance.slide_m, by_chance.turn_rad) == (0.0, 0.0)
    assert turning.slide_m == 0.0
    assert turning.turn_rad == pytest.approx(2e-3 * np.abs(at).max(), rel=0.02)


@pytest.mark.parametrize("wire", ["WP-3", "WP-4"])
def test_one_wire_whose_drum_swings_makes_no_wall_slide_or_turn(wire: str) -> None:
    _, analysis = drawn({f"wire_inertia@{wire}": {"frequency": 15.0}})

    assert not {"slide", "turn"} & {f.kind for f in analysis.findings}


@pytest.mark.parametrize("seed", [78502, 78503])
def test_one_wire_whose_drum_swings_fast_is_late_and_the_wall_does_not_hop(seed: int) -> None:
    """A drum at 25 Hz is 2.5 ms late; its ringing moves crossings as a hop of the wall does."""
    _, analysis = drawn({"wire_inertia@WP-3": {"frequency": 25.0}}, seed)

    assert warned(analysis) == [("wires", "late")]
    (finding,) = [f for f in analysis.findings if f.severity == "warning"]
    assert finding.channels == ("WP-3",)


def test_one_lvdt_that_is_late_makes_no_wall_slide() -> None:
    """It turns the rotation of the LVDTs at impacts, and wires seem to step."""
    _, analysis = drawn({"filter_delay@LV-A03": {"tau": 0.005}})

    assert warned(analysis) == [("LVDTs", "late")]
