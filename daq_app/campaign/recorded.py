"""Which tests a folder of runs holds, and what became of each: the reader behind `CampaignStatus.scan`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.campaign.names import TestName
from daq_app.campaign.status import RecordedTest, TestFacts, TestVerdict
from daq_app.campaign.verdicts import OperatorVerdict, read_verdicts
from daq_app.runfile import Event, Run, RunFileError, open_run, read_journal
from daq_app.runfile.folder import RUN_SUFFIX, find_journals, find_runs

_BEFORE_RELEASE: Final = frozenset({"armed", "holding"})
_AFTER_RELEASE: Final = frozenset({"released", "rocking", "at_rest"})
_VERDICTS: Final = {"good": TestVerdict.GOOD, "bad": TestVerdict.BAD, "repeat": TestVerdict.BAD}
"""What a run says of itself: whole and as planned, not to be trusted, or whole but another test."""
_BAD_OUTCOMES: Final = {
    "timeout": "the wall had not come to rest when the recording ended",
    "failed": "the recording failed before the end",
}


@dataclass(frozen=True, slots=True)
class RunAccount:
    """What a run says of its test; with the operator's verdict it makes a `RecordedTest`."""

    run_id: str
    test: str
    """Name of the test, as the recorder gave it; empty where it had none."""
    released: bool
    """Whether the wall was let go."""
    released_ns: int
    """Wall clock of the run."""
    verdict: TestVerdict
    reason: str
    facts: TestFacts


def read_recorded(folder: Path) -> list[RecordedTest]:
    """The releases in a folder and below. Aborted armings are none; runs without a test's name neither.

    Raises `ConfigError` if the operator's verdicts cannot be read, `RunFileError` if there is no folder.
    """
    verdicts = verdicts_of(folder)
    tests = (recorded_test(path, verdicts) for path in find_runs(folder))
    return [*filter(None, tests), *orphans(folder, verdicts)]


def verdicts_of(folder: Path) -> dict[str, OperatorVerdict]:
    """The operator's verdicts on the runs of a folder, by run id. Raises what `read_recorded` raises."""
    if not folder.is_dir():
        raise RunFileError(f"{folder} is no folder", advice="Give the folder that holds the runs.")
    return read_verdicts(folder)


def recorded_test(path: Path, verdicts: Mapping[str, OperatorVerdict]) -> RecordedTest | None:
    """What a run file says of itself and its verdict by run id; a damaged one is a lost test."""
    try:
        with open_run(path) as run:
            return test_of(run, verdicts)
    except RunFileError as error:
        return unreadable(path, error)


def test_of(run: Run, verdicts: Mapping[str, OperatorVerdict]) -> RecordedTest | None:
    """The same of an opened run; None where it is no release of a named test."""
    return test_by(account_of(run), run.path, verdicts)


def account_of(run: Run) -> RunAccount:
    """What an opened run says of its test."""
    header, (verdict, reason) = run.header, _judged(run)
    released = was_released(run.events)
    return RunAccount(
        header.run_id, header.test, released, header.start_utc_ns, verdict, reason, facts_of(run)
    )


def test_by(account: RunAccount, path: Path, verdicts: Mapping[str, OperatorVerdict]) -> RecordedTest | None:
    """The test of a run by its account; None where it is no release of a named test."""
    given = verdicts.get(account.run_id)
    name = _name(given.test if given is not None and given.test else account.test)
    if name is None or not account.released:
        return None
    verdict, reason = account.verdict, account.reason
    if given is not None and given.verdict is not None:
        verdict, reason = TestVerdict(given.verdict), given.reason
    return RecordedTest(name, verdict, account.released_ns, path, reason, account.facts)


def facts_of(run: Run) -> TestFacts:
    """Measured figures, operator and notes of an opened run."""
    plan, analysis = run.header.test_plan, run.results.get("analysis")
    figures = analysis if isinstance(analysis, dict) else {}
    estimates = figures.get("estimates")
    r = {
        name: float(estimate["r"])
        for name, estimate in (estimates if isinstance(estimates, dict) else {}).items()
        if isinstance(estimate, dict) and isinstance(estimate.get("r"), float)
    }
    ratio = figures.get("theta0_over_alpha")
    written = [plan.conditions, plan.notes] if plan is not None else []
    typed = [event.text for event in run.events if event.kind == "note"]
    return TestFacts(
        abs(ratio) if isinstance(ratio, float) else None,
        {label: r[key] for label, key in (("CRT", "crt"), ("EAV", "eav")) if key in r},
        plan.operator if plan is not None else "",
        tuple(dict.fromkeys(text for text in (*written, run.header.notes, *typed) if text.strip())),
    )


def was_released(events: Sequence[Event]) -> bool:
    """Whether the wall was let go in this run. A run without states (an imported one) counts as released."""
    last = next(
        (event.kind for event in reversed(events) if event.kind in _BEFORE_RELEASE | _AFTER_RELEASE), ""
    )
    if last:
        return last in _AFTER_RELEASE
    return _outcome(events) != "aborted"


def _outcome(events: Sequence[Event]) -> str:
    ends = [event for event in events if event.kind == "end"]
    return str(ends[-1].data.get("outcome", "")) if ends else ""


def _judged(run: Run) -> tuple[TestVerdict, str]:
    """What the run says of itself: its quality check if it has one, else how it ended."""
    quality = run.results.get("quality")
    if isinstance(quality, dict) and quality.get("verdict") in _VERDICTS:
        reasons = quality.get("reasons")
        text = "; ".join(map(str, reasons)) if isinstance(reasons, list) else ""
        return _VERDICTS[quality["verdict"]], text
    if run.gaps:
        return TestVerdict.BAD, f"{sum(gap.n_samples for gap in run.gaps)} samples are missing"
    outcome = _outcome(run.events)
    if outcome in _BAD_OUTCOMES:
        return TestVerdict.BAD, _BAD_OUTCOMES[outcome]
    states = {event.kind for event in run.events}
    if states & _AFTER_RELEASE and "at_rest" not in states:
        return TestVerdict.BAD, "the recording ended before the wall came to rest"
    return TestVerdict.UNCHECKED, ""


def orphans(folder: Path, verdicts: Mapping[str, OperatorVerdict]) -> Iterator[RecordedTest]:
    """Journals that no run file was made of yet: their samples are there, so they count as unchecked."""
    for path in find_journals(folder):
        if path.with_suffix(RUN_SUFFIX).exists():
            continue
        try:
            with read_journal(path) as contents:
                header, events = contents.header, tuple(contents.events)
        except RunFileError as error:
            test = unreadable(path, error)
            if test is not None:
                yield test
            continue
        given = verdicts.get(header.run_id)
        name = _name(given.test if given is not None and given.test else header.test)
        if name is None or not was_released(events):
            continue
        verdict, reason = TestVerdict.UNCHECKED, "only a journal so far: `daq-app recover` makes its run file"
        if given is not None and given.verdict is not None:
            verdict, reason = TestVerdict(given.verdict), given.reason
        yield RecordedTest(name, verdict, header.start_utc_ns, path, reason)


def unreadable(path: Path, error: RunFileError) -> RecordedTest | None:
    """A damaged file still burns its number; its name begins with the test's."""
    name = _name(path.stem.split("_")[0])
    if name is None:
        return None
    return RecordedTest(name, TestVerdict.LOST, int(path.stat().st_mtime_ns), path, error.message)


def _name(text: str) -> TestName | None:
    try:
        return TestName.parse(text)
    except ValueError:
        return None
