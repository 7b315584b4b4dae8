"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest

from daq_app.config.wording import plus_minus


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
