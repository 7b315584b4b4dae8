"""The campaign report as HTML."""

from __future__ import annotations

from collections.abc import Sequence

from daq_app.campaign.pages import page_environment
from daq_app.campaign.report import tables
from daq_app.campaign.report.number_words import interval, number, signed
from daq_app.campaign.report.planned_figures import DrawnFigure
from daq_app.campaign.report.report_tables import ReportTables


def report_page(content: ReportTables, figures: Sequence[DrawnFigure], footer: str) -> str:
    """The whole page, its pictures inside."""
    tests = content.tests
    environment = page_environment()
    environment.filters["number"] = number
    environment.filters["signed"] = signed
    environment.filters["interval"] = interval
    return environment.get_template("campaign.html").render(
        title=content.title,
        subtitle=f"{len(tests)} runs analysed, {sum(test.good for test in tests)} of them in the means",
        places=content.places,
        tests=tests,
        restitution=content.restitution,
        repetitions=content.repetitions,
        figures=figures,
        methods=[m for m in tables.METHODS if any(m in t.methods for t in tests)],
        left_out=[test for test in tests if not test.good],
        failures=content.failures,
        footer=footer,
    )
