"""The campaign report: HTML with SVG pictures, PDF, and CSV of every number.

What draws is imported by the processes that draw: this module is light.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, Protocol, TypeVar

from daq_app.campaign.report.csv_files import csv_files
from daq_app.campaign.report.figure_job import drawn
from daq_app.campaign.report.planned_figures import campaign_figures
from daq_app.campaign.report.report_tables import ReportTables
from daq_app.campaign.report.tables import RestitutionRow
from daq_app.campaign.status import CampaignStatus
from daq_app.campaign.summaries.summary import Failure, TestSummary
from daq_app.runfile.durable import write_whole
from daq_app.workers import process_pool

_Made = TypeVar("_Made")


class _Begin(Protocol):
    def __call__(self, work: Callable[[], _Made]) -> Callable[[], _Made]:
        """Begin the work; what is returned waits for its result."""


_PROCESSES: Final = 4
"""Processes that draw at most: of 36 tests, one figure takes a quarter of the time of all on one core."""
_WRITERS: Final = 4
"""Files that are flushed to the device at a time. Each waits for the device; more hardly gain (assumed)."""


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """The files of a report, and the rows of its Table 4.1."""

    files: tuple[Path, ...]
    restitution: tuple[RestitutionRow, ...]


def write_report(
    folder: Path,
    title: str,
    status: CampaignStatus,
    tests: Sequence[TestSummary],
    footer: str = "",
    failures: Sequence[Failure] = (),
    *,
    at_once: bool = False,
) -> WrittenReport:
    """Write ``report.html``, ``report.pdf``, the CSV files and each figure as SVG into `folder`.

    `failures` are runs that could not be analysed: they are named. `at_once` draws in several processes.
    A file is written as soon as it is made, HTML and PDF last: what is drawn is complete then.
    Raises `ValueError` if there is no analysed test at all, `OSError` where a file cannot be written.
    """
    if not tests:
        raise ValueError("no run of this campaign could be analysed: there is nothing to report")
    folder.mkdir(parents=True, exist_ok=True)

    def write(name: str, content: str | bytes) -> Path:
        return write_whole(folder / name, content, other_name=True)

    with _drawing(at_once) as begin, ThreadPoolExecutor(_WRITERS) as writers:
        # The first figures keep the processes busy while tables are worked out. Their pages take longest,
        # and must not be what is left for one process at the end.
        planned = campaign_figures(tests)
        figures = [begin(partial(drawn, figure)) for figure in planned[:_PROCESSES]]
        content = ReportTables.of(title, status, tests, failures)
        last, first = begin(content.last_pages), begin(content.first_pages)
        figures += [begin(partial(drawn, figure)) for figure in planned[_PROCESSES:]]
        # Imported here: meanwhile figures are drawn.
        from daq_app.campaign.report.page import report_page
        from daq_app.campaign.report.pdf_parts import joined

        files = [writers.submit(write, name, text) for name, text in csv_files(content)]
        pictures = []
        for figure in figures:
            pictures.append(picture := figure())
            svg = '<?xml version="1.0" encoding="utf-8"?>\n' + picture.svg
            files.append(writers.submit(write, f"{picture.name}.svg", svg))
        page = report_page(content, pictures, footer)
        files.append(writers.submit(write, "report.html", page))
        document = joined([first(), *(picture.page for picture in pictures), last()])
        files.append(writers.submit(write, "report.pdf", document))
        return WrittenReport(tuple(file.result() for file in files), content.restitution)


@contextmanager
def _drawing(at_once: bool) -> Iterator[_Begin]:
    """What begins a piece of work: in a process of a pool, or in this one when its result is asked for."""
    if not at_once:
        yield _when_asked
        return
    with process_pool(min(_PROCESSES, os.cpu_count() or 1)) as pool:

        def in_pool(work: Callable[[], _Made]) -> Callable[[], _Made]:
            return pool.submit(work).result

        yield in_pool


def _when_asked(work: Callable[[], _Made]) -> Callable[[], _Made]:
    return work
