"""``python -m daq_app.campaign.result.result RUN.h5``: analyse a run beside its level, save the page.

A process of its own, so that a window that shows the result is never held up. Beside the run it
leaves ``RUN.result.json`` (the summary, also the cache for later comparisons), ``.html`` and ``.pdf``.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from daq_app.campaign.names import TestName
from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.report.summary import MethodResult, TestSummary
from daq_app.campaign.status import NO_FACTS, RecordedTest, TestFacts, TestVerdict
from daq_app.config import ConfigError
from daq_app.extras import missing_extra
from daq_app.rocking.analysis.plain import plain
from daq_app.rocking.families.verdict import FamilyView, RVerdict
from daq_app.runfile import RunFileError, open_run
from daq_app.runfile.durable import write_whole

SUFFIX: Final = ".result.json"
_FORMAT: Final = 2
_ARRAYS: Final = ("time_s", "rotation_rad", "velocity_rad_s")


@dataclass(frozen=True, slots=True)
class Result:
    """A test with the other ones of its level, oldest first."""

    test: TestSummary
    earlier: tuple[TestSummary, ...]
    later: tuple[TestSummary, ...] = ()
    """Released after it, as far as they have a result."""
    facts: TestFacts = NO_FACTS

    @property
    def in_order(self) -> tuple[TestSummary, ...]:
        """All tests of the level in the order of their releases."""
        return (*self.earlier, self.test, *self.later)


class NoResult(Exception):
    """The run gives no result: why, in words."""


def save_summary(run: Path, summary: TestSummary) -> Path:
    """Write the summary beside its run."""
    content = asdict(summary)
    for name in _ARRAYS:
        content[name] = np.round(np.asarray(content[name], dtype=np.float64), 9).tolist()
    content |= {"families": plain(summary.families), "verdict": plain(summary.verdict)}
    path = run.with_suffix(SUFFIX)
    document = {"format": _FORMAT, "run_bytes": run.stat().st_size, "summary": content}
    return write_whole(path, json.dumps(document))


def load_summary(run: Path) -> TestSummary | None:
    """The summary saved beside a run; None if there is none for just this file."""
    try:
        document = json.loads(run.with_suffix(SUFFIX).read_text(encoding="utf-8"))
        if document["format"] != _FORMAT or document["run_bytes"] != run.stat().st_size:
            return None
        return _summary(document["summary"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _summary(content: dict[str, Any]) -> TestSummary:
    methods = {
        name: MethodResult(**{**method, "points": tuple((int(i), float(r)) for i, r in method["points"])})
        for name, method in content["methods"].items()
    }
    arrays = {name: np.asarray(content[name], dtype=np.float64) for name in _ARRAYS}
    tuples = {name: tuple(content[name]) for name in ("impacts_s", "peaks_rad", "periods_s", "reasons")}
    views = {"families": tuple(map(_view, content["families"])), "verdict": _verdict(content["verdict"])}
    return TestSummary(**{**content, **arrays, **tuples, **views, "methods": methods})


def _view(content: dict[str, Any]) -> FamilyView:
    """JSON knows no NaN: a number that is not known is None there."""
    numbers = {f.name: content[f.name] for f in fields(FamilyView) if f.type == "float"}
    known = {name: math.nan if value is None else float(value) for name, value in numbers.items()}
    intervals = {name: _pair(content[name]) for name in ("interval95_eav", "interval95_crt")}
    return FamilyView(**{**content, **known, **intervals, "remarks": tuple(content["remarks"])})


def _verdict(content: dict[str, Any] | None) -> RVerdict | None:
    if content is None:
        return None
    tuples = {name: tuple(content[name]) for name in ("used", "left_out", "reasons")}
    return RVerdict(**{**content, **tuples, "interval95": _pair(content["interval95"])})


def _pair(values: Sequence[float] | None) -> tuple[float, float] | None:
    return None if values is None else (float(values[0]), float(values[1]))


def judged(summary: TestSummary, test: RecordedTest) -> TestSummary:
    """The summary under the verdict that holds now: the operator may have changed it since."""
    if test.verdict is TestVerdict.BAD:
        return replace(summary, good=False, reasons=(test.reason,) if test.reason else summary.reasons)
    return replace(summary, good=True)


def level_of(run: Path) -> tuple[RecordedTest, list[RecordedTest]]:
    """The test of a run, and the other tests of its level, oldest first. Raises `NoResult`."""
    try:
        recorded = [test for test in read_recorded(run.parent) if test.path is not None]
    except (ConfigError, RunFileError) as error:
        raise NoResult(str(error)) from error
    this = next((test for test in recorded if test.path is not None and test.path.name == run.name), None)
    if this is None:
        raise NoResult(_belongs_nowhere(run))
    name: TestName = this.name
    others = [
        test
        for test in recorded
        if (test.name.specimen, test.name.level) == (name.specimen, name.level)
        and test is not this
        and test.verdict is not TestVerdict.LOST
    ]
    return this, sorted(others, key=lambda test: test.released_ns)


def _belongs_nowhere(run: Path) -> str:
    """Why a run is no test of the campaign, and what to do about it."""
    try:
        with open_run(run) as opened:
            kept = opened.header.kept is not None
    except RunFileError as error:
        return str(error)
    if kept:
        return (
            f"Nobody had armed this release: {run.name} belongs to no test yet. To give it its place: "
            f"daq-app campaign assign {run} NAME, where NAME is the test that it is"
        )
    return f"{run.name} holds no release of a named test: there is no result to show"


def load_result(run: Path) -> Result | None:
    """The result as saved beside the runs; None if the run itself has none yet. Raises `NoResult`."""
    this, others = level_of(run)
    summary = load_summary(run)
    if summary is None:
        return None
    earlier: list[TestSummary] = []
    later: list[TestSummary] = []
    for test in others:
        saved = load_summary(test.path) if test.path is not None else None
        if saved is not None:
            (earlier if test.released_ns < this.released_ns else later).append(judged(saved, test))
    return Result(judged(summary, this), tuple(earlier), tuple(later), this.facts)


def make_result(run: Path) -> Result:
    """Analyse the run (and earlier ones that have no summary), save everything.

    Raises `NoResult`, also where the summary is saved and the packages of its page are not installed.
    """
    # Imported here: reading a saved result needs neither the analysis nor matplotlib.
    from daq_app.campaign.report.collect import Failure, summarise_run
    from daq_app.rocking.analysis.analyse import AnalysisOptions

    this, others = level_of(run)
    earlier = [test for test in others if test.released_ns < this.released_ns]
    summaries: list[TestSummary] = []
    for test in [*earlier, this]:
        assert test.path is not None
        summary = load_summary(test.path)
        if summary is None:
            made = summarise_run(test, AnalysisOptions())
            if isinstance(made, Failure):
                if test is this:
                    raise NoResult(f"{this.name} could not be analysed: {made.reason}")
                continue
            save_summary(test.path, made)
            summary = made
        summaries.append(judged(summary, test))
    result = Result(summaries[-1], tuple(summaries[:-1]), facts=this.facts)
    try:
        from daq_app.campaign.result.report import write_result
    except ModuleNotFoundError as error:
        missing = missing_extra(error)
        if missing is None:
            raise
        raise NoResult(f"The figures are saved, the page is not: {missing}") from error
    write_result(run, result.test, result.earlier, result.facts)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """0 when the result is saved; 1 with a sentence on standard output when there is none."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if len(arguments) != 1:
        print("usage: python -m daq_app.campaign.result.result RUN.h5")
        return 2
    try:
        make_result(Path(arguments[0]))
    except (NoResult, OSError) as error:
        print(error)
        return 1
    print("The result is saved")
    return 0


if __name__ == "__main__":
    sys.exit(main())
