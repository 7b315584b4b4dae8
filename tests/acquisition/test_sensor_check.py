"""Each fault that a sensor can have at rest or in a pull is found, named, and blamed on no other channel."""

from __future__ import annotations

import dataclasses
import datetime as dt

import numpy as np
import pytest

from daq_app.acquisition.checks.check_model import Verdict
from daq_app.acquisition.checks.pull_check import PullTooSmall, check_pull, expected_change
from daq_app.acquisition.checks.sensor_check import Conditions, check_at_rest
from daq_app.config.loader import load_rig
from daq_app.config.scaling import Scaling

RATE = 4000.0


@pytest.fixture(scope="module")
def rig(configs):
    return load_rig(configs / "fr1.toml")


@pytest.fixture
def conditions():
    return Conditions(
        rate_hz=RATE, planned_rate_hz=RATE, free_bytes=10**11, today=dt.date(2026, 11, 21), tare={}
    )


@pytest.fixture
def quiet(rig):
    """(n_channels, 2 s) of healthy sensors at rest, quantised as a 16-bit module does."""
    rng = np.random.default_rng(7)
    noise = np.array([channel.noise_si for channel in rig.channels])[:, None]
    scaling = Scaling.of(rig.channels)
    readings = scaling.to_readings(noise * rng.normal(size=(len(rig.channels), int(2 * RATE))))
    step = np.array([(c.input_range_v[1] - c.input_range_v[0]) / 2**16 for c in rig.channels])[:, None]
    return scaling.to_si(np.round(readings / step) * step)


def row_of(rig, name):
    return rig.channel_ids.index(name)


def in_volts(rig, si, name, volts):
    """`si` with one channel's reading replaced."""
    channel = rig.channel(name)
    out = si.copy()
    wanted = np.broadcast_to(np.asarray(volts, dtype=float), (1, si.shape[1]))
    out[row_of(rig, name)] = Scaling.of([channel]).to_si(wanted)[0]
    return out


def codes(check):
    return {c.channel_id: [f.code for f in c.findings] for c in check.channels if c.findings}


def test_healthy_sensors_are_go(rig, quiet, conditions):
    check = check_at_rest(rig, quiet, conditions)
    assert check.verdict is Verdict.GO, codes(check)
    assert check.summary == "All 41 channels are good at rest."
    ratios = [c.noise_si / c.expected_noise_si for c in check.channels]
    assert 0.9 < min(ratios) <= max(ratios) < 1.1


TIME = np.arange(int(2 * RATE)) / RATE


@pytest.mark.parametrize(
    ("name", "fault", "code", "verdict"),
    [
        ("LV-A03", lambda rig, si: in_volts(rig, si, "LV-A03", 9.99), "saturated", Verdict.NO_GO),
        ("WP-2", lambda rig, si: in_volts(rig, si, "WP-2", -9.999), "saturated", Verdict.NO_GO),
        ("WP-3", lambda rig, si: in_volts(rig, si, "WP-3", 0.0), "range", Verdict.NO_GO),
        ("AC-4", lambda rig, si: in_volts(rig, si, "AC-4", 0.0), "stuck", Verdict.NO_GO),
        (
            "TL-1X",
            lambda rig, si: in_volts(rig, si, "TL-1X", 1e-4 * np.sign(np.sin(TIME))),
            "silent",
            Verdict.NO_GO,
        ),
    ],
)
def test_a_dead_channel_is_no_go_and_alone(rig, quiet, conditions, name, fault, code, verdict):
    check = check_at_rest(rig, fault(rig, quiet), conditions)
    assert codes(check) == {name: [code]}
    assert check.verdict is verdict
    assert "1 of 41" in check.summary


@pytest.mark.parametrize(
    ("times", "code", "verdict"),
    [(5.0, "noise", Verdict.CAUTION), (30.0, "noise", Verdict.NO_GO)],
)
def test_noise_is_judged_against_the_expected_figure(rig, quiet, conditions, times, code, verdict):
    quiet[row_of(rig, "LV-B07")] *= times
    check = check_at_rest(rig, quiet, conditions)
    assert codes(check) == {"LV-B07": [code]}
    assert check.verdict is verdict


@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_mains_hum_is_told_from_noise(rig, quiet, conditions, mains):
    row = row_of(rig, "WP-5")
    quiet[row] += 6 * np.sqrt(2) * rig.channels[row].noise_si * np.sin(2 * np.pi * mains * TIME + 0.4)
    check = check_at_rest(rig, quiet, conditions)
    assert codes(check) == {"WP-5": ["hum"]}
    assert f"{mains:g} Hz" in check.channels[row].text
    assert check.channels[row].hum_si == pytest.approx(6 * rig.channels[row].noise_si, rel=0.05)
    assert check.channels[row].noise_si == pytest.approx(rig.channels[row].noise_si, rel=0.1)


