"""Pages of the report's PDF hold whole texts: captions of narrow figures, tables with long words."""

from __future__ import annotations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from daq_app.campaign.report import pdf


def clipped(figure: Figure) -> list[str]:
    """Texts that reach beyond the page."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    right = figure.bbox.width
    return [text.get_text() for text in figure.findobj(Text) if text.get_window_extent(renderer).x1 > right]


def test_a_caption_is_broken_where_its_figure_ends() -> None:
    caption = "Figure 4.4: r by level from classic theory (CRT) and from experimental evidence (EAV)"
    lines = pdf.in_lines(caption, 3.0)
    assert " ".join(lines) == caption
    assert len(lines) > 1 and all(pdf.in_lines(line, 3.0) == [line] for line in lines)
    assert pdf.in_lines(caption, 20.0) == [caption]


@pytest.mark.parametrize("letters", [10, 60])
def test_a_page_is_as_wide_as_its_table(letters: int) -> None:
    row = ["FR1-L3-1", "W" * letters, *["0.8951 ± 0.0001"] * 3, "doubtful", "W" * 54]
    header = ["Test", "Run", "r CRT ± SE", "r EAV ± SE", "r fit ± SE", "Verdict of r", "In the mean"]
    (page,) = pdf._tables("Campaign", "All tests", header, [row])
    assert not clipped(page)
