"""The verdict of a run: whether it is a whole record, and whether it is the test that was planned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from daq_app.config.wording import true_minus
from daq_app.rocking.analysis.results import TestAnalysis
from daq_app.runfile import JournalContents, TestPlan
from daq_app.runfile.source import RunSource

_SPOILS_TIME: Final = ("stood_still", "rate")
"""News of the sample clock after which times within the run are wrong."""

_UNFINISHED: Final = {
    "timeout": "the wall did not come to rest in time",
    "stopped": "it was stopped before the wall had come to rest",
    "failed": "the acquisition failed before the wall had come to rest",
    "cut off": "it was cut off: the recorder did not end it",
}
"""Why a run with that outcome is no whole test."""


def judge_run(contents: JournalContents, analysis: TestAnalysis) -> dict[str, Any] | None:
    """``{"verdict", "reasons", "doubtful_channels"}``; None for an aborted arming.

    ``bad``: the record itself cannot be trusted. ``repeat``: the record is whole, but it is not the test
    that was planned. ``good``: neither; its reasons are what a reader should note.
    """
    ends = [event for event in contents.events if event.kind == "end"]
    outcome = str(ends[-1].data.get("outcome", "")) if ends else "cut off"
    if outcome == "aborted":
        return None
    hard = _spoilt(contents, analysis, outcome)
    plan = contents.header.test_plan
    missed = _missed(plan, analysis) if plan is not None and analysis.found else []
    notes = [
        *_prepared(contents),
        *_told(contents, "clock", lambda data: data.get("clock") not in _SPOILS_TIME),
        *_told(contents, "channel"),
        *_told(contents, "travel"),
        *_told(contents, "overload"),
        *_told(contents, "alarm", lambda data: data.get("alarm") == "wall_clock"),
        *(note.text for note in analysis.notes if note.severity == "warning"),
    ]
    channels = sorted({str(e.data["channel"]) for e in contents.events if e.kind == "channel"})
    verdict = "bad" if hard else "repeat" if missed else "good"
    return {
        "verdict": verdict,
        "reasons": [true_minus(reason) for reason in hard + missed + notes],
        "doubtful_channels": channels,
    }


def judge_imported(run: RunSource, analysis: TestAnalysis) -> dict[str, Any]:
    """The same of a recording of another program: it has neither states nor a plan that it could miss."""
    hard = []
    if run.gaps:
        missing = sum(gap.n_samples for gap in run.gaps)
        hard.append(f"{missing} samples are missing in {len(run.gaps)} gap(s)")
    if not analysis.found:
        hard.append("no release and impact were found")
    notes = [note.text for note in analysis.notes if note.severity == "warning"]
    channels = sorted({name for finding in analysis.findings for name in finding.channels})
    return {
        "verdict": "bad" if hard else "good",
        "reasons": [true_minus(reason) for reason in hard + notes],
        "doubtful_channels": channels,
    }


def _spoilt(contents: JournalContents, analysis: TestAnalysis, outcome: str) -> list[str]:
    """Why the record cannot be trusted."""
    hard = []
    if contents.gaps:
        hard.append(f"{contents.lost_samples} samples are missing in {len(contents.gaps)} gap(s)")
    if outcome != "complete":
        hard.append(_UNFINISHED.get(outcome, f"it was {outcome}"))
    if contents.damage:
        hard.append(f"the journal is damaged: {contents.damage[0]}")
    hard += _told(contents, "clock", lambda data: data.get("clock") in _SPOILS_TIME)
    if not analysis.found:
        hard.append("no release and impact were found")
    return hard


def _missed(plan: TestPlan, analysis: TestAnalysis) -> list[str]:
    """In what the test is another one than was planned."""
    missed = []
    if plan.band is not None and plan.theta0_over_alpha is not None:
        low, high = plan.band
        if not low <= analysis.theta0_over_alpha <= high:
            planned = f"planned {plan.theta0_over_alpha:.3f} within {100 * plan.tolerance:.0f} %"
            missed.append(
                f"released from θ0/α = {analysis.theta0_over_alpha:.3f}, {planned} ({low:.3f} to {high:.3f})"
            )
    if not plan.side_of(analysis.theta0_rad):
        side = "+x" if analysis.theta0_rad >= 0 else "-x"
        missed.append(f"released towards {side}, planned towards {plan.side}")
    return missed


def _prepared(contents: JournalContents) -> list[str]:
    """What was left out before the test."""
    notes = []
    plan = contents.header.test_plan
    if plan is not None and plan.check is None:
        notes.append("the sensors were not checked before the test")
    if plan is not None and plan.check is not None and plan.check.verdict == "no-go":
        notes.append(f"armed in spite of a sensor check that said no-go: {plan.check.summary}")
    if plan is not None and not plan.zero_utc:
        notes.append("no zero was taken before the test: it is that of the wall at rest after it")
    if contents.header.kept is not None:
        notes.append("nobody had armed: kept from the ring")
    return notes


def _told(
    contents: JournalContents, kind: str, which: Callable[[dict[str, Any]], bool] = lambda data: True
) -> list[str]:
    """What was warned of in that kind while the run was recorded, each sentence once."""
    told = (event for event in contents.events if event.kind == kind)
    return sorted(
        {event.text for event in told if which(event.data) and event.data.get("severity") != "info"}
    )
