"""Tiltmeters that show something else than the rotation behind a response of first order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.features.response import first_order
from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, coarse, mean_rotation
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun
from daq_app.gap.rocking_model.study import diagnose_runs, prepare
from tests.support.gap.conditions import conditions_found
from tests.support.simulated_wall import declared_slow, simulate

LEVELS = (0.25, -0.35)
RIG_S = 0.3


def _changed(
    runs: list[GapRun], name: str, change: Callable[[GapRun, FloatArray], FloatArray]
) -> list[GapRun]:
    """The runs with another reading of one channel."""
    made = []
    for run in runs:
        channels = run.channels.copy()
        channels[run.place(name)] = change(run, channels[run.place(name)])
        made.append(replace(run, channels=channels))
    return made


def _with_acceleration(share: float, name: str) -> Callable[[GapRun, FloatArray], FloatArray]:
    def change(run: GapRun, values: FloatArray) -> FloatArray:
        rotation = mean_rotation(run)
        assert rotation is not None
        theta = coarse(rotation, run.rate_hz)
        speed = np.gradient(theta, 1.0 / GRID_HZ)
        # The response to an acceleration is the change of that to its speed.
        of_acceleration = (speed - first_order(speed, RIG_S)) / RIG_S
        height = run.sensors[run.place(name)].position_m[2]
        felt = -share * height / GRAVITY_M_S2 * of_acceleration
        at = np.arange(values.size) / run.rate_hz
        return np.asarray(values + np.interp(at, (np.arange(theta.size) + 0.5) / GRID_HZ, felt))

    return change


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_a_tiltmeter_that_feels_acceleration_is_named_with_its_share_and_not_used(share: float) -> None:
    runs = _changed(simulate({}, LEVELS), "TL-2X", _with_acceleration(share, "TL-2X"))
    prepared, _ = prepare(runs)
    assert conditions_found(prepared) == {"acceleration@TL-2X"}
    (finding,) = findings_of(prepared)
    assert finding.material
    assert finding.size == pytest.approx(share, rel=0.1)
    assert finding.explained and finding.unknown == 0.0
    assert finding.words.startswith(f"TL-2X feels {100 * share:.0f} % ")
    block = next(b for b in prepared[0].blocks if b.family == "tiltmeter")
    assert len(block.time_constants_s) == 1, "the other one is used"


def test_tiltmeters_that_feel_acceleration_are_named_and_hide_no_cause() -> None:
    """A pendulum or a fluid does so; all of a laboratory's tiltmeters may be of that kind."""
    runs = simulate({}, LEVELS)
    for name in ("TL-1X", "TL-2X"):
        runs = _changed(runs, name, _with_acceleration(1.0, name))
    result = diagnose_runs(runs, only=("restitution_slope",))
    assert result.decision.effects == ("acceleration@TL-1X", "acceleration@TL-2X")
    assert "TL-1X feels" in result.decision.sentence and result.rest.unknown < 0.5


def test_a_tiltmeter_that_flattens_what_it_shows_is_odd_without_acceleration() -> None:
    runs = _changed(simulate({}, LEVELS), "TL-1X", lambda _, values: 0.03 * np.tanh(values / 0.03))
    prepared, _ = prepare(runs)
    assert conditions_found(prepared) == {"unlike@TL-1X"}
    (finding,) = findings_of(prepared)
    assert finding.unknown > 0.5
    assert "TL-1X" in finding.words


@pytest.mark.parametrize("effect", [{"slow_response@lvdt": {"tau": 0.03}}, {"lag@wire": {"tau": 0.03}}, {}])
@pytest.mark.parametrize("declared_s", [0.05, RIG_S, 0.6])
def test_sound_tiltmeters_of_any_time_constant_are_not_blamed(
    effect: dict[str, dict[str, float]], declared_s: float
) -> None:
    """A family that is slow or late makes them look odd against its rotation, and not against the other."""
    prepared, _ = prepare(declared_slow(simulate(effect, LEVELS), declared_s))
    assert not [key for key in conditions_found(prepared) if key.startswith(("acceleration", "unlike"))]
