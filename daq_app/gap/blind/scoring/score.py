"""The scores of a check: the table of the design page, laboratory by laboratory, and the confusion matrix."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.gap.blind.layout import RESULTS, SEAL_FILE
from daq_app.gap.blind.names import base_name
from daq_app.gap.blind.running.runner import case_folders, read_outcome
from daq_app.gap.blind.scoring.judge import Judged, judge
from daq_app.gap.blind.scoring.statistics import (
    Value,
    at_false_alarms,
    auroc_interval,
    bootstrap,
    calibration,
    calibration_error_by_chance,
    number,
    share,
)
from daq_app.gap.blind.seal import SealBroken, open_label
from daq_app.plain import plain
from daq_app.runfile.digest import file_sha256

_SURE = 0.95
_FALSE_ALARMS = 0.05
_HIDDEN = ("single", "pair", "triple")
_SEVERAL_OR_NONE: Final = {"pair": "(pair)", "triple": "(triple)", "null": "(nothing)"}
_COLUMNS: Final = {
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
class Row:
    """One line of the table. `low` and `high` bound the target; None on a side without a bound."""

    name: str
    found: Value
    low: float | None = None
    high: float | None = None

    @property
    def target(self) -> str:
        match (self.low, self.high):
            case (None, None):
                return ""
            case (low, None):
                return f"≥ {low:g}"
            case (None, high):
                return f"≤ {high:g}"
            case (low, high):
                return f"{low:g} to {high:g}"
        return ""

    @property
    def cells(self) -> tuple[str, ...]:
        """Name, value, 95 % interval, cases and target as a table shows them."""
        value, low, high, n = astuple(self.found)
        interval = "–" if math.isnan(value) else f"{low:.3g} to {high:.3g}"
        return self.name, number(value), interval, str(n), self.target

    @property
    def met(self) -> bool | None:
        """Whether the value meets the target; None without a target or without cases."""
        if (self.low is None and self.high is None) or math.isnan(self.found.value):
            return None
        above = self.low is None or self.found.value >= self.low
        return above and (self.high is None or self.found.value <= self.high)


@dataclass(frozen=True, slots=True)
class Score:
    """All that the report shows."""

    rows: tuple[Row, ...]
    judged: tuple[Judged, ...]
    waiting: tuple[str, ...]
    """Sealed cases without a result."""

    @property
    def passed(self) -> bool:
        """Every target that could be measured is met, and every case has a result."""
        return not self.waiting and all(row.met is not False for row in self.rows)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able: rows and judged cases; NaN and infinity as null."""
        rows = [{**asdict(row), "target": row.target, "met": row.met} for row in self.rows]
        data = {"rows": rows, "cases": self.judged, "waiting": self.waiting}
        cleaned: dict[str, Any] = plain(data)
        return cleaned


def score_folder(folder: Path, labels: Path, kept: str = RESULTS) -> Score:
    """Open the label of every case that has a result in the folder `kept`, and score it.

    Raises `SealBroken` at the first of these labels or files that is not what was sealed, and for a
    result that was given for other data.
    """
    judged: list[Judged] = []
    waiting: list[str] = []
    cases = case_folders(folder)
    if not cases:
        raise SealBroken(f"{folder}: there are no sealed cases")
    for case in cases:
        outcome = read_outcome(folder, case.name, kept)
        if outcome is None:
            waiting.append(case.name)  # its label stays sealed until there is an answer
            continue
        label = open_label(case, labels / f"{case.name}.json")
        if outcome.seal_sha256 != file_sha256(case / SEAL_FILE):
            raise SealBroken(f"{case.name}: the result belongs to other data. Run the diagnosis again")
        judged.append(judge(label, outcome))
    return Score(tuple(table(judged)), tuple(judged), tuple(waiting))


def table(judged: Sequence[Judged]) -> list[Row]:
    """The rows in the order of the design page."""
    singles = [j for j in judged if j.category == "single"]
    visible = [j for j in singles if j.visible]
    weak = [j for j in singles if not j.visible]
    known = [j for j in judged if j.category != "outside" or j.known]
    nulls = [j for j in judged if j.category == "null"]
    pairs = [j for j in judged if j.category == "pair"]
    triples = [j for j in judged if j.category == "triple"]
    sizes = [float(j.set_size) for j in known if j.set_size]
    unsure = [j for j in judged if j.decision == "cannot_tell"]
    speaking = [j for j in judged if j.decision != "failed"]
    return [
        Row("first answer right, effect ≥ 4 sd", share([j.first_right for j in visible]), low=0.95),
        Row("family right, effect ≥ 4 sd", share([j.family_right for j in visible]), low=0.98),
        Row("first answer right, effect < 4 sd", share([j.first_right for j in weak])),
        Row("95 % set holds the truth", share([j.in_set for j in known]), 0.93, 0.98),
        Row("95 % set: mean size", bootstrap(sizes, np.mean), high=1.5),
        Row("wrong at p > 0.95", share([wrong_and_sure(j) for j in speaking]), high=0.01),
        Row("expected calibration error", calibration(*claims(judged)), high=0.05),
        Row("calibration error by chance alone", calibration_error_by_chance(claims(judged)[0])),
        *_outside_rows(judged),
        Row("nothing hidden, yet blamed on an effect", share([j.blames for j in nulls]), high=0.05),
        *_closure_rows(judged),
        *_parameter_rows(singles),
        Row("pairs exact", share([j.exact for j in pairs]), low=0.80),
        *([Row("triples exact", share([j.exact for j in triples]), low=0.75)] if triples else []),
        Row(
            "cannot tell: truth in the set, measurement named",
            share([j.in_set and bool(j.next_measurement) for j in unsure]),
        ),
        Row("decision right, all cases", share([j.answered_rightly for j in judged])),
        Row("no result", share([j.decision == "failed" for j in judged]), high=0.0),
        Row("seconds per diagnosis, median", bootstrap([j.seconds for j in speaking])),
    ]


