"""The picture of a test record: rotation, velocity, r of each impact and periods, at the size of the page."""

from __future__ import annotations

import io
from typing import Final

import matplotlib as mpl

from daq_app.campaign.record.parts import Picture
from daq_app.campaign.result.figures import result_figure
from daq_app.campaign.summaries.summary import TestSummary

_SIZE_IN: Final = (6.7, 4.9)
_DPI: Final = 220
_LETTERS: Final = {"font.size": 7.5, "lines.linewidth": 0.9}
_CAPTION: Final = (
    "Rotation θ and angular velocity dθ/dt after the release; coefficient of restitution r of each impact, "
    "with mean and standard error; period T against peak rotation. Dashed: Housner's block with the r of "
    "this test; r_max: 1 − 3/2 sin²α (1.2); theory of the period: (4.1)."
)


def record_picture(test: TestSummary) -> Picture:
    """Drawn for this test alone."""
    buffer = io.BytesIO()
    with mpl.rc_context(_LETTERS):
        figure = result_figure(test, size_in=_SIZE_IN)
        figure.savefig(buffer, format="png", dpi=_DPI)
    return Picture(buffer.getvalue(), _CAPTION)
