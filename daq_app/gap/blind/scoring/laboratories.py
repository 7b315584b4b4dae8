"""The table of scores laboratory by laboratory: one row for each, from the same judged cases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from daq_app.gap.blind.scoring.judge import Judged
from daq_app.gap.blind.scoring.score import Row, table, wrong_and_sure
from daq_app.gap.blind.scoring.statistics import Value

_ROWS: Final = {
    "decisions right": "decision right, all cases",
    "first right ≥ 4 sd": "first answer right, effect ≥ 4 sd",
    "calibration error": "expected calibration error",
    "calibration error by chance": "calibration error by chance alone",
    "AUROC outside": "outside the library: AUROC",
    "set holds truth": "95 % set holds the truth",
    "closure ≥ 0.9": "closure ≥ 0.9",
    "pairs exact": "pairs exact",
    "triples exact": "triples exact",
    "outside blamed": "outside, blamed on an effect as decided",
    "null blamed": "nothing hidden, yet blamed on an effect",
    "intervals": "95 % interval holds the parameter",
}
"""Column → row of the score table."""


@dataclass(frozen=True, slots=True)
class LaboratoryScore:
    """One row: the laboratory, how many of its cases have a result, and a short text for each column."""

    laboratory: str
    cases: int
    columns: dict[str, str]


def by_laboratory(judged: Sequence[Judged]) -> list[LaboratoryScore]:
    """One row for each laboratory in the order in which they come, and one for all if there are several."""
    names = list(dict.fromkeys(j.laboratory for j in judged))
    rows = [_score(name, [j for j in judged if j.laboratory == name]) for name in names]
    return [*rows, _score("all", judged)] if len(names) > 1 else rows


def _score(name: str, judged: Sequence[Judged]) -> LaboratoryScore:
    found: dict[str, Row] = {row.name: row for row in table(judged)}
    columns = {column: _short(found[row].found) for column, row in _ROWS.items() if row in found}
    sure = sum(wrong_and_sure(j) for j in judged)
    columns["wrong at p > 0.95"] = f"{sure}/{len(judged)}"
    for title, category in (("singles", "single"), ("outside", "outside"), ("nothing", "null")):
        columns[title] = _count([j for j in judged if j.category == category])
    return LaboratoryScore(name, len(judged), columns)


def _count(judged: Sequence[Judged]) -> str:
    return f"{sum(j.answered_rightly for j in judged)}/{len(judged)}" if judged else "–"


def _short(value: Value) -> str:
    return f"{value.value:.2f} ({value.n})" if value.n else "–"
