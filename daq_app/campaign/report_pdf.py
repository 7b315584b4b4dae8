"""The campaign report as PDF: the same tables and figures as the page, one after the other."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Iterator, Sequence

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from daq_app.campaign import tables
from daq_app.campaign.collect import Failure
from daq_app.campaign.statistics import GroupMean
from daq_app.campaign.summary import TestSummary

_ROWS = 34
"""Rows of a table on one page."""
_WIDTH = 54
"""Characters of a remark on one line."""


def report_pdf(
    title: str,
    pictures: Sequence[tuple[Figure, str]],
    places: Sequence[tables.PlaceRow],
    restitution: Sequence[tables.RestitutionRow],
    repetitions: Sequence[tables.RepetitionRow],
    tests: Sequence[TestSummary],
    failures: Sequence[Failure],
) -> bytes:
    """A whole document; `pictures` are figures with their captions."""
    buffer = io.BytesIO()
    with PdfPages(buffer, metadata={"Title": title}) as pages:
        for page in _tables(title, "Table 4.1: coefficient of restitution", *_restitution_rows(restitution)):
            pages.savefig(page)
        if repetitions:
            for page in _tables(title, "Effect of the repetitions", *_repetition_rows(repetitions)):
                pages.savefig(page)
        for figure, caption in pictures:
            text = figure.text(0.02, -0.02, caption, fontsize=9, va="top")
            pages.savefig(figure, bbox_inches="tight", pad_inches=0.4)
            text.remove()
        for page in _tables(title, "Table 3.2: sequence and status", *_place_rows(places)):
            pages.savefig(page)
        for page in _tables(title, "All tests", *_test_rows(tests)):
            pages.savefig(page)
        if failures:
            rows = [[failure.test, failure.path.name, _wrapped(failure.reason)] for failure in failures]
            for page in _tables(title, "Not analysed", ["Test", "Run", "Why"], rows):
                pages.savefig(page)
    return buffer.getvalue()


def number(value: float, digits: int) -> str:
    """With so many digits; a dash for what is not known."""
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def interval(group: GroupMean) -> str:
    """The 95 % interval of a mean; a dash where it has none."""
    if math.isnan(group.low95):
        return "–"
    return f"{number(group.low95, 4)} … {number(group.high95, 4)}"


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
            f"{row.change:+.4f}",
            "{:+.4f} … {:+.4f}".format(*row.change_interval95),
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
    header = ["Test", "θ0/α", "Impacts", *(f"r {m} ± SE" for m in methods), "In the mean"]
    rows = []
    for test in tests:
        values = [
            f"{test.methods[m].r:.4f} ± {number(test.methods[m].standard_error, 4)}"
            if m in test.methods
            else "–"
            for m in methods
        ]
        inside = "yes" if test.good else _wrapped("no: " + "; ".join(test.reasons))
        rows.append([test.test, number(test.phi0, 4), str(len(test.impacts_s)), *values, inside])
    return header, rows


def _wrapped(text: str) -> str:
    return "\n".join(textwrap.wrap(text, _WIDTH))


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
    line = 0.26
    height = max(4.0, 1.2 + line * (lines + 2))
    figure = Figure(figsize=(11.0, height))
    figure.text(0.05, 1.0 - 0.35 / height, title, fontsize=14, fontweight="bold", va="center")
    figure.text(0.05, 1.0 - 0.70 / height, heading, fontsize=11, va="center")
    axis = figure.add_axes((0.05, 0.02, 0.9, 1.0 - 1.0 / height))
    axis.axis("off")
    table = axis.table(
        cellText=rows, colLabels=header, loc="upper left", cellLoc="center", edges="horizontal"
    )
    table.auto_set_font_size(False)
    table.set_fontsize(9)
    table.auto_set_column_width(list(range(len(header))))
    unit = line / height / (1.0 - 1.0 / height)
    for (place, _), cell in table.get_celld().items():
        cell.set_height(unit * (_lines(rows[place - 1]) if place > 0 else 1))
    return figure
