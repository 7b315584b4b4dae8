"""Play of the wires' drums, where the motion is read from them: falls seem to begin late."""

from __future__ import annotations

import pytest

from daq_app.gap.core import Diagnosis
from daq_app.gap.rocking_model.inspection.inspect_runs import found_channels
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.gap.play import behind
from tests.support.simulated_wall import simulate

LEVELS = (0.25, -0.35, 0.45)


def _diagnosed(play_m: float) -> tuple[Diagnosis, float]:
    """The diagnosis of late LVDTs beside wires with that play, and the play in the rotation of the wires."""
    runs = simulate({"lag@lvdt": {"tau": 0.02}}, LEVELS)
    wires = runs[0].indices("wire")
    heights = runs[0].positions(wires)[:, 2]
    for run in runs:
        for i in wires:
            run.channels[i] = behind(run.channels[i], play_m, run.rate_hz)
    result = diagnose_runs(runs, only=("lag@lvdt", "gain@lvdt"))
    return result, play_m * float(heights.sum() / (heights @ heights))


@pytest.mark.parametrize("play_m", [0.0, 2e-4])
def test_play_is_estimated_and_hides_no_cause(play_m: float) -> None:
    result, play_rad = _diagnosed(play_m)
    found = next(p for p in result.parameters if p.name == "wire_play")
    assert found.value == pytest.approx(play_rad, abs=2e-5)
    assert result.decision.effects == ("lag@lvdt",)
    assert result.rest.unknown < 0.1


def test_the_lowest_wire_is_allowed_as_much_play_as_the_others() -> None:
    """What a drum holds back is a length, which lasts longest in the wire that travels least."""
    runs = simulate({}, (0.25, -0.35, -0.3, 0.4))
    for run in runs:
        lowest = run.place("WP-1")
        run.channels[lowest] = behind(run.channels[lowest], 2.5e-4, run.rate_hz)
    assert found_channels(prepare(runs)[0]) == {}
