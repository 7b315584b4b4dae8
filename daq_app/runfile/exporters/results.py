"""The results of a run as one tidy table: a row per number, as pandas and R like it."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from daq_app.config.shown_text import csv_cell

Decimal = Literal["point", "comma"]

COLUMNS: Final = ("test", "level", "quantity", "source", "n", "value", "sigma", "unit")
_HALF_CYCLE: Final = (
    ("impact time", "start_s", "sigma_start_s", "s"),
    ("half-cycle duration", "duration_s", "sigma_duration_s", "s"),
    ("peak rotation", "peak_rad", "sigma_peak_rad", "rad"),
    ("speed before impact", "speed_before_rad_s", "sigma_speed_before_rad_s", "rad/s"),
    ("speed after impact", "speed_after_rad_s", "sigma_speed_after_rad_s", "rad/s"),
)


@dataclass(frozen=True, slots=True)
class ResultRow:
    """One number with its standard uncertainty; None where there is none."""

    quantity: str
    source: str
    """Method, family or empty."""
    n: int
    """Impact that begins the half-cycle (0: the release), or −1."""
    value: float
    sigma: float | None
    unit: str


def result_rows(analysis: Mapping[str, Any]) -> list[ResultRow]:
    """r by verdict and methods, θ0 by family, α and p, and every half-cycle, of `TestAnalysis.as_dict()`."""
    rows: list[ResultRow] = []

    def add(quantity: str, source: str, n: int, value: Any, sigma: Any, unit: str) -> None:
        if isinstance(value, int | float):
            error = float(sigma) if isinstance(sigma, int | float) else None
            rows.append(ResultRow(quantity, source, n, float(value), error, unit))

    verdict = analysis.get("verdict") or {}
    trust = str(verdict.get("trust", ""))
    add("r", f"verdict: {trust}", -1, verdict.get("r"), verdict.get("standard_error"), "1")
    for method, estimate in (analysis.get("estimates") or {}).items():
        add("r", method, -1, estimate.get("r"), estimate.get("standard_error"), "1")
    fit = analysis.get("fit") or {}
    add("r", "fit", -1, fit.get("r"), fit.get("standard_error"), "1")
    for name, value in (analysis.get("theta0_by_family") or {}).items():
        add("theta0", name, -1, value.get("value"), value.get("sigma"), "rad")
    for view in analysis.get("families") or []:
        add("alpha", view["family"], -1, view.get("alpha_rad"), view.get("sigma_alpha_rad"), "rad")
        add("p", view["family"], -1, view.get("p_rad_s"), view.get("sigma_p_rad_s"), "rad/s")
    add("release time", "", 0, analysis.get("release_s"), None, "s")
    add("rest time", "", -1, analysis.get("rest_s"), None, "s")
    for cycle in analysis.get("half_cycles") or []:
        for quantity, value, sigma, unit in _HALF_CYCLE:
            if not (cycle["n"] == 0 and quantity == "impact time"):
                add(quantity, "", cycle["n"], cycle.get(value), cycle.get(sigma), unit)
    return rows


def tidy_csv(test: str, level: str, rows: Sequence[ResultRow], decimal: Decimal) -> str:
    """The table as text: comma and point, or semicolon and comma, as the spreadsheet's country wants it.

    `level`: of the test, empty where it has none.
    """
    out = io.StringIO()
    writer = csv.writer(out, delimiter=";" if decimal == "comma" else ",")
    writer.writerow(COLUMNS)
    for row in rows:
        n = "" if row.n < 0 else row.n
        numbers = (_number(row.value, decimal), _number(row.sigma, decimal))
        words = map(csv_cell, (test, level, row.quantity, row.source))
        writer.writerow((*words, n, *numbers, row.unit))
    return out.getvalue()


def _number(value: float | None, decimal: Decimal) -> str:
    if value is None:
        return ""
    text = repr(value)
    return text.replace(".", ",") if decimal == "comma" else text
