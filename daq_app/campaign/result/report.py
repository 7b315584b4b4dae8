"""The result of one test on one page: HTML and PDF, saved beside its run."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from daq_app.campaign.captioned import PLAIN_TEXT, CaptionedFigure
from daq_app.campaign.pages import page_environment
from daq_app.campaign.result.family_rows import CAPTION, HEADINGS, family_rows
from daq_app.campaign.result.figures import result_figure
from daq_app.campaign.result.motions import period_deviation
from daq_app.campaign.result.words import METHODS, RepetitionRow, repetition_rows, verdict_sentence
from daq_app.campaign.status import NO_FACTS, TestFacts
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.wording import plus_minus, signed
from daq_app.rocking.families.verdict_words import verdict_sentence as restitution_sentence
from daq_app.runfile.durable import write_whole

_WIDTH: Final = 110
"""Characters of a sentence on one line of the PDF."""


def write_result(
    run: Path, test: TestSummary, earlier: Sequence[TestSummary] = (), facts: TestFacts = NO_FACTS
) -> list[Path]:
    """Write ``RUN.result.html`` and ``RUN.result.pdf`` beside the run; returns both. Raises `OSError`."""
    with mpl.rc_context(PLAIN_TEXT):
        return _write(run, test, earlier, facts)


def _write(run: Path, test: TestSummary, earlier: Sequence[TestSummary], facts: TestFacts) -> list[Path]:
    figure = result_figure(test, earlier)
    rows = repetition_rows(test, earlier)
    html = (
        page_environment()
        .get_template("result.html")
        .render(
            test=test,
            facts=facts,
            run=run.name,
            verdict=verdict_sentence(test),
            methods=[(name, test.methods.get(name)) for name in METHODS],
            picture=CaptionedFigure(f"result_{test.test}", figure, test.test).svg,
            rows=rows,
            names=METHODS,
            deviation=period_deviation(test),
            restitution=None if test.verdict is None else restitution_sentence(test.verdict),
            families=family_rows(test),
            family_headings=HEADINGS,
            family_caption=CAPTION,
            plus_minus=plus_minus,
            bias=_bias,
        )
    )
    return [
        write_whole(run.with_suffix(".result.html"), html.encode(), other_name=True),
        write_whole(run.with_suffix(".result.pdf"), _pdf(test, figure, rows), other_name=True),
    ]


def _pdf(test: TestSummary, figure: Figure, rows: Sequence[RepetitionRow]) -> bytes:
    buffer = io.BytesIO()
    with PdfPages(buffer, metadata={"Title": test.test}) as pages:
        pages.savefig(figure, bbox_inches="tight", pad_inches=0.4)
        pages.savefig(_table_page(test, rows))
        if test.families:
            pages.savefig(_family_page(test))
    return buffer.getvalue()


def _bias(value: float) -> str:
    """With its sign; none where it rounds to nothing."""
    return signed(value, "+.4f") if abs(value) >= 5e-5 else "0.0000"


def _table_page(test: TestSummary, rows: Sequence[RepetitionRow]) -> Figure:
    """r by each estimator, and the tests of the level, as on the HTML page."""
    page = Figure(figsize=(11.0, 7.2))
    page.text(0.05, 0.93, test.test, fontsize=15, fontweight="bold")
    page.text(0.05, 0.9, textwrap.fill(verdict_sentence(test), _WIDTH, max_lines=3), fontsize=11, va="top")
    methods = [(name, method) for name in METHODS if (method := test.methods.get(name)) is not None]
    estimates = [
        [
            name,
            f"{method.r:.4f}",
            plus_minus(method.standard_error),
            f"{method.r / test.r_max:.3f}",
            _bias(method.bias),
            f"{method.corrected:.4f}",
        ]
        for name, method in methods
    ]
    if estimates:
        header = ["Estimator", "r", "standard error", "r/r_max", "bias of the method", "bias-corrected r"]
        _table(page, (0.05, 0.62, 0.9, 0.22), header, estimates)
    deviation = period_deviation(test)
    if deviation is not None:
        share = signed(100 * deviation, "+.1f")
        sentence = f"The measured periods deviate from theory (4.1) by {share} % on average."
        page.text(0.05, 0.65, sentence, fontsize=10)
    cells = [
        [
            row.test + ("  (this test)" if row.this else ""),
            f"{row.phi0:.4f}",
            str(row.impacts),
            *("–" if row.r[name] is None else f"{row.r[name]:.4f}" for name in METHODS),
            "good" if row.good else "not good",
        ]
        for row in rows
    ]
    page.text(0.05, 0.58, "Tests of this level", fontsize=12, fontweight="bold")
    header = ["Test", "θ0/α", "Impacts", *(f"r {name}" for name in METHODS), "Verdict"]
    _table(page, (0.05, 0.05, 0.9, 0.5), header, cells)
    return page


def _family_page(test: TestSummary) -> Figure:
    """What each sensor family says, as on the HTML page."""
    page = Figure(figsize=(11.0, 7.2))
    page.text(0.05, 0.93, f"{test.test}: what each sensor family says", fontsize=15, fontweight="bold")
    if test.verdict is not None:
        sentence = textwrap.fill(restitution_sentence(test.verdict), _WIDTH, max_lines=3)
        page.text(0.05, 0.9, sentence, fontsize=11, va="top")
    _table(page, (0.05, 0.3, 0.9, 0.5), list(HEADINGS), [list(row) for row in family_rows(test)])
    page.text(0.05, 0.25, CAPTION, fontsize=10)
    return page


def _table(
    page: Figure, box: tuple[float, float, float, float], header: list[str], cells: list[list[str]]
) -> None:
    axis = page.add_axes(box)
    axis.axis("off")
    table = axis.table(
        cellText=cells, colLabels=header, loc="upper left", edges="horizontal", cellLoc="center"
    )
    table.auto_set_font_size(False)
    table.set_fontsize(10)
    table.scale(1.0, 1.5)
