"""Verdicts that the operator gave on runs, kept beside them: a run file is never changed afterwards."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from daq_app.config import ConfigError, Problem
from daq_app.runfile.durable import write_whole

FILE_NAME: Final = "verdicts.json"


class OperatorVerdict(BaseModel):
    """What somebody decided about one run."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    verdict: Literal["good", "bad", "lost"] | None = None
    """None: the run's own verdict holds."""
    reason: str = ""
    given_utc: dt.datetime
    test: str = ""
    """Place in the campaign that a release was given afterwards, because nobody had armed it for one."""


class _Ledger(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = 1
    runs: dict[str, OperatorVerdict]
    """Run id → verdict."""


def read_verdicts(folder: Path) -> dict[str, OperatorVerdict]:
    """Verdicts of a folder of runs by run id; empty if none was given.

    Raises `ConfigError` where the file cannot be understood: a rejected test must not count as good
    because a file is damaged.
    """
    path = folder / FILE_NAME
    try:
        return dict(_Ledger.model_validate_json(path.read_bytes()).runs)
    except FileNotFoundError:
        return {}
    except (OSError, ValidationError) as error:
        first = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
        right = "Restore it from a backup, or move it away and give the verdicts again"
        raise ConfigError(
            [Problem(str(path), "the file", f"the verdicts cannot be read ({first})", right)]
        ) from None


def give_verdict(
    folder: Path, run_id: str, verdict: Literal["good", "bad", "lost"], reason: str = ""
) -> None:
    """Record a verdict on a run, durably; a later one replaces it. Raises `ConfigError`, `OSError`."""
    before = read_verdicts(folder).get(run_id)
    test = before.test if before is not None else ""
    now = dt.datetime.now(dt.UTC)
    _write(folder, run_id, OperatorVerdict(verdict=verdict, reason=reason, given_utc=now, test=test))


def give_place(folder: Path, run_id: str, test: str) -> None:
    """Give a release that nobody had armed the name of a test. Raises `ConfigError`, `OSError`."""
    before = read_verdicts(folder).get(run_id)
    verdict, reason = (before.verdict, before.reason) if before is not None else (None, "")
    now = dt.datetime.now(dt.UTC)
    _write(folder, run_id, OperatorVerdict(verdict=verdict, reason=reason, given_utc=now, test=test))


def _write(folder: Path, run_id: str, given: OperatorVerdict) -> None:
    runs = read_verdicts(folder)
    runs[run_id] = given
    path = folder / FILE_NAME
    write_whole(path, _Ledger(runs=runs).model_dump_json(indent=1))
