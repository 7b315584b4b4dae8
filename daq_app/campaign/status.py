"""What of a campaign is done, what is missing, what must be repeated, and which test is next.

Numbers are given at release: the name of the next test is a proposal that follows from the runs
that exist, so an armed test that is aborted burns none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daq_app.campaign.names import TestName, TestSeries

if TYPE_CHECKING:
    from daq_app.campaign.plan import Campaign, PlannedTest


class TestVerdict(StrEnum):
    """What became of a test that was released."""

    __test__ = False

    GOOD = "good"
    BAD = "bad"
    """Recorded, but it failed its quality check or was rejected by the operator."""
    LOST = "lost"
    """Released, and no data of it exists."""
    UNCHECKED = "unchecked"
    """Recorded; nobody has judged it yet. It fills its place until somebody rejects it."""


class PlaceState(StrEnum):
    """State of one place of the sequence."""

    DONE = "done"
    TO_REPEAT = "to be repeated"
    MISSING = "missing"


@dataclass(frozen=True, slots=True)
class TestFacts:
    """What a run says of its test beside the verdict; empty where it says nothing."""

    __test__ = False

    theta0_over_alpha: float | None = None
    """|θ0|/α as measured."""
    r: Mapping[str, float] = field(default_factory=dict)
    """By estimator, ``CRT`` and ``EAV``, as found when the run was saved."""
    operator: str = ""
    notes: tuple[str, ...] = ()
    """Conditions, notes before the test, and those typed during it, in this order."""


NO_FACTS: Final = TestFacts()


@dataclass(frozen=True, slots=True)
class RecordedTest:
    """One release, as a run tells it."""

    name: TestName
    verdict: TestVerdict
    released_ns: int = 0
    """Wall clock of the run: the order in which the releases happened."""
    path: Path | None = None
    reason: str = ""
    """Why it is bad or lost, in words."""
    facts: TestFacts = NO_FACTS


@dataclass(slots=True)
class Place:
    """One place of the sequence and the releases that were meant for it, oldest first."""

    planned: PlannedTest
    tests: list[RecordedTest] = field(default_factory=list)

    @property
    def state(self) -> PlaceState:
        if any(test.verdict in (TestVerdict.GOOD, TestVerdict.UNCHECKED) for test in self.tests):
            return PlaceState.DONE
        return PlaceState.TO_REPEAT if self.tests else PlaceState.MISSING


@dataclass(frozen=True, slots=True)
class Proposal:
    """The test to make next."""

    name: TestName
    planned: PlannedTest
    theta0_over_alpha: float
    reason: str
    """A plain sentence for the operator."""


Reader = Callable[[Path], Iterable[RecordedTest]]
"""Reads the releases that a folder of runs holds."""


class CampaignStatus:
    """Places of a campaign filled with releases."""

    def __init__(self, campaign: Campaign, recorded: Iterable[RecordedTest]) -> None:
        self.campaign = campaign
        self.places: tuple[Place, ...] = tuple(Place(planned) for planned in campaign.tests)
        self.extra: list[RecordedTest] = []
        """Releases that the plan has no place for (other specimens and levels, more than planned)."""
        self._used: dict[TestSeries, set[int]] = {}
        self._latest: Place | None = None
        self._by_name = {place.planned.name: place for place in self.places}
        for test in sorted(recorded, key=lambda test: (test.released_ns, test.name)):
            self._take(test)

    @classmethod
    def scan(cls, campaign: Campaign, runs_dir: Path, reader: Reader) -> CampaignStatus:
        """Status from a folder of runs, read by `reader`."""
        return cls(campaign, reader(runs_dir))

    def _take(self, test: RecordedTest) -> None:
        series = test.name.series
        self._used.setdefault(series, set()).add(test.name.number)
        place = self._by_name.get(test.name) or self._open_place(series)
        if place is None:
            self.extra.append(test)
        else:
            place.tests.append(test)
            self._latest = place

    def _open_place(self, series: TestSeries) -> Place | None:
        """Where a release with a number beyond the plan belongs: the first failed place of its series."""
        places = [place for place in self.places if place.planned.name.series == series]
        for state in (PlaceState.TO_REPEAT, PlaceState.MISSING):
            for place in places:
                if place.state is state:
                    return place
        return None

    def in_state(self, state: PlaceState, specimen: str = "") -> tuple[Place, ...]:
        """Places of a state, in the order of the sequence; of one specimen if it is given."""
        return tuple(place for place in self._of(specimen) if place.state is state)

    def _of(self, specimen: str) -> Iterator[Place]:
        return (place for place in self.places if specimen in ("", place.planned.name.specimen))

    @property
    def names(self) -> frozenset[str]:
        """Names of all releases, of those without a place as well."""
        placed = (test for place in self.places for test in place.tests)
        return frozenset(str(test.name) for test in (*placed, *self.extra))

    def name_for(self, place: Place) -> TestName:
        """Name that a release for this place gets now: the planned one, or the next free number."""
        name = place.planned.name
        used = self._used.get(name.series, set())
        if name.number not in used:
            return name
        planned = [p.planned.name.number for p in self.places if p.planned.name.series == name.series]
        return name.series.test(max((*used, *planned)) + 1)

    def next_test(self, specimen: str = "") -> Proposal | None:
        """The test to make next (of one specimen if it is given); None when all is done.

        A test that failed just now is offered again at once; otherwise the first open place of the
        sequence is next.
        """
        latest = self._latest
        if (
            latest is not None
            and latest.state is PlaceState.TO_REPEAT
            and specimen in ("", latest.planned.name.specimen)
        ):
            return self._proposal(latest)
        for place in self._of(specimen):
            if place.state is not PlaceState.DONE:
                return self._proposal(place)
        return None

    def _proposal(self, place: Place) -> Proposal:
        planned = place.planned
        reason = f"next of the plan, {planned.name.specimen} at θ0/α = {planned.theta0_over_alpha:.2f}"
        if place.state is PlaceState.TO_REPEAT:
            failed = place.tests[-1]
            why = f": {failed.reason}" if failed.reason else ""
            reason = f"repeats {failed.name}, which is {failed.verdict.value}{why}"
        return Proposal(self.name_for(place), planned, planned.theta0_over_alpha, reason)
