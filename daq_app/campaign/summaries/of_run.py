"""Judges and analyses a run, or takes the analysis that is kept beside it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from daq_app.campaign.recorded import account_of, test_by, test_of, unreadable
from daq_app.campaign.status import RecordedTest, TestVerdict
from daq_app.campaign.summaries.mark import AnalysisMark
from daq_app.campaign.summaries.store import KeptAnalysis, NotKept, keep_analysis, kept_analysis
from daq_app.campaign.summaries.summary import Failure, MethodResult, TestSummary, judged
from daq_app.campaign.verdicts import OperatorVerdict
from daq_app.config import Rig
from daq_app.rocking.analysis.options import AnalysisOptions
from daq_app.rocking.record import TestRecord
from daq_app.runfile import Run, RunFileError, open_run
from daq_app.runfile.folder import RUN_SUFFIX

if TYPE_CHECKING:
    from daq_app.rocking.analysis.results import Series, TestAnalysis

_KEYS = {"CRT": "crt", "EAV": "eav"}
_SHOWN_RATE_HZ = 200.0
"""Rate of the histories in figures: at 4000 Hz a picture would weigh megabytes and look the same."""
_BEFORE_S = 0.3


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of one run: its test, and its summary or why there is none."""

    test: RecordedTest | None
    """None where the file holds no release of a named test."""
    made: TestSummary | Failure | None = None
    anew: str = ""
    """Why it was analysed anew; empty where a kept analysis was taken, or nothing was analysed."""


def read_and_summarise(
    path: Path, verdicts: Mapping[str, OperatorVerdict], options: AnalysisOptions, *, use_kept: bool = True
) -> Answer:
    """The analysis kept beside a run where that holds; else the run, opened once, judged and analysed."""
    reason = "as asked for"
    if use_kept:
        try:
            return kept_answer(path, verdicts, options)
        except NotKept as error:
            reason = str(error)
    try:
        with open_run(path) as run:
            test = test_of(run, verdicts)
            if test is None or test.verdict is TestVerdict.LOST:
                return Answer(test)
            made = _analysed_and_kept(test, run, options)
            return Answer(test, made, reason)
    except RunFileError as error:
        return Answer(unreadable(path, error))


def kept_answer(path: Path, verdicts: Mapping[str, OperatorVerdict], options: AnalysisOptions) -> Answer:
    """The test of a run by the analysis kept beside it. Raises `NotKept`.

    The run is not opened: it is, to the last byte, the one that was opened when it was analysed.
    """
    try:
        kept = kept_analysis(path, AnalysisMark.of(path, options))
    except OSError as error:
        raise NotKept(f"it cannot be read ({error.strerror or error})") from None
    test = test_by(kept.account, path, verdicts)
    if test is None or test.verdict is TestVerdict.LOST:
        return Answer(test)
    return Answer(test, judged(kept.summary, test))


def summarise_file(test: RecordedTest, options: AnalysisOptions) -> TestSummary | Failure:
    """The summary of a recorded test, kept or new; whatever is wrong comes back as a `Failure`, in words."""
    assert test.path is not None
    if test.path.suffix != RUN_SUFFIX:
        return failure_of_journal(test) or _failure(test, "a lost test")
    with contextlib.suppress(NotKept, OSError):
        return judged(kept_analysis(test.path, AnalysisMark.of(test.path, options)).summary, test)
    try:
        with open_run(test.path) as run:
            return _analysed_and_kept(test, run, options)
    except RunFileError as error:
        return _failure(test, str(error))


def _analysed_and_kept(test: RecordedTest, run: Run, options: AnalysisOptions) -> TestSummary | Failure:
    """A new summary of an opened run. Only analyses with the usual options, as the window shows, are kept."""
    try:
        mark = AnalysisMark.of(run.path, options)
    except OSError as error:
        return _failure(test, str(error))
    made = _analysed(test, run, options)
    if isinstance(made, Failure):
        return made
    if options == AnalysisOptions():
        with contextlib.suppress(OSError):  # a folder that cannot be written into holds runs all the same
            # The file may have become another one while it was read.
            if AnalysisMark.of(run.path, options) == mark:
                keep_analysis(run.path, mark, KeptAnalysis(account_of(run), made))
    return judged(made, test)


def _analysed(test: RecordedTest, run: Run, options: AnalysisOptions) -> TestSummary | Failure:
    from daq_app.rocking.analysis.analyse import analyse_record  # loads SciPy: not for what is kept

    if run.rig is None:
        return _failure(test, "the run does not say which rig it was made with")
    try:
        analysis = analyse_record(TestRecord.from_run(run, run.rig), options)
        if not analysis.found:
            return _failure(test, "; ".join(note.text for note in analysis.notes))
        return summarise(test, run.rig, analysis)
    except (RunFileError, ValueError) as error:
        return _failure(test, str(error))


def failure_of_journal(test: RecordedTest) -> Failure | None:
    """Why a test of which only the journal is there is not analysed; None where it is lost anyway."""
    if test.verdict is TestVerdict.LOST:
        return None
    return _failure(test, "only a journal so far: `daq-app recover` makes its run file")


def _failure(test: RecordedTest, reason: str) -> Failure:
    return Failure(str(test.name), Path(test.path or ""), reason, test.verdict is TestVerdict.BAD)


def summarise(test: RecordedTest, rig: Rig, analysis: TestAnalysis) -> TestSummary:
    """One analysed test as the report sees it, whatever its verdict; the release is made positive."""
    assert test.path is not None
    cycles = analysis.half_cycles
    peaks = [abs(cycle.peak_rad) for cycle in cycles]
    last = next((n for n, peak in enumerate(peaks) if not math.isfinite(peak)), len(peaks))
    warnings = [note.text for note in analysis.notes if note.severity == "warning"]
    return TestSummary(
        test=str(test.name),
        specimen=test.name.specimen,
        level=test.name.level,
        repetition=test.name.repetition,
        run=test.path.name,
        alpha_rad=rig.specimen.alpha0_rad,
        p_rad_s=analysis.theory.p_rad_s,
        r_max=analysis.theory.r_max,
        theta0_rad=analysis.theta0_rad * analysis.side,
        impacts_s=tuple(cycle.start_s - analysis.release_s for cycle in cycles[1:]),
        peaks_rad=tuple(peaks[:last]),
        periods_s=_periods(analysis),
        methods=_methods(analysis),
        good=True,
        trust=analysis.verdict.trust,
        verdict=analysis.verdict,
        families=analysis.families,
        reasons=tuple(dict.fromkeys([*analysis.verdict.reasons, *warnings])),
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
