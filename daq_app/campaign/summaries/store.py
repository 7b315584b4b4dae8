"""The summary of an analysis, beside its run as ``RUN.result.json``: read back to the last digit.

With it stands what the run says of its test, so that a run whose mark is the same need not be opened.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.campaign.recorded import RunAccount
from daq_app.campaign.status import TestFacts, TestVerdict
from daq_app.campaign.summaries.mark import AnalysisMark
from daq_app.campaign.summaries.summary import MethodResult, TestSummary
from daq_app.plain import plain
from daq_app.rocking.families.verdict import FamilyView, RVerdict
from daq_app.runfile.durable import write_whole

SUFFIX: Final = ".result.json"
_FORMAT: Final = 4
_ARRAYS: Final = ("time_s", "rotation_rad", "velocity_rad_s")


class NotKept(Exception):
    """No kept analysis stands for a fresh one: why, in words."""


@dataclass(frozen=True, slots=True)
class KeptAnalysis:
    """What stands beside a run: its own account of its test, and the summary of its analysis."""

    account: RunAccount
    summary: TestSummary


def keep_analysis(run: Path, mark: AnalysisMark, kept: KeptAnalysis) -> Path:
    """Write the analysis beside its run. Raises `OSError`."""
    # JSON knows no NaN and no infinity, which become words that `float` reads.
    document = {"format": _FORMAT, "mark": asdict(mark), **plain(kept, str)}
    return write_whole(run.with_suffix(SUFFIX), json.dumps(document, allow_nan=False))


def kept_analysis(run: Path, mark: AnalysisMark) -> KeptAnalysis:
    """The analysis kept beside a run, if it has just this mark. Raises `NotKept`."""
    try:
        document = json.loads(run.with_suffix(SUFFIX).read_text(encoding="utf-8"))
        if document["format"] != _FORMAT:
            raise NotKept("it was analysed by another version of the program or of its libraries")
        difference = mark.difference(AnalysisMark(**document["mark"]))
        if difference:
            raise NotKept(difference)
        return KeptAnalysis(_account(document["account"]), _summary(document["summary"]))
    except OSError:
        raise NotKept("no analysis is kept beside it") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise NotKept("the analysis kept beside it cannot be read") from None


def _account(content: dict[str, Any]) -> RunAccount:
    facts = content["facts"]
    told = TestFacts(
        **{
            **facts,
            **_floats(TestFacts, facts),
            "r": {name: float(r) for name, r in facts["r"].items()},
            "notes": tuple(facts["notes"]),
        }
    )
    return RunAccount(**{**content, "verdict": TestVerdict(content["verdict"]), "facts": told})


def _summary(content: dict[str, Any]) -> TestSummary:
    arrays = {name: np.asarray(content[name], dtype=np.float64) for name in _ARRAYS}
    numbers = {name: tuple(map(float, content[name])) for name in ("impacts_s", "peaks_rad", "periods_s")}
    parts = {
        "methods": {name: _method(method) for name, method in content["methods"].items()},
        "families": tuple(map(_view, content["families"])),
        "verdict": _verdict(content["verdict"]),
        "reasons": tuple(content["reasons"]),
    }
    return TestSummary(**{**content, **_floats(TestSummary, content), **arrays, **numbers, **parts})


def _method(content: dict[str, Any]) -> MethodResult:
    points = tuple((int(impact), float(r)) for impact, r in content["points"])
    return MethodResult(**{**content, **_floats(MethodResult, content), "points": points})


def _view(content: dict[str, Any]) -> FamilyView:
    intervals = {name: _pair(content[name]) for name in ("interval95_eav", "interval95_crt")}
    remarks = tuple(content["remarks"])
    return FamilyView(**{**content, **_floats(FamilyView, content), **intervals, "remarks": remarks})


def _verdict(content: dict[str, Any] | None) -> RVerdict | None:
    if content is None:
        return None
    tuples = {name: tuple(content[name]) for name in ("used", "left_out", "reasons")}
    numbers = _floats(RVerdict, content)
    return RVerdict(**{**content, **numbers, **tuples, "interval95": _pair(content["interval95"])})


def _floats(kind: type, content: dict[str, Any]) -> dict[str, float | None]:
    """Numbers of a dataclass, with those that are no finite number put back."""
    names = [f.name for f in fields(kind) if f.type in ("float", "float | None")]
    return {name: None if content[name] is None else float(content[name]) for name in names}


def _pair(values: Sequence[float | str] | None) -> tuple[float, float] | None:
    return None if values is None else (float(values[0]), float(values[1]))