def _outside_rows(judged: Sequence[Judged]) -> list[Row]:
    """Outside the library: how well it ranks, and what is still put on an effect of the library.

    The threshold is the one at which at most 5 % of the cases that the library does explain are
    called "none of these".
    """
    outside = [j for j in judged if j.category == "outside" and not j.known]
    inside = [j for j in judged if j.category != "outside" and j.decision != "failed"]
    scores_outside, scores_inside = ([j.outside_score for j in group] for group in (outside, inside))
    threshold = at_false_alarms(scores_inside, _FALSE_ALARMS)
    attributed = [j.blames and not j.outside_score > threshold for j in outside]
    other_family = [
        a and not set(j.families) & set(j.named_family.split(" + "))
        for a, j in zip(attributed, outside, strict=True)
    ]
    return [
        Row("outside the library: AUROC", auroc_interval(scores_outside, scores_inside), low=0.97),
        Row("outside, attributed to an effect (at 5 % false alarms)", share(attributed), high=0.05),
        Row("outside, attributed to a wrong family (at 5 % false alarms)", share(other_family), high=0.02),
        Row(
            'known, yet decided "none of these"',
            share([j.decision == "none_of_these" for j in inside]),
            high=_FALSE_ALARMS,
        ),
        Row("outside, blamed on an effect as decided", share([j.blames for j in outside])),
    ]


def _closure_rows(judged: Sequence[Judged]) -> list[Row]:
    found = [j for j in judged if j.category in _HIDDEN and j.visible and j.blames]
    closures = [j.closure for j in found if math.isfinite(j.closure)]
    return [
        Row("closure, median", bootstrap(closures), low=0.97),
        Row("closure ≥ 0.9", share([c >= 0.9 for c in closures]), low=0.9),
        Row(
            "held-out gap after, against the floor, median",
            bootstrap([j.after_to_floor for j in found]),
            high=1.1,
        ),
    ]


def _parameter_rows(singles: Sequence[Judged]) -> list[Row]:
    met = [j for j in singles if j.parameter_covered is not None and j.first_right]
    return [
        Row("parameter error, median", bootstrap([j.parameter_error for j in met]), high=0.02),
        Row("95 % interval holds the parameter", share([bool(j.parameter_covered) for j in met]), 0.92, 0.98),
    ]


def wrong_and_sure(j: Judged) -> bool:
    """Whether an answer stands by a wrong first hypothesis with more than 95 %."""
    return j.decision != "none_of_these" and j.claimed > _SURE and not j.first_right


def claims(judged: Sequence[Judged]) -> tuple[list[float], list[bool]]:
    """(claimed probability, right) of the first hypothesis wherever the answer stands by it.

    Where it says "none of these" its probabilities are conditional on the library and no claim.
    """
    spoken = [j for j in judged if j.decision not in ("failed", "none_of_these")]
    kept = [j for j in spoken if not math.isnan(j.claimed)]
    return [j.claimed for j in kept], [j.first_right for j in kept]


def confusion(judged: Sequence[Judged]) -> Counter[tuple[str, str]]:
    """Cases by truth (effect, or how many) and answer (effect, or the decision that names none)."""
    counts: Counter[tuple[str, str]] = Counter()
    for one in judged:
        truth = _SEVERAL_OR_NONE.get(one.category) or one.truth[0]
        answer = f"({one.decision})"
        if one.decision == "effect" and len(one.named) == 1:
            # Accepted synonyms stand on the diagonal.
            answer = truth if one.first_right else base_name(one.named[0])
        counts[truth, answer] += 1
    return counts


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
    columns = {column: _short(found[row].found) for column, row in _COLUMNS.items() if row in found}
    sure = sum(wrong_and_sure(j) for j in judged)
    columns["wrong at p > 0.95"] = f"{sure}/{len(judged)}"
    for title, category in (("singles", "single"), ("outside", "outside"), ("nothing", "null")):
        columns[title] = _count([j for j in judged if j.category == category])
    return LaboratoryScore(name, len(judged), columns)


def _count(judged: Sequence[Judged]) -> str:
    return f"{sum(j.answered_rightly for j in judged)}/{len(judged)}" if judged else "–"


def _short(value: Value) -> str:
    return f"{value.value:.2f} ({value.n})" if value.n else "–"
