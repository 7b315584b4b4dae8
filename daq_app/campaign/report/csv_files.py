"""Every number of the campaign report as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence

from daq_app.campaign.report.report_tables import ReportTables
from daq_app.campaign.report.statistics import GroupMean
from daq_app.campaign.report.tables import METHODS
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.config.shown_text import csv_cell


def csv_files(content: ReportTables) -> list[tuple[str, str]]:
    """Name and text of each file (comma, decimal point)."""
    place_header = ("test", "specimen", "level", "theta0_over_alpha", "state", "runs", "remark")
    place_rows: list[tuple[object, ...]] = [
        (p.test, p.specimen, p.level, p.theta0_over_alpha, p.state, p.runs, p.remark) for p in content.places
    ]
    mean_header = ("specimen", "method", *_group_header("r"), *_group_header("r_corrected"), "r_max", "ratio")
    mean_rows: list[tuple[object, ...]] = [
        (r.specimen, r.method, *_group(r.mean), *_group(r.corrected), r.r_max, r.ratio)
        for r in content.restitution
    ]
    change_header = ("specimen", "level", "method", *_group_header("r_first"), *_group_header("r_repeated"))
    change_header += ("change", "change_standard_error", "change_low95", "change_high95")
    change_rows: list[tuple[object, ...]] = [
        (
            *(r.specimen, r.level, r.method, *_group(r.first), *_group(r.repeated)),
            *(r.change, r.change_standard_error, *r.change_interval95),
        )
        for r in content.repetitions
    ]
    return [
        ("table_3_2.csv", _text(place_header, place_rows)),
        ("table_4_1.csv", _text(mean_header, mean_rows)),
        ("repetitions.csv", _text(change_header, change_rows)),
        ("tests.csv", _text(*_test_table(content.tests))),
        ("half_cycles.csv", _text(*_half_cycle_table(content.tests))),
        ("points.csv", _text(*_point_table(content.tests))),
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


def _text(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows([["" if _missing(cell) else csv_cell(cell) for cell in row] for row in rows])
    return text.getvalue()


def _missing(cell: object) -> bool:
    return isinstance(cell, float) and math.isnan(cell)
