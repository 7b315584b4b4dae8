"""The campaign report: HTML with SVG pictures, PDF, and CSV of every number."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, select_autoescape
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from daq_app.campaign import figures, tables
from daq_app.campaign.collect import Failure
from daq_app.campaign.statistics import GroupMean
from daq_app.campaign.status import CampaignStatus
from daq_app.campaign.summary import TestSummary

_PDF_ROWS = 34
"""Rows of a table on one page."""


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
        own = [t for t in tests if (t.specimen, t.level) == (specimen, level)]
        caption = f"Figure 4.1: rotation and angular velocity of {specimen}-{level}; dashed: the repetition"
        picture = figures.histories(own, f"{specimen}-{level}")
        found.append(CaptionedFigure(f"figure_4_1_{specimen}_{level}", picture, caption))
    found.append(
        CaptionedFigure(
            "figure_4_2",
            figures.period_against_amplitude(tests),
            "Figure 4.2: period against peak rotation, measured and theory (4.1)",
        )
    )
    for specimen, level in richest.items():
        own = [t for t in tests if (t.specimen, t.level) == (specimen, level)]
        caption = f"Figure 4.3: periods T_n and rotations φ_n of {specimen}-{level} against the impact n"
        picture = figures.decay(own, f"{specimen}-{level}")
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
    own = [test for test in tests if test.specimen == specimen]
    return max(
        {test.level for test in own},
        key=lambda level: (sum(t.good for t in own if t.level == level), level),
    )


def write_report(
    folder: Path,
    title: str,
    status: CampaignStatus,
    tests: Sequence[TestSummary],
    footer: str = "",
    failures: Sequence[Failure] = (),
) -> list[Path]:
    """Write ``report.html``, ``report.pdf``, the CSV files and each figure as SVG into `folder`.

    `failures` are runs that could not be analysed: they are named. Returns the files written. Raises
    `ValueError` if there is no analysed test at all.
    """
    if not tests:
        raise ValueError("no run of this campaign could be analysed: there is nothing to report")
    folder.mkdir(parents=True, exist_ok=True)
    places = tables.table_3_2(status)
    restitution = tables.table_4_1(tests)
    restitution += tables.mean_of_specimens(restitution)
    repetitions = tables.repetition_effect(tests)
    pictures = campaign_figures(tests)
    written = tables.write_csv(folder, places, tests, restitution, repetitions)
    for picture in pictures:
        path = folder / f"{picture.name}.svg"
        path.write_text('<?xml version="1.0" encoding="utf-8"?>\n' + picture.svg, encoding="utf-8")
        written.append(path)
    good = sum(test.good for test in tests)
    html = (
        _environment()
        .get_template("campaign.html")
        .render(
            title=title,
            subtitle=f"{len(tests)} runs analysed, {good} of them in the means",
            places=places,
            tests=tests,
            restitution=restitution,
            repetitions=repetitions,
            figures=pictures,
            methods=[m for m in tables.METHODS if any(m in t.methods for t in tests)],
            left_out=[test for test in tests if not test.good],
            failures=failures,
            footer=footer,
        )
    )
    written += [
        _replace(folder / "report.html", html.encode()),
        _pdf(folder / "report.pdf", title, pictures, restitution, tests),
    ]
    return written


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("daq_app.campaign"), autoescape=select_autoescape(), trim_blocks=True
    )
    environment.filters["number"] = _number
    environment.filters["interval"] = _interval
    return environment


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def _interval(group: GroupMean) -> str:
    if math.isnan(group.low95):
        return "–"
    return f"{_number(group.low95, 4)} … {_number(group.high95, 4)}"


def _replace(path: Path, content: bytes) -> Path:
    """Whole or not at all: a reader never sees half a report."""
    part = path.with_name(path.name + ".tmp")
    part.write_bytes(content)
    part.replace(path)
    return path


def _pdf(
    path: Path,
    title: str,
    pictures: Sequence[CaptionedFigure],
    restitution: Sequence[tables.RestitutionRow],
    tests: Sequence[TestSummary],
) -> Path:
    buffer = io.BytesIO()
    with PdfPages(buffer, metadata={"Title": title}) as pages:
        header = ["Specimen", "Estimator", "Tests", "Mean", "95 % interval", "r/r_max", "Corrected", "r_max"]
        rows = [
            [
                row.specimen,
                row.method,
                str(row.mean.tests),
                _number(row.mean.mean, 4),
                _interval(row.mean),
                _number(row.ratio, 3),
                _number(row.corrected.mean, 4),
                _number(row.r_max, 3),
            ]
            for row in restitution
        ]
        pages.savefig(_table_page(title, "Table 4.1: coefficient of restitution", header, rows))
        for picture in pictures:
            pages.savefig(picture.figure)
        header, rows = _test_rows(tests)
        for start in range(0, len(rows), _PDF_ROWS):
            pages.savefig(_table_page(title, "All tests", header, rows[start : start + _PDF_ROWS]))
    return _replace(path, buffer.getvalue())


def _test_rows(tests: Sequence[TestSummary]) -> tuple[list[str], list[list[str]]]:
    methods = [m for m in tables.METHODS if any(m in t.methods for t in tests)]
    header = ["Test", "θ0/α", "Impacts", *(f"r {m}" for m in methods), "In the mean"]
    rows = []
    for test in tests:
        values = [_number(test.methods[m].r, 4) if m in test.methods else "–" for m in methods]
        inside = "yes" if test.good else "no: " + "; ".join(test.reasons)[:60]
        rows.append([test.test, _number(test.phi0, 4), str(len(test.impacts_s)), *values, inside])
    return header, rows


def _table_page(title: str, heading: str, header: list[str], rows: list[list[str]]) -> Figure:
    height = max(4.0, 1.2 + 0.27 * (len(rows) + 2))
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
    table.scale(1.0, 1.25)
    return figure
