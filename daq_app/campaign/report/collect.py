"""Analyses every run of a campaign folder on all cores and gathers what the report needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from daq_app.campaign.names import TestName
from daq_app.campaign.recorded import orphans, test_of, unreadable, verdicts_of
from daq_app.campaign.report.summary import MethodResult, TestSummary
from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.campaign.verdicts import OperatorVerdict
from daq_app.config import Rig
from daq_app.rocking.analysis.analyse import AnalysisOptions, analyse_record
from daq_app.rocking.analysis.results import Series, TestAnalysis
from daq_app.rocking.record import TestRecord
from daq_app.runfile import Run, RunFileError, open_run
from daq_app.runfile.folder import RUN_SUFFIX, find_runs
from daq_app.workers import Workers, run_all

_KEYS = {"CRT": "crt", "EAV": "eav"}
_SHOWN_RATE_HZ = 200.0
"""Rate of the histories in figures: at 4000 Hz a picture would weigh megabytes and look the same."""
_BEFORE_S = 0.3

Progress = Callable[[int, int, str], None]
"""Called with (done, total, name of the test just analysed)."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A run that could not be analysed, and why."""

    test: str
    path: Path
    reason: str
    flagged_bad: bool = False
    """Somebody or the recorder had rejected it before: nobody expected an analysis."""


@dataclass(frozen=True, slots=True)
class Collected:
    """A folder of runs, each opened once: what it holds and what the analysis made of it."""

    recorded: tuple[RecordedTest, ...]
    tests: tuple[TestSummary, ...]
    failures: tuple[Failure, ...]


def collect(
    folder: Path,
    *,
    options: AnalysisOptions | None = None,
    workers: Workers = None,
    progress: Progress | None = None,
) -> Collected:
    """Judge and analyse all runs of a folder and below; lost tests are not analysed.

    Raises what `read_recorded` raises. Ctrl-C ends it cleanly: `KeyboardInterrupt` once the workers have
    stopped.
    """
    verdicts = verdicts_of(folder)
    runs = find_runs(folder)
    work = partial(read_and_summarise, verdicts=verdicts, options=options or AnalysisOptions())

    def done(number: int, path: Path) -> None:
        if progress:
            progress(number, len(runs), path.stem)

    answers = run_all(work, runs, workers, done)
    loose = [(test, _journal_only(test)) for test in orphans(folder, verdicts)]
    pairs = [(test, made) for test, made in [*answers, *loose] if test is not None]
    return Collected(
        recorded=tuple(test for test, _ in pairs),
        tests=tuple(made for _, made in pairs if isinstance(made, TestSummary)),
        failures=tuple(made for _, made in pairs if isinstance(made, Failure)),
    )


def read_and_summarise(
    path: Path, verdicts: Mapping[str, OperatorVerdict], options: AnalysisOptions
) -> tuple[RecordedTest | None, TestSummary | Failure | None]:
    """Judge and analyse one run file, opened once; None where there is nothing to judge or analyse."""
    try:
        with open_run(path) as run:
            test = test_of(run, verdicts)
            if test is None or test.verdict is TestVerdict.LOST:
                return test, None
            return test, _analysed(test, run, options)
    except RunFileError as error:
        return unreadable(path, error), None


def summarise_run(test: RecordedTest, options: AnalysisOptions) -> TestSummary | Failure:
    """Analyse one run file. Whatever is wrong with it comes back as a `Failure`, in words."""
    assert test.path is not None
    if test.path.suffix != RUN_SUFFIX:
        return _journal_only(test) or _failure(test, "a lost test")
    try:
        with open_run(test.path) as run:
            return _analysed(test, run, options)
    except RunFileError as error:
        return _failure(test, str(error))


def _analysed(test: RecordedTest, run: Run, options: AnalysisOptions) -> TestSummary | Failure:
    if run.rig is None:
        return _failure(test, "the run does not say which rig it was made with")
    try:
        analysis = analyse_record(TestRecord.from_run(run, run.rig), options)
        if not analysis.found:
            return _failure(test, "; ".join(note.text for note in analysis.notes))
        return summarise(test, run.rig, analysis)
    except (RunFileError, ValueError) as error:
        return _failure(test, str(error))


