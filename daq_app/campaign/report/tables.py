"""The tables of the campaign report: Table 3.2 with status, Table 4.1, effect of the repetitions."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.campaign.report.statistics import GroupMean, random_effects_mean, shared_scatter, student_reach
from daq_app.campaign.status import CampaignStatus
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.shown_text import csv_cell
from daq_app.runfile.durable import write_whole

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


def write_csv(
    folder: Path,
    places: Sequence[PlaceRow],
    tests: Sequence[TestSummary],
    restitution: Sequence[RestitutionRow],
    repetitions: Sequence[RepetitionRow],
) -> list[Path]:
    """Every number of the report as CSV (UTF-8, comma, decimal point); returns the files."""
    place_header = ("test", "specimen", "level", "theta0_over_alpha", "state", "runs", "remark")
    place_rows: list[tuple[object, ...]] = [
        (p.test, p.specimen, p.level, p.theta0_over_alpha, p.state, p.runs, p.remark) for p in places
    ]
    mean_header = ("specimen", "method", *_group_header("r"), *_group_header("r_corrected"), "r_max", "ratio")
    mean_rows: list[tuple[object, ...]] = [
        (r.specimen, r.method, *_group(r.mean), *_group(r.corrected), r.r_max, r.ratio) for r in restitution
    ]
    change_header = ("specimen", "level", "method", *_group_header("r_first"), *_group_header("r_repeated"))
    change_header += ("change", "change_standard_error", "change_low95", "change_high95")
    change_rows: list[tuple[object, ...]] = [
        (
            *(r.specimen, r.level, r.method, *_group(r.first), *_group(r.repeated)),
            *(r.change, r.change_standard_error, *r.change_interval95),
        )
        for r in repetitions
    ]
    return [
        _write(folder / "table_3_2.csv", place_header, place_rows),
        _write(folder / "table_4_1.csv", mean_header, mean_rows),
        _write(folder / "repetitions.csv", change_header, change_rows),
        _write(folder / "tests.csv", *_test_table(tests)),
        _write(folder / "half_cycles.csv", *_half_cycle_table(tests)),
        _write(folder / "points.csv", *_point_table(tests)),
    ]


def _group_header(name: str) -> tuple[str, ...]:
    parts = ("", "_standard_error", "_low95", "_high95", "_scatter", "_tests")
    return tuple(name + part for part in parts)


def _group(group: GroupMean) -> tuple[object, ...]:
    return (group.mean, group.standard_error, group.low95, group.high95, group.scatter, group.tests)


def _test_table(tests: Sequence[TestSummary]) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    header = ["test", "run", "specimen", "level", "repetition", "good", "trust"]
    header += ["reasons", "theta0_rad", "theta0_over_alpha", "impacts", "r_max"]
    for method in METHODS:
        header += [f"r_{method}", f"r_{method}_standard_error", f"r_{method}_bias"]
    rows = []
    for t in tests:
        row: list[object] = [t.test, t.run, t.specimen, t.level, t.repetition, t.good, t.trust]
        row += ["; ".join(t.reasons), t.theta0_rad, t.phi0, len(t.impacts_s), t.r_max]
        for method in METHODS:
            result = t.methods.get(method)
            row += [result.r, result.standard_error, result.bias] if result else ["", "", ""]
        rows.append(tuple(row))
    return tuple(header), rows


def _half_cycle_table(tests: Sequence[TestSummary]) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    header = ("test", "n", "impact_s", "peak_rad", "peak_over_alpha", "period_s")
    rows: list[tuple[object, ...]] = []
    for t in tests:
        for n, peak in enumerate(t.peaks_rad):
            impact = t.impacts_s[n - 1] if 0 < n <= len(t.impacts_s) else ""
            period = t.periods_s[n - 1] if 0 < n <= len(t.periods_s) else ""
            rows.append((t.test, n, impact, peak, peak / t.alpha_rad, period))
    return header, rows


def _point_table(tests: Sequence[TestSummary]) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    rows: list[tuple[object, ...]] = [
        (t.test, method, impact, r)
        for t in tests
        for method, result in t.methods.items()
        for impact, r in result.points
    ]
    return ("test", "method", "impact", "r"), rows


def _write(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> Path:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows([["" if _missing(cell) else csv_cell(cell) for cell in row] for row in rows])
    return write_whole(path, text.getvalue(), other_name=True)


def _missing(cell: object) -> bool:
    return isinstance(cell, float) and math.isnan(cell)
