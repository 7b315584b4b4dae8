"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest

from daq_app.config.wording import plus_minus, true_minus


@pytest.mark.parametrize(
    ("error", "decimals", "text"),
    [
        (0.0021, 4, "± 0.0021"),
        (0.00005, 4, "± 0.0001"),
        (0.000049, 4, "± < 0.0001"),
        (0.0, 4, "± < 0.0001"),
        (0.004, 2, "± < 0.01"),
        (None, 4, ""),
        (math.nan, 4, ""),
    ],
)
def test_an_error_never_reads_as_certainty(error, decimals, text):
    assert plus_minus(error, decimals) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("held steady at -77.8 mrad", "held steady at −77.8 mrad"),
        ("planned towards -x", "planned towards −x"),
        ("WP-1 (-10 to -.5 mm) of FR1-L1-1, 2026-11-25", "WP-1 (−10 to −.5 mm) of FR1-L1-1, 2026-11-25"),
        ("AC-x of 1e-05, no-go", "AC-x of 1e-05, no-go"),
    ],
)
def test_a_minus_sign_is_one_and_a_hyphen_stays(text, shown):
    assert true_minus(text) == shown