def _journal_only(test: RecordedTest) -> Failure | None:
    """Why a test of which only the journal is there is not analysed; None where it is lost anyway."""
    if test.verdict is TestVerdict.LOST:
        return None
    return _failure(test, "only a journal so far: `daq-app recover` makes its run file")


def _failure(test: RecordedTest, reason: str) -> Failure:
    return Failure(str(test.name), Path(test.path or ""), reason, test.verdict is TestVerdict.BAD)


def summarise(test: RecordedTest, rig: Rig, analysis: TestAnalysis) -> TestSummary:
    """One analysed test as the report sees it; the release is made positive."""
    assert test.path is not None
    name: TestName = test.name
    cycles = analysis.half_cycles
    peaks = [abs(cycle.peak_rad) for cycle in cycles]
    last = next((n for n, peak in enumerate(peaks) if not math.isfinite(peak)), len(peaks))
    warnings = [note.text for note in analysis.notes if note.severity == "warning"]
    warnings = list(dict.fromkeys([*analysis.verdict.reasons, *warnings]))
    good = test.verdict is not TestVerdict.BAD
    reasons = tuple(filter(None, [test.reason])) if not good else tuple(warnings)
    return TestSummary(
        test=str(name),
        specimen=name.specimen,
        level=name.level,
        repetition=name.repetition,
        run=test.path.name,
        alpha_rad=rig.specimen.alpha0_rad,
        p_rad_s=analysis.theory.p_rad_s,
        r_max=analysis.theory.r_max,
        theta0_rad=analysis.theta0_rad * analysis.side,
        impacts_s=tuple(cycle.start_s - analysis.release_s for cycle in cycles[1:]),
        peaks_rad=tuple(peaks[:last]),
        periods_s=_periods(analysis),
        methods=_methods(analysis),
        good=good,
        trust=analysis.verdict.trust,
        verdict=analysis.verdict,
        families=analysis.families,
        reasons=reasons,
        **_history(analysis.series, analysis),
    )


def _periods(analysis: TestAnalysis) -> tuple[float, ...]:
    """T_n = twice the half-cycle after impact n, for n = 1, 2, …, up to the first that is not known."""
    periods_s: list[float] = []
    for cycle in analysis.half_cycles[1:]:
        if not math.isfinite(cycle.duration_s):
            break
        periods_s.append(2.0 * cycle.duration_s)
    return tuple(periods_s)


def _methods(analysis: TestAnalysis) -> dict[str, MethodResult]:
    methods: dict[str, MethodResult] = {}
    for label, key in _KEYS.items():
        estimate = analysis.estimates[key]
        if estimate.r is None or estimate.standard_error is None:
            continue
        bias = analysis.bias.get(key)
        methods[label] = MethodResult(
            r=estimate.r,
            standard_error=estimate.standard_error,
            bias=bias.mean if bias else 0.0,
            bias_standard_error=bias.standard_error if bias else 0.0,
            points=tuple((point.impact, point.r) for point in estimate.points),
        )
    if analysis.fit is not None and analysis.fit.explains_the_motion:
        bias = analysis.bias.get("fit")
        methods["fit"] = MethodResult(
            r=analysis.fit.r,
            standard_error=analysis.fit.standard_error,
            bias=bias.mean if bias else 0.0,
            bias_standard_error=bias.standard_error if bias else 0.0,
        )
    return methods


def _history(series: Series | None, analysis: TestAnalysis) -> dict[str, np.ndarray]:
    """Rotation and velocity from just before the release to just after rest, thinned."""
    if series is None:
        empty = np.empty(0)
        return {"time_s": empty, "rotation_rad": empty, "velocity_rad_s": empty}
    end = analysis.rest_s if math.isfinite(analysis.rest_s) else float(series.time_s[-1])
    first, last = np.searchsorted(series.time_s, [analysis.release_s - _BEFORE_S, end + _BEFORE_S])
    step = max(1, round(analysis.rate_hz / _SHOWN_RATE_HZ))
    pick = slice(int(first), int(last), step)
    return {
        "time_s": series.time_s[pick] - analysis.release_s,
        "rotation_rad": series.rotation_rad[pick] * analysis.side,
        "velocity_rad_s": series.velocity_rad_s[pick] * analysis.side,
    }
