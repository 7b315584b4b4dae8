"""Campaigns of drawn laboratories: what is kept from test to test, and how often stated intervals hold."""

from __future__ import annotations

from pathlib import Path

import pytest

from daq_app.config import load_rig
from studies.restitution.campaigns import TEST_SCATTERS, Campaign, draw_campaign, table
from studies.restitution.laboratory import draw_test

RIG = load_rig(Path(__file__).parents[2] / "configs" / "fr1.toml")


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return draw_campaign(RIG, 500, ("FR1-L3-1", "FR1-L3-2", "FR1-L3-R"))


def test_tests_of_a_laboratory_share_calibration_clock_and_r_but_no_noise():
    first, second = (draw_test(RIG, seed, laboratory=500) for seed in (500000, 500001))
    other = draw_test(RIG, 500000, laboratory=501)

    def gain(test):
        """Of the last wire against the one before it, which is as high."""
        one, other = (
            row - row[: round(0.5 * test.rate_hz)].mean() for row in test.si[test.rows("wire")[-2:]]
        )
        return one @ other / (one @ one)

    assert first.offsets_s == second.offsets_s != other.offsets_s
    assert first.truth["restitution"] == second.truth["restitution"] != other.truth["restitution"]
    assert first.truth["alpha_rad"] == second.truth["alpha_rad"] != other.truth["alpha_rad"]
    assert gain(first) == pytest.approx(gain(second), abs=4e-4)
    assert abs(gain(first) - gain(other)) > 1e-3
    assert abs(first.truth["theta0_rad"]) != abs(second.truth["theta0_rad"])


def test_the_table_tells_of_each_interval_that_the_report_states_how_often_it_holds(campaign: Campaign):
    head, *lines = table([campaign], draws=2)

    assert "holds" in head and "half width" in head
    for what in ("mean", "corrected", "change"):
        for method in ("CRT", "EAV", "fit"):
            assert sum(line.startswith(f"{what} {method}") for line in lines) == len(TEST_SCATTERS)
    assert all("%" in line for line in lines)


def test_what_r_does_from_test_to_test_is_put_on_what_was_found(campaign: Campaign):
    one, other, repeated = campaign.scattered([1.0, 1.01, 0.99])

    assert one.methods["EAV"].r == campaign.tests[0].methods["EAV"].r
    assert other.methods["CRT"].r == pytest.approx(1.01 * campaign.tests[1].methods["CRT"].r)
    assert repeated.methods["fit"].r == pytest.approx(0.99 * campaign.tests[2].methods["fit"].r)
