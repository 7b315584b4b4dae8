"""Everything that a test record is made from, read once."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq_app.campaign.recorded import verdicts_of
from daq_app.campaign.result.result import NoResult, load_result, make_result
from daq_app.campaign.summaries.summary import TestSummary
from daq_app.campaign.verdicts import OperatorVerdict
from daq_app.config import Rig
from daq_app.runfile import Event, Gap, RunHeader, open_run, verify
from daq_app.runfile.digest import file_sha256
from daq_app.runfile.hdf5.read import RunAttributes
from daq_app.runfile.integrity.verification import VerifyReport
from daq_app.runfile.seal.format import Seal


@dataclass(frozen=True, slots=True)
class RecordSource:
    """One run with what is known about it."""

    path: Path
    header: RunHeader
    attributes: RunAttributes
    rig: Rig | None
    events: tuple[Event, ...]
    gaps: tuple[Gap, ...]
    results: dict[str, Any]
    """As kept in the run: analysis, online figures, quality."""
    seal: Seal | None
    report: VerifyReport
    file_sha256: str
    given: OperatorVerdict | None
    """What the operator decided afterwards."""
    test: TestSummary | None
    no_result: str
    """Why there is no result; empty where there is one."""
    made_utc: dt.datetime

    @property
    def name(self) -> str:
        """The test that the run counts as; its run id where it has no name."""
        given = self.given.test if self.given is not None else ""
        return given or self.header.test or self.header.run_id

    @property
    def start_utc(self) -> dt.datetime:
        """Wall clock at the first sample."""
        whole, rest_ns = divmod(self.header.start_utc_ns, 10**9)
        start = dt.datetime.fromtimestamp(whole, dt.UTC)
        return start + dt.timedelta(microseconds=rest_ns // 1000)

    def seconds(self, sample: int | float) -> float:
        """Time of an absolute sample since the first of the run."""
        return float(sample - self.attributes.first_sample) / self.header.rate_hz

    def event(self, *kinds: str) -> Event | None:
        """The first event of one of these kinds."""
        return next((event for event in self.events if event.kind in kinds), None)


def read_source(path: Path) -> RecordSource:
    """Read, verify and, if it has no result yet, analyse a run. Raises `RunFileError`, `ConfigError`."""
    with open_run(path) as run:
        header, attributes, rig = run.header, run.attributes, run.rig
        events, gaps, results, seal = run.events, run.gaps, run.results, run.seal
    test, no_result = _result(path)
    return RecordSource(
        path=path,
        header=header,
        attributes=attributes,
        rig=rig,
        events=events,
        gaps=gaps,
        results=results,
        seal=seal,
        report=verify(path),
        file_sha256=file_sha256(path),
        given=verdicts_of(path.parent).get(header.run_id),
        test=test,
        no_result=no_result,
        made_utc=dt.datetime.now(dt.UTC),
    )


def _result(path: Path) -> tuple[TestSummary | None, str]:
    try:
        result = load_result(path) or make_result(path)
    except NoResult as error:
        return None, str(error)
    return result.test, ""
