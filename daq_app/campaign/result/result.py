"""``python -m daq_app.campaign.result.result RUN.h5``: analyse a run beside its level, save the page.

A process of its own, so that a window that shows the result is never held up. Beside the run it
leaves ``RUN.result.json`` (the summary, kept for comparisons and the report), ``.html`` and ``.pdf``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from daq_app.campaign.names import TestName
from daq_app.campaign.recorded import read_recorded
from daq_app.campaign.status import NO_FACTS, RecordedTest, TestFacts, TestVerdict
from daq_app.campaign.summaries.mark import AnalysisMark
from daq_app.campaign.summaries.store import SUFFIX, NotKept, kept_analysis
from daq_app.campaign.summaries.summary import TestSummary, judged
from daq_app.config import ConfigError
from daq_app.extras import missing_extra
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.runfile import RunFileError, open_run


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
    summary = _kept(run)
    if summary is None:
        return None
    earlier: list[TestSummary] = []
    later: list[TestSummary] = []
    for test in others:
        kept = _kept(test.path) if test.path is not None else None
        if kept is not None:
            (earlier if test.released_ns < this.released_ns else later).append(judged(kept, test))
    return Result(judged(summary, this), tuple(earlier), tuple(later), this.facts)


def _kept(run: Path) -> TestSummary | None:
    try:
        return kept_analysis(run, AnalysisMark.of(run, AnalysisOptions())).summary
    except (NotKept, OSError):
        return None


def page_is_current(run: Path) -> bool:
    """Whether the page beside a run was made of the analysis that is kept there, or a later one."""
    try:
        kept, page = (run.with_suffix(suffix).stat().st_mtime_ns for suffix in (SUFFIX, ".result.pdf"))
    except OSError:
        return False
    return page >= kept


def make_result(run: Path) -> Result:
    """Analyse the run (and earlier ones that have no summary), save everything.

    Raises `NoResult`, also where the summary is saved and the packages of its page are not installed.
    """
    # Imported here: reading a saved result needs neither the analysis nor matplotlib.
    from daq_app.campaign.summaries.of_run import summarise_file
    from daq_app.campaign.summaries.summary import Failure

    this, others = level_of(run)
    earlier = [test for test in others if test.released_ns < this.released_ns]
    summaries: list[TestSummary] = []
    for test in [*earlier, this]:
        made = summarise_file(test, AnalysisOptions())
        if not isinstance(made, Failure):
            summaries.append(made)
        elif test is this:
            raise NoResult(f"{this.name} could not be analysed: {made.reason}")
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
