"""Parts of the campaign report as PDF: the same tables and figures as the page."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import accumulate, chain
from typing import Any, Final

import matplotlib as mpl
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.transforms import Bbox

from daq_app.campaign.captioned import PLAIN_TEXT, CaptionedFigure
from daq_app.campaign.report import tables
from daq_app.campaign.report.number_words import interval, number, signed
from daq_app.campaign.summaries.summary import Failure, TestSummary
from daq_app.config.shown_text import one_line

_ROWS = 40
"""Rows of a table on one page."""
_WIDTH = 54
"""Characters of a remark on one line."""
_LINE: Final = 0.26
"""Height of a line of a table, inches."""
_GAP: Final = 0.35
_MARGIN: Final = 0.4
_PAGE: Final = 11.0
"""Width of a page of a table, inches; wider only where its columns are."""
_FONT: Final = FontProperties(size=9)
_HEADER_FONT: Final = FontProperties(size=9, weight="bold")


def first_pages(
    title: str, restitution: Sequence[tables.RestitutionRow], repetitions: Sequence[tables.RepetitionRow]
) -> bytes:
    """What stands before the figures: Table 4.1 and the effect of the repetitions."""
    pages = [_tables(title, "Table 4.1: coefficient of restitution", *_restitution_rows(restitution))]
    if repetitions:
        pages.append(_tables(title, "Effect of the repetitions", *_repetition_rows(repetitions)))
    return _document(title, chain(*pages))


def last_pages(
    title: str,
    places: Sequence[tables.PlaceRow],
    tests: Sequence[TestSummary],
    failures: Sequence[Failure],
) -> bytes:
    """What stands behind the figures: Table 3.2, all tests, and the runs without an analysis."""
    pages = [
        _tables(title, "Table 3.2: sequence and status", *_place_rows(places)),
        _tables(title, "All tests", *_test_rows(tests)),
    ]
    if failures:
        rows = [[failure.test, failure.path.name, _wrapped(failure.reason)] for failure in failures]
        pages.append(_tables(title, "Not analysed", ["Test", "Run", "Why"], rows))
    return _document(title, chain(*pages))


def figure_page(picture: CaptionedFigure) -> bytes:
    """A page with a figure and its caption, which is added to the figure."""
    figure = picture.figure
    width, height = figure.get_size_inches()
    caption = in_lines(picture.caption, 0.98 * width)
    figure.text(0.02, -0.02, "\n".join(caption), fontsize=9, va="top")
    # Room for the caption below: a tight box would lay out and draw everything once more to find it.
    low = -0.6 - 0.2 * len(caption)
    box = Bbox([[-_MARGIN, low], [width + _MARGIN, height + _MARGIN]])
    return _document(picture.name, [figure], bbox_inches=box)


def _document(title: str, pages: Iterable[Figure], **how: Any) -> bytes:
    """The pages in their order; each is made when its turn comes, with `how` as `savefig` takes it."""
    buffer = io.BytesIO()
    with mpl.rc_context(PLAIN_TEXT), PdfPages(buffer, metadata={"Title": title}) as document:
        for page in pages:
            document.savefig(page, **how)
    return buffer.getvalue()


def _restitution_rows(rows: Sequence[tables.RestitutionRow]) -> tuple[list[str], list[list[str]]]:
    header = ["Specimen", "Estimator", "Tests", "Mean", "95 % interval", "Scatter", "r/r_max"]
    header += ["Bias-corrected", "95 % interval", "r_max"]
    return header, [
        [
            row.specimen,
            row.method,
            str(row.mean.tests),
            number(row.mean.mean, 4),
            interval(row.mean),
            number(row.mean.scatter, 4),
            number(row.ratio, 3),
            number(row.corrected.mean, 4),
            interval(row.corrected),
            number(row.r_max, 3),
        ]
        for row in rows
    ]


def _repetition_rows(rows: Sequence[tables.RepetitionRow]) -> tuple[list[str], list[list[str]]]:
    header = ["Level", "Estimator", "First tests", "Repeated", "Change", "95 % interval"]
    return header, [
        [
            f"{row.specimen}-{row.level}",
            row.method,
            number(row.first.mean, 4),
            number(row.repeated.mean, 4),
            signed(row.change),
            " … ".join(map(signed, row.change_interval95)),
        ]
        for row in rows
    ]


def _place_rows(rows: Sequence[tables.PlaceRow]) -> tuple[list[str], list[list[str]]]:
    header = ["Test", "θ0/α", "Status", "Runs", "Remark"]
    return header, [
        [row.test, number(row.theta0_over_alpha, 2), row.state, row.runs, _wrapped(row.remark)]
        for row in rows
    ]


def _test_rows(tests: Sequence[TestSummary]) -> tuple[list[str], list[list[str]]]:
    methods = [m for m in tables.METHODS if any(m in t.methods for t in tests)]
    header = ["Test", "θ0/α", "Impacts", *(f"r {m} ± SE" for m in methods), "Verdict of r", "In the mean"]
    rows = []
    for test in tests:
        values = [
            f"{test.methods[m].r:.4f} ± {number(test.methods[m].standard_error, 4)}"
            if m in test.methods
            else "–"
            for m in methods
        ]
        inside = "yes" if test.good else _wrapped("no: " + "; ".join(test.reasons))
        rows.append([test.test, number(test.phi0, 4), str(len(test.impacts_s)), *values, test.trust, inside])
    return header, rows


def _wrapped(text: str) -> str:
    return "\n".join(textwrap.wrap(one_line(text), _WIDTH))


def _tables(title: str, heading: str, header: list[str], rows: list[list[str]]) -> Iterator[Figure]:
    """One page after the other; rows of several lines take the room of several."""
    start = 0
    while start < len(rows):
        end, lines = start, 0
        while end < len(rows) and (end == start or lines + _lines(rows[end]) <= _ROWS):
            lines += _lines(rows[end])
            end += 1
        yield _page(title, heading, header, rows[start:end], lines)
        start = end


def _lines(row: list[str]) -> int:
    return max(cell.count("\n") + 1 for cell in row)


def _page(title: str, heading: str, header: list[str], rows: list[list[str]], lines: int) -> Figure:
    """Cells as plain texts on measured columns: a table of matplotlib costs five times as much to draw."""
    columns = _columns(header, rows, 0.9 * _PAGE)
    width, height = max(_PAGE, columns[-1] / 0.9), max(4.0, 1.2 + _LINE * (lines + 2))
    figure = Figure(figsize=(width, height))
    figure.text(0.05, 1.0 - 0.35 / height, title, fontsize=14, fontweight="bold", va="center")
    figure.text(0.05, 1.0 - 0.70 / height, heading, fontsize=11, va="center")
    top, rules = 1.2, []
    for place, row in enumerate([header, *rows]):
        deep = _LINE * _lines(row)
        for x, cell in zip(columns, row, strict=False):
            figure.text(
                (0.05 * width + x) / width,
                1.0 - (top + 0.5 * deep) / height,
                cell,
                fontproperties=_FONT if place else _HEADER_FONT,
                va="center",
            )
        top += deep
        rules.append([(0.05, 1.0 - top / height), (0.05 + columns[-1] / width, 1.0 - top / height)])
    colours, strokes = ["#333333"] + ["#dddddd"] * len(rows), [1.0] + [0.6] * len(rows)
    figure.add_artist(LineCollection(rules, transform=figure.transFigure, colors=colours, linewidths=strokes))
    return figure


def _columns(header: list[str], rows: list[list[str]], room: float) -> list[float]:
    """Where each column begins and where the last ends, in inches; gaps shrink where the room is short."""
    widths = [max(map(_width, cells)) for cells in zip(header, *rows, strict=True)]
    gap = min(_GAP, max(0.08, (room - sum(widths)) / len(widths)))
    return [0.0, *accumulate(width + gap for width in widths)]


def in_lines(text: str, room: float) -> list[str]:
    """The text in lines of at most `room` inches, a longer word in a line of its own."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _width(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


@lru_cache(maxsize=4096)
def _width(cell: str) -> float:
    """Width of a text in inches."""
    lines = cell.split("\n")
    sizes = (text_to_path.get_text_width_height_descent(line, _HEADER_FONT, False) for line in lines if line)
    return max((float(size[0]) for size in sizes), default=0.0) / 72.0
