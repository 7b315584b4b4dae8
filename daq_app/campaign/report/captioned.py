"""The figures of a campaign with their captions, and as SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

from daq_app.campaign.report import figures
from daq_app.campaign.summaries.summary import TestSummary

PLAIN_TEXT: Final = {"text.parse_math": False}
"""Setting of matplotlib under which a dollar sign that somebody typed begins no formula."""


@dataclass(frozen=True, slots=True)
class CaptionedFigure:
    """A figure with the file name it is saved under and its caption."""

    name: str
    figure: Figure
    caption: str

    @property
    def svg(self) -> str:
        """The picture as an SVG element that can stand inside a page."""
        buffer = io.StringIO()
        # A fixed salt makes the file depend on the data alone.
        with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": self.name}):
            self.figure.savefig(buffer, format="svg", metadata={"Date": None})
        text = buffer.getvalue()
        return text[text.index("<svg") :]


def campaign_figures(tests: Sequence[TestSummary]) -> list[CaptionedFigure]:
    """Figures 4.1 to 4.4; 4.1 and 4.3 once per specimen for its level with most tests."""
    found: list[CaptionedFigure] = []
    specimens = list(dict.fromkeys(test.specimen for test in tests))
    richest = {specimen: _richest_level(tests, specimen) for specimen in specimens}
    for specimen, level in richest.items():
        of_level = [t for t in tests if (t.specimen, t.level) == (specimen, level)]
        caption = f"Figure 4.1: rotation and angular velocity of {specimen}-{level}; dashed: the repetition"
        picture = figures.histories(of_level, f"{specimen}-{level}")
        found.append(CaptionedFigure(f"figure_4_1_{specimen}_{level}", picture, caption))
    found.append(
        CaptionedFigure(
            "figure_4_2",
            figures.period_against_amplitude(tests),
            "Figure 4.2: period against peak rotation, measured and theory (4.1)",
        )
    )
    for specimen, level in richest.items():
        of_level = [t for t in tests if (t.specimen, t.level) == (specimen, level)]
        caption = f"Figure 4.3: periods Tₙ and rotations φₙ of {specimen}-{level} against the impact n"
        picture = figures.decay(of_level, f"{specimen}-{level}")
        found.append(CaptionedFigure(f"figure_4_3_{specimen}_{level}", picture, caption))
    found.append(
        CaptionedFigure(
            "figure_4_4",
            figures.restitution_by_level(tests),
            "Figure 4.4: r by level from classic theory (CRT) and from experimental evidence (EAV); "
            "bars: 95 % of the test's own error",
        )
    )
    return found


def _richest_level(tests: Sequence[TestSummary], specimen: str) -> str:
    """The level with most good tests; of equals the one of larger rotation, as the paper shows L3."""
    of_specimen = [test for test in tests if test.specimen == specimen]
    return max(
        {test.level for test in of_specimen},
        key=lambda level: (sum(t.good for t in of_specimen if t.level == level), level),
    )
