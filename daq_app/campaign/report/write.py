"""The campaign report: HTML with SVG pictures, PDF, and CSV of every number.

What draws is imported by the processes that draw: this module is light.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment

from daq_app.campaign.pages import page_environment
from daq_app.campaign.report import tables
from daq_app.campaign.report.number_words import interval, number, signed
from daq_app.campaign.status import CampaignStatus
from daq_app.campaign.summaries.of_run import Failure
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.runfile.durable import write_whole
from daq_app.workers import process_pool


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn figure: the file name it is saved under, its caption, and itself as an SVG element."""

    name: str
    caption: str
    svg: str


@dataclass(frozen=True, slots=True)
class _Content:
    """All that the report shows."""

    title: str
    places: tuple[tables.PlaceRow, ...]
    restitution: tuple[tables.RestitutionRow, ...]
    repetitions: tuple[tables.RepetitionRow, ...]
    tests: tuple[TestSummary, ...]
    failures: tuple[Failure, ...]

    def pictures(self) -> list[Picture]:
        from daq_app.campaign.report.captioned import campaign_figures

        return [Picture(one.name, one.caption, one.svg) for one in campaign_figures(self.tests)]

    def pdf(self) -> bytes:
        from daq_app.campaign.report.pdf import report_pdf

        return report_pdf(
            self.title, self.places, self.restitution, self.repetitions, self.tests, self.failures
        )

    @contextmanager
    def drawing(self, *, at_once: bool) -> Iterator[tuple[Callable[[], list[Picture]], Callable[[], bytes]]]:
        """Give pictures and PDF when asked: each is drawn in a process of its own, or in this one."""
        if not at_once:
            yield self.pictures, self.pdf
            return
        with process_pool(2) as pool:
            pdf, pictures = pool.submit(self.pdf), pool.submit(self.pictures)
            yield pictures.result, pdf.result


def write_report(
    folder: Path,
    title: str,
    status: CampaignStatus,
    tests: Sequence[TestSummary],
    footer: str = "",
    failures: Sequence[Failure] = (),
    *,
    at_once: bool = False,
) -> list[Path]:
    """Write ``report.html``, ``report.pdf``, the CSV files and each figure as SVG into `folder`.

    `failures` are runs that could not be analysed: they are named. `at_once` draws in two processes.
    Returns the files written. Raises `ValueError` if there is no analysed test at all.
    """
    if not tests:
        raise ValueError("no run of this campaign could be analysed: there is nothing to report")
    folder.mkdir(parents=True, exist_ok=True)
    restitution = tables.table_4_1(tests)
    restitution += tables.mean_of_specimens(restitution)
    content = _Content(
        title=title,
        places=tuple(tables.table_3_2(status)),
        restitution=tuple(restitution),
        repetitions=tuple(tables.repetition_effect(tests)),
        tests=tuple(tests),
        failures=tuple(failures),
    )
    with content.drawing(at_once=at_once) as (pictures, pdf):
        page = _environment().get_template("campaign.html")
        drawn = pictures()
        html = page.render(
            title=title,
            subtitle=f"{len(tests)} runs analysed, {sum(test.good for test in tests)} of them in the means",
            places=content.places,
            tests=tests,
            restitution=restitution,
            repetitions=content.repetitions,
            figures=drawn,
            methods=[m for m in tables.METHODS if any(m in t.methods for t in tests)],
            left_out=[test for test in tests if not test.good],
            failures=failures,
            footer=footer,
        )
        document = pdf()
    written = tables.write_csv(folder, content.places, tests, restitution, content.repetitions)
    for picture in drawn:
        svg = '<?xml version="1.0" encoding="utf-8"?>\n' + picture.svg
        written.append(write_whole(folder / f"{picture.name}.svg", svg, other_name=True))
    written += [
        write_whole(folder / "report.html", html.encode(), other_name=True),
        write_whole(folder / "report.pdf", document, other_name=True),
    ]
    return written


def _environment() -> Environment:
    environment = page_environment()
    environment.filters["number"] = number
    environment.filters["signed"] = signed
    environment.filters["interval"] = interval
    return environment
