"""The tables of the campaign report: Table 3.2 with status, Table 4.1, effect of the repetitions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from daq_app.campaign.report.statistics import GroupMean, random_effects_mean, shared_scatter, student_reach
from daq_app.campaign.summaries.summary import TestSummary

if TYPE_CHECKING:
    from daq_app.campaign.status import CampaignStatus

METHODS: Final = ("CRT", "EAV", "fit")


@dataclass(frozen=True, slots=True)
class PlaceRow:
    """One row of Table 3.2: a place of the plan and what became of it."""

    test: str
    specimen: str
    level: str
    theta0_over_alpha: float
    state: str
    runs: str
    remark: str


@dataclass(frozen=True, slots=True)
class RestitutionRow:
    """One cell group of Table 4.1."""

    specimen: str
    method: str
    mean: GroupMean
    """Mean of the tests' values, as in the paper."""
    corrected: GroupMean
    """Mean of the values less each method's own bias."""
    r_max: float

    @property
    def ratio(self) -> float:
        """r / r_max."""
        return self.mean.mean / self.r_max


@dataclass(frozen=True, slots=True)
class RepetitionRow:
    """What the tests in between did to r: the repetition at the end less the level's first tests."""

    specimen: str
    level: str
    method: str
    first: GroupMean
    repeated: GroupMean
    change_standard_error: float
    """With what tests of any level of the specimen scatter by."""
    degrees_of_freedom: int
    """How well that scatter is known; at least 1."""

    @property
    def change(self) -> float:
        return self.repeated.mean - self.first.mean

    @property
    def change_interval95(self) -> tuple[float, float]:
        """Student's t with as many degrees of freedom as the scatter is known with."""
        reach = student_reach(self.degrees_of_freedom) * self.change_standard_error
        return self.change - reach, self.change + reach


def table_3_2(status: CampaignStatus) -> list[PlaceRow]:
    """Every place of the plan in order, then releases that the plan has no place for."""
    rows = []
    for place in status.places:
        planned = place.planned
        remarks = [f"{test.name}: {test.reason}" for test in place.tests if test.reason]
        if planned.lost_originally:
            remarks.append("lost in the original campaign")
        runs = ", ".join(str(test.name) for test in place.tests)
        name = planned.name
        rows.append(
            PlaceRow(
                str(name),
                name.specimen,
                name.level,
                planned.theta0_over_alpha,
                place.state.value,
                runs,
                "; ".join(remarks),
            )
        )
    for test in status.extra:
        level = status.campaign.theta0_over_alpha(test.name)
        rows.append(
            PlaceRow(
                str(test.name),
                test.name.specimen,
                test.name.level,
                math.nan if level is None else level,
                "not in the plan",
                str(test.name),
                test.reason,
            )
        )
    return rows


def table_4_1(tests: Sequence[TestSummary]) -> list[RestitutionRow]:
    """Mean r by specimen and estimator over the good tests."""
    rows: list[RestitutionRow] = []
    for specimen in dict.fromkeys(test.specimen for test in tests):
        good_tests = [test for test in tests if test.specimen == specimen and test.good]
        if not good_tests:
            continue
        rows += [
            RestitutionRow(
                specimen,
                method,
                _mean(good_tests, method, corrected=False),
                _mean(good_tests, method, corrected=True),
                good_tests[0].r_max,
            )
            for method in METHODS
            if any(method in test.methods for test in good_tests)
        ]
    return rows


def mean_of_specimens(rows: Sequence[RestitutionRow]) -> list[RestitutionRow]:
    """The last row of Table 4.1: the plain mean of the specimens, by estimator; none with one specimen.

    It has no interval: specimens are not drawn from one population, and two tell no scatter.
    """
    means = []
    for method in METHODS:
        of_method = [row for row in rows if row.method == method]
        if len(of_method) > 1:
            plain, corrected = (
                GroupMean(sum(values) / len(of_method), math.nan, math.nan, math.nan, math.nan, tests)
                for values, tests in (
                    ([row.mean.mean for row in of_method], sum(row.mean.tests for row in of_method)),
                    (
                        [row.corrected.mean for row in of_method],
                        sum(row.corrected.tests for row in of_method),
                    ),
                )
            )
            r_max = sum(row.r_max for row in of_method) / len(of_method)
            means.append(RestitutionRow("mean", method, plain, corrected, r_max))
    return means


def repetition_effect(tests: Sequence[TestSummary]) -> list[RepetitionRow]:
    """Levels of which a repetition at the end exists, against their first tests.

    How much tests of one wall scatter is asked of all its levels: a level has too few to tell.
    """
    rows = []
    series = dict.fromkeys((t.specimen, t.level) for t in tests if t.repetition and t.good)
    for specimen, level in series:
        by_series: dict[tuple[str, bool], list[TestSummary]] = {}
        for test in tests:
            if test.specimen == specimen and test.good:
                by_series.setdefault((test.level, test.repetition), []).append(test)
        if (level, False) not in by_series:
            continue
        first, repeated = by_series[level, False], by_series[level, True]
        for method in METHODS:
            a, b = (_mean(group, method, corrected=True) for group in (first, repeated))
            if a.known and b.known:
                shared = shared_scatter([_corrected(group, method) for group in by_series.values()])
                error = math.hypot(
                    *(shared.error_of_mean(_corrected(group, method)[1]) for group in (first, repeated))
                )
                freedom = max(shared.degrees_of_freedom, 1)
                rows.append(RepetitionRow(specimen, level, method, a, b, error, freedom))
    return rows


def _corrected(tests: Iterable[TestSummary], method: str) -> tuple[list[float], list[float]]:
    """Values less the bias of the method, and their standard errors."""
    results = [test.methods[method] for test in tests if method in test.methods]
    return (
        [result.corrected for result in results],
        [result.corrected_standard_error for result in results],
    )


def _mean(tests: Iterable[TestSummary], method: str, *, corrected: bool) -> GroupMean:
    if corrected:
        return random_effects_mean(*_corrected(tests, method))
    results = [test.methods[method] for test in tests if method in test.methods]
    return random_effects_mean(
        [result.r for result in results], [result.standard_error for result in results]
    )
