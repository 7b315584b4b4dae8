"""All that a campaign report shows beside its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from daq_app.campaign.report import tables
from daq_app.campaign.summaries.summary import Failure, TestSummary

if TYPE_CHECKING:
    from daq_app.campaign.status import CampaignStatus


@dataclass(frozen=True, slots=True)
class ReportTables:
    """Rows of each table, and the tests they follow from."""

    title: str
    places: tuple[tables.PlaceRow, ...]
    restitution: tuple[tables.RestitutionRow, ...]
    repetitions: tuple[tables.RepetitionRow, ...]
    tests: tuple[TestSummary, ...]
    failures: tuple[Failure, ...]

    @classmethod
    def of(
        cls, title: str, status: CampaignStatus, tests: Sequence[TestSummary], failures: Sequence[Failure]
    ) -> ReportTables:
        """Every table, worked out."""
        restitution = tables.table_4_1(tests)
        return cls(
            title=title,
            places=tuple(tables.table_3_2(status)),
            restitution=(*restitution, *tables.mean_of_specimens(restitution)),
            repetitions=tuple(tables.repetition_effect(tests)),
            tests=tuple(tests),
            failures=tuple(failures),
        )

    def first_pages(self) -> bytes:
        """The tables before the figures as PDF."""
        from daq_app.campaign.report import pdf  # only the process that draws loads what draws

        return pdf.first_pages(self.title, self.restitution, self.repetitions)

    def last_pages(self) -> bytes:
        """The tables behind the figures as PDF."""
        from daq_app.campaign.report import pdf

        return pdf.last_pages(self.title, self.places, self.tests, self.failures)
