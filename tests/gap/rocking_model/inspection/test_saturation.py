"""Channels that stop short of their declared range are found; late or drifting ones do not stop short."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from daq_app.gap.rocking_model.findings import findings_of
from daq_app.gap.rocking_model.inspection.saturation import saturated
from daq_app.gap.rocking_model.study import prepare
from tests.support.gap.conditions import conditions_found
from tests.support.simulated_wall import simulate


def test_a_family_that_stops_short_of_its_range_is_found_and_the_motion_read_elsewhere() -> None:
    runs = prepare(simulate({"saturation@lvdt": {"limit": 0.04}}, (0.25, -0.35)))[0]
    assert conditions_found(runs) == {"saturation@lvdt"}
    by_amplitude = sorted(runs, key=lambda run: abs(run.swings.peak_rad[0]))
    (mark,) = (f.value for f in by_amplitude[-1].findings if f.key == "saturation@lvdt")
    assert 1.0 / mark == pytest.approx(0.04, rel=0.03)
    assert by_amplitude[-1].reference == "wire"


def test_a_limit_is_found_where_the_other_side_travels_further_from_a_zero_that_is_off() -> None:
    """A wire stops at a reading: with a zero of 20 mm it clips after 150 mm to one side only."""
    runs = simulate({}, (0.35,))
    place = next(i for i, sensor in enumerate(runs[0].sensors) if sensor.id == "WP-4")
    raw = runs[0].channels[place]
    other_way = 0.155 / float(np.abs(raw[-400:].mean() - raw.min()))
    centred = raw - raw[-400:].mean()
    runs[0].channels[place] = np.minimum(np.where(centred < 0, other_way * centred, centred) + 0.02, 0.17)
    assert conditions_found(prepare(runs)[0]) == {"saturation@WP-4"}


@pytest.mark.parametrize("name", ["LV-A06", "WP-3"])
def test_one_channel_that_comes_late_does_not_stop_short(name: str) -> None:
    """Its family is in time: it stands at its top while the rotation has gone on."""
    _, findings = saturated(simulate({f"lag@{name}": {"tau": 0.07}}, (0.4,)))
    assert [finding.value for finding in findings[0]] == [0.0, 0.0]


@pytest.mark.parametrize("fault", [{"lag@lvdt": {"tau": 0.049}}, {"slow_response@wire": {"tau": 0.047}}])
def test_a_family_that_comes_late_does_not_make_the_other_stop_short(
    fault: dict[str, dict[str, float]],
) -> None:
    """Held against a rotation that has not begun to fall, a channel seems to stand still at its top."""
    _, findings = saturated(simulate(fault, (0.4,)))
    assert [finding.value for finding in findings[0]] == [0.0, 0.0]


def test_what_ends_one_face_ends_the_other_that_hardly_gets_there() -> None:
    """A top cut by 2 % does not look flat, yet bends the rotation of whoever reads it."""
    (plain,) = simulate({}, (0.4,))
    rest = plain.channels[plain.indices("lvdt"), -400:].mean(axis=1, keepdims=True)
    tops = (plain.channels[plain.indices("lvdt")] - rest).max(axis=1)
    second = min(tops[:12].max(), tops[12:].max())
    (run,), findings = saturated(simulate({"saturation@lvdt": {"limit": 0.98 * second}}, (0.4,)))
    assert 1.0 / findings[0][0].value == pytest.approx(0.98 * second, rel=0.01)
    ends = {run.sensors[i].id: run.sensors[i].range_si[1] for i in run.indices("lvdt")}
    assert len(ends) == 24
    assert max(ends.values()) < 0.99 * second


def test_wires_that_drift_do_not_make_lvdts_stop_short() -> None:
    """1.3 mrad in all of a record, and a hop of the wall at each impact."""
    fault = {"drift@wire": {"rate": -2.4e-3}, "bounce": {"tau": 0.0095}}
    _, findings = saturated(simulate(fault, (0.4,)))
    assert [finding.value for finding in findings[0]] == [0.0, 0.0]


def test_an_accelerometer_that_clips_its_shocks_is_found_and_left_out() -> None:
    """Far inside its range; one that clips at its range, and sound ones beside it, are not."""
    runs = []
    for run in simulate({}, (0.35, -0.4)):
        channels, sensors = run.channels.copy(), list(run.sensors)
        for name, share in (("AC-3", 0.4), ("AC-7", 0.5)):
            place = run.place(name)
            limit = share * float(np.abs(channels[place]).max())
            channels[place] = np.clip(channels[place], -limit, limit)
            if name == "AC-7":
                sensors[place] = replace(sensors[place], range_si=(-limit, limit))
        runs.append(replace(run, channels=channels, sensors=tuple(sensors)))
    prepared = prepare(runs)[0]
    assert conditions_found(prepared) == {"saturation@AC-3"}
    (found,) = (f for f in findings_of(prepared) if f.name == "saturation@AC-3")
    assert found.unit == "m/s²" and found.material
    assert "AC-3 goes no further than" in found.words
