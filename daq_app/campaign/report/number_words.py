"""Numbers of a report in words: digits, signs, and a dash for what is not known."""

from __future__ import annotations

import math

from daq_app.campaign.report.statistics import GroupMean
from daq_app.config import wording


def number(value: float, digits: int) -> str:
    """With so many digits; a dash for what is not known."""
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def signed(value: float) -> str:
    """A change, always with its sign."""
    return wording.signed(value, "+.4f")


def interval(group: GroupMean) -> str:
    """The 95 % interval of a mean; a dash where it has none."""
    if math.isnan(group.low95):
        return "–"
    return f"{number(group.low95, 4)} … {number(group.high95, 4)}"
