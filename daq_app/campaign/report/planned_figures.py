"""Which figures a campaign report has, and with which captions: what draws them is not loaded for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from daq_app.campaign.summaries.summary import TestSummary


@dataclass(frozen=True, slots=True)
class DrawnFigure:
    """A figure as SVG element and as a PDF of one page, with its caption below."""

    name: str
    caption: str
    svg: str
    page: bytes


@dataclass(frozen=True, slots=True)
class PlannedFigure:
    """One figure of the report before it is drawn."""

    number: Literal["4.1", "4.2", "4.3", "4.4"]
    """As in the paper: says what is drawn."""
    name: str
    """Name of the file that the figure is saved under, without its suffix."""
    caption: str
    tests: tuple[TestSummary, ...]
    title: str = ""


def campaign_figures(tests: Sequence[TestSummary]) -> list[PlannedFigure]:
    """Figures 4.1 to 4.4; 4.1 and 4.3 once per specimen for its level with most tests."""
    histories, decays = [], []
    for specimen in dict.fromkeys(test.specimen for test in tests):
        level = _richest_level(tests, specimen)
        wall, file = f"{specimen}-{level}", f"{specimen}_{level}"
        of_level = tuple(test for test in tests if (test.specimen, test.level) == (specimen, level))
        caption = f"Figure 4.1: rotation and angular velocity of {wall}; dashed: the repetition"
        histories.append(PlannedFigure("4.1", f"figure_4_1_{file}", caption, of_level, wall))
        caption = f"Figure 4.3: periods Tₙ and rotations φₙ of {wall} against the impact n"
        decays.append(PlannedFigure("4.3", f"figure_4_3_{file}", caption, of_level, wall))
    caption = "Figure 4.2: period against peak rotation, measured and theory (4.1)"
    periods = PlannedFigure("4.2", "figure_4_2", caption, tuple(tests))
    caption = (
        "Figure 4.4: r by level from classic theory (CRT) and from experimental evidence (EAV); "
        "bars: 95 % of the test's own error"
    )
    restitution = PlannedFigure("4.4", "figure_4_4", caption, tuple(tests))
    return [*histories, periods, *decays, restitution]


def _richest_level(tests: Sequence[TestSummary], specimen: str) -> str:
    """The level with most good tests; of equals the one of larger rotation, as the paper shows L3."""
    of_specimen = [test for test in tests if test.specimen == specimen]
    return max(
        {test.level for test in of_specimen},
        key=lambda level: (sum(t.good for t in of_specimen if t.level == level), level),
    )
