"""What belongs to the survey and not to the LVDTs, and what belongs to one LVDT and to no effect on it."""

from __future__ import annotations

import numpy as np
import pytest

from daq_app.gap.rocking_model.records import GapRun
from daq_app.gap.rocking_model.study import diagnose_runs
from tests.support.gap.simulated_campaign import Effects, simulate


def runs_with(effects: Effects, *, lvdts: float = 1.0, crosstalk: float = 0.0) -> list[GapRun]:
    """Six runs whose LVDTs read `lvdts` times what they should, and LV-B02 a share of WP-1 as well."""
    runs = simulate(effects, 31)
    place = {sensor.id: i for i, sensor in enumerate(runs[0].sensors)}
    for run in runs:
        for i, sensor in enumerate(run.sensors):
            if sensor.family == "lvdt":
                run.channels[i] *= lvdts
        run.channels[place["LV-B02"]] += crosstalk * run.channels[place["WP-1"]]
    return runs


@pytest.mark.parametrize("share", [0.012, -0.012])
def test_faces_that_stand_further_apart_than_surveyed_are_no_gain_of_the_lvdts(share: float) -> None:
    result = diagnose_runs(runs_with({}, lvdts=1.0 + share))
    assert result.decision.verdict in ("parameters", "nothing_missing")
    faces = next(p for p in result.parameters if p.name == "faces")
    assert faces.value == pytest.approx(share, abs=0.004)


def test_lvdts_that_are_off_by_more_than_a_survey_is_are_named() -> None:
    result = diagnose_runs(runs_with({}, lvdts=1.06))
    assert result.decision.effects == ("gain@lvdt",)


@pytest.mark.parametrize(
    ("crosstalk", "first"), [(0.03, ("residual_cable",)), (0.04, ("gain@LV-B02", "residual_cable"))]
)
def test_an_lvdt_that_shows_a_wire_as_well_has_no_gain_even_beside_a_strong_cause(
    crosstalk: float, first: tuple[str, ...]
) -> None:
    """It shows the wire on the closed side too: what is left of it there is little beside what explains."""
    result = diagnose_runs(runs_with({"residual_cable": {"k": 0.05}}, crosstalk=crosstalk))
    assert result.which[0].effects == first
    assert result.rest.share < 0.3
    assert result.decision.verdict == "none_of_these"
    assert "LV-B02" in result.decision.sentence


def test_a_wire_that_cannot_follow_is_something_unknown_even_beside_a_strong_cause() -> None:
    """Its drum takes it up at 75 mm/s at most, which no effect of the library does."""
    runs = runs_with({"bounce": {"tau": 0.008}})
    for run in runs:
        place = next(i for i, sensor in enumerate(run.sensors) if sensor.id == "WP-4")
        readings = run.channels[place]
        climb = 0.075 * np.arange(readings.size) / run.rate_hz
        run.channels[place] = np.minimum.accumulate(readings - climb) + climb
    result = diagnose_runs(runs)
    assert result.rest.share < 0.3
    assert result.decision.verdict == "none_of_these"
    assert "WP-4" in result.decision.sentence