def test_what_belongs_to_the_rig(rig, quiet, conditions):
    wrong = dataclasses.replace(conditions, rate_hz=4266.67, free_bytes=10**9, overloaded=frozenset({"AC-1"}))
    long_enough = np.concatenate((quiet, quiet), axis=1)
    check = check_at_rest(rig, long_enough, wrong)
    assert [f.code for f in check.rig_findings] == ["rate", "disk"]
    assert codes(check) == {"AC-1": ["saturated"]}
    assert check.verdict is Verdict.NO_GO


def test_a_calibration_that_ran_out_is_no_go_and_one_that_will_is_a_caution(rig, quiet, conditions):
    due = rig.channels[0].certificate.due
    late = check_at_rest(rig, quiet, dataclasses.replace(conditions, today=due + dt.timedelta(days=1)))
    assert late.channels[0].verdict is Verdict.NO_GO
    soon = check_at_rest(rig, quiet, dataclasses.replace(conditions, today=due - dt.timedelta(days=3)))
    assert soon.channels[0].verdict is Verdict.CAUTION
    assert "calibration" in codes(soon)["LV-A01"]


def test_the_tare_does_not_hide_a_dead_sensor(rig, quiet, conditions):
    """A wire at 0 V is out of range, however often it has been zeroed."""
    dead = in_volts(rig, quiet, "WP-1", 0.001)
    tared = dataclasses.replace(conditions, tare={"WP-1": -4.999})
    dead[row_of(rig, "WP-1")] -= dead[row_of(rig, "WP-1")].mean()
    assert "WP-1" in codes(check_at_rest(rig, dead, tared))


# -- the pull test -------------------------------------------------------------------------------


@pytest.fixture
def at_rest(rig, quiet, conditions):
    return check_at_rest(rig, quiet, conditions)


@pytest.mark.parametrize("theta", [0.02, -0.02, 0.075])
def test_a_healthy_pull_is_go_and_gives_the_rotation(rig, at_rest, theta):
    rng = np.random.default_rng(1)
    noise = np.array([c.noise_si for c in rig.channels])
    check = check_pull(rig, at_rest, expected_change(rig, theta) + 0.3 * noise * rng.normal(size=noise.size))
    assert check.verdict is Verdict.GO, codes(check)
    assert check.pull_rotation_rad == pytest.approx(theta, rel=0.02)


def test_a_pivot_that_moved_inwards_is_no_fault(rig, at_rest):
    """A wall on mortar turns about a line 33 mm inside its edge: the LVDTs see it, and it is physics."""
    theta, inset = 0.05, 0.033
    change = expected_change(rig, theta)
    for row, channel in enumerate(rig.channels):
        if channel.family == "lvdt":
            change[row] -= inset * np.sin(theta)
    assert check_pull(rig, at_rest, change).verdict is Verdict.GO


@pytest.mark.parametrize("name", ["LV-A05", "WP-1", "TL-2X"])
@pytest.mark.parametrize(
    ("factor", "code"), [(-1.0, "pull-polarity"), (0.0, "pull-still"), (1.6, "pull-disagrees")]
)
def test_a_faulty_channel_is_found_in_the_pull(rig, at_rest, name, factor, code):
    change = expected_change(rig, 0.03)
    change[row_of(rig, name)] *= factor
    assert codes(check_pull(rig, at_rest, change)) == {name: [code]}


@pytest.mark.parametrize(("one", "two"), [("WP-1", "WP-2"), ("LV-A01", "LV-B01"), ("TL-1X", "TL-1Y")])
def test_exchanged_plugs_are_named_together(rig, at_rest, one, two):
    change = expected_change(rig, 0.03)
    rows = [row_of(rig, one), row_of(rig, two)]
    change[rows] = change[rows[::-1]]
    check = check_pull(rig, at_rest, change)
    assert codes(check) == {one: ["pull-swapped"], two: ["pull-swapped"]}
    assert two in check.channels[rows[0]].text


def test_too_small_a_pull_is_refused_in_words(rig, at_rest):
    with pytest.raises(PullTooSmall, match=r"1\.0 mrad only; pull it to at least 4 mrad"):
        check_pull(rig, at_rest, expected_change(rig, 0.001))


def test_a_repeated_pull_forgets_the_findings_of_the_last(rig, at_rest):
    change = expected_change(rig, 0.03)
    bad = change.copy()
    bad[row_of(rig, "WP-4")] = 0
    first = check_pull(rig, at_rest, bad)
    assert check_pull(rig, first, change).verdict is Verdict.GO
