"""Analyses every run of a campaign folder on all cores and gathers what the report needs.

What is kept beside a run is taken by threads of this process: nearly all of it is hashing, which needs no
process of its own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from daq_app.campaign.recorded import orphans, verdicts_of
from daq_app.campaign.status import RecordedTest
from daq_app.campaign.summaries.of_run import (
    Answer,
    failure_of_journal,
    kept_answer,
    read_and_summarise,
)
from daq_app.campaign.summaries.store import NotKept
from daq_app.campaign.summaries.summary import Failure, TestSummary
from daq_app.campaign.verdicts import OperatorVerdict
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.runfile.folder import find_runs
from daq_app.workers import Workers, run_all

_NAMED = 6
"""Tests that were analysed anew are named up to this number, and counted beyond it."""

Progress = Callable[[int, int, str], None]
"""Called with (done, total, name of the test just analysed)."""


@dataclass(frozen=True, slots=True)
class Collected:
    """A folder of runs, each opened once: what it holds and what the analysis made of it."""

    recorded: tuple[RecordedTest, ...]
    tests: tuple[TestSummary, ...]
    failures: tuple[Failure, ...]
    kept: int
    """Tests whose analysis was taken as it is kept beside the run."""
    anew: Mapping[str, tuple[str, ...]]
    """The other ones that were analysed, by the reason."""
    nameless: tuple[Path, ...] = ()
    """Files that hold no release of a named test, or cannot be read and have no test's name."""

    @property
    def origin(self) -> str:
        """A sentence on where the analyses come from."""
        parts = [f"{self.kept} kept beside their runs"] if self.kept else []
        for reason, tests in self.anew.items():
            which = ", ".join(tests) if len(tests) <= _NAMED else str(len(tests))
            parts.append(f"{which} made anew ({reason})")
        return f"Analyses: {'; '.join(parts)}."


def collect(
    folder: Path,
    *,
    options: AnalysisOptions | None = None,
    workers: Workers = None,
    progress: Progress | None = None,
    anew: bool = False,
) -> Collected:
    """Judge and analyse all runs of a folder and below; lost tests are not analysed.

    An analysis that is kept beside its run is taken where a fresh one would give the same, unless `anew`.
    Raises what `read_recorded` raises. Ctrl-C ends it cleanly: `KeyboardInterrupt` once the workers have
    stopped.
    """
    verdicts = verdicts_of(folder)
    runs, options = find_runs(folder), options or AnalysisOptions()
    found: dict[Path, Answer] = {}

    def done(number: int, path: Path) -> None:
        if progress:
            progress(number, len(runs), path.stem)

    # Other machines know for themselves whether what is kept is theirs: their processors may differ.
    if not anew and not isinstance(workers, str):
        take = partial(_kept_or_none, verdicts=verdicts, options=options)
        found = _kept(runs, take, workers, done)
    work = partial(read_and_summarise, verdicts=verdicts, options=options, use_kept=not anew)
    left, taken = [path for path in runs if path not in found], len(found)
    made = run_all(work, left, workers, lambda number, path: done(taken + number, path))
    found.update(zip(left, made, strict=True))
    answers = [found[path] for path in runs]
    loose = [Answer(test, failure_of_journal(test)) for test in orphans(folder, verdicts)]
    known = [(one.test, one.made) for one in [*answers, *loose] if one.test is not None]
    reasons = dict.fromkeys(one.anew for one in answers if one.anew)
    return Collected(
        recorded=tuple(test for test, _ in known),
        tests=tuple(made for _, made in known if isinstance(made, TestSummary)),
        failures=tuple(made for _, made in known if isinstance(made, Failure)),
        kept=sum(isinstance(one.made, TestSummary) and not one.anew for one in answers),
        anew={
            reason: tuple(one.made.test for one in answers if one.anew == reason and one.made is not None)
            for reason in reasons
        },
        nameless=tuple(path for path in runs if found[path].test is None),
    )


def _kept(
    runs: Sequence[Path],
    take: Callable[[Path], Answer | None],
    threads: int | None,
    done: Callable[[int, Path], None],
) -> dict[Path, Answer]:
    found: dict[Path, Answer] = {}
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        for path, answer in zip(runs, pool.map(take, runs), strict=True):
            if answer is not None:
                found[path] = answer
                done(len(found), path)
    return found


def _kept_or_none(
    path: Path, verdicts: Mapping[str, OperatorVerdict], options: AnalysisOptions
) -> Answer | None:
    try:
        return kept_answer(path, verdicts, options)
    except NotKept:
        return None
