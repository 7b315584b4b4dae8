"""Makes runs of journals that a dead recorder left behind. Safe to repeat, to interrupt, to run twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from daq_app.runfile.errors import BusyError, RunFileError
from daq_app.runfile.folder import RUN_SUFFIX, find_journals, find_runs
from daq_app.runfile.hdf5.read import open_run
from daq_app.runfile.integrity.saving import finalise_contents, is_run_of
from daq_app.runfile.integrity.verification import verify_run
from daq_app.runfile.journal.locks import journal_locked
from daq_app.runfile.journal.read import JournalContents, read_journal
from daq_app.runfile.model import DerivedData

Outcome = Literal["recovered", "saved already", "in use", "empty", "failed", "left alone"]


@dataclass(frozen=True, slots=True)
class Recovery:
    """What became of one journal, or of a bad run file without one. Neither is ever changed."""

    journal: Path
    outcome: Outcome
    text: str
    """One plain sentence."""
    run: Path | None = None
    n_samples: int = 0
    lost_samples: int = 0


Derive = Callable[[JournalContents], DerivedData | None]
"""What is computed from the samples of a run when it is made; must not raise."""


def recover(
    path: Path | str, *, thorough: bool = False, derive: Derive | None = None
) -> tuple[Recovery, ...]:
    """Make a run of one journal, or of every journal in a folder and below that has none yet.

    A run that is there already is recognised by its header; with `thorough` every sample of it is
    checked too (a second per minute of recording).  A journal being recorded is left alone.  A run
    file that is there but damaged is set aside under another name, never deleted.  With `derive` the
    run gets its derived signals and its verdict, as one that was closed in good order.  Raises
    `RunFileError` only if `path` does not exist; everything else is told per journal.
    """
    path = Path(path)
    if path.is_dir():
        journals = find_journals(path)
        made = tuple(_recover_one(journal, thorough, derive) for journal in journals)
        return made + _bad_runs(path, {journal.with_suffix(RUN_SUFFIX) for journal in journals})
    if not path.exists():
        raise RunFileError(f"{path} does not exist", advice="Give a journal or the folder of the runs.")
    return (_recover_one(path, thorough, derive),)


def _bad_runs(folder: Path, with_journal: set[Path]) -> tuple[Recovery, ...]:
    """Run files that cannot be opened and that no journal is there for: they are left alone, and told."""
    damaged = []
    for path in find_runs(folder):
        if path in with_journal:
            continue
        try:
            open_run(path).close()
        except (RunFileError, OSError) as error:
            damaged.append(Recovery(path, "left alone", str(error)))
    return tuple(damaged)


def _recover_one(journal: Path, thorough: bool, derive: Derive | None) -> Recovery:
    try:
        with journal_locked(journal), read_journal(journal) as contents:
            return _make_run(journal, contents, thorough, derive)
    except BusyError:
        return Recovery(
            journal, "in use", f"{journal.name} is being recorded or recovered by another process"
        )
    except Exception as error:
        # Whatever is wrong with this journal, the others must still be recovered.
        return Recovery(journal, "failed", str(error) or type(error).__name__)


def _make_run(journal: Path, contents: JournalContents, thorough: bool, derive: Derive | None) -> Recovery:
    if contents.n_samples == 0:
        return Recovery(journal, "empty", f"{journal.name} holds no samples: the recording ended before any")
    out = journal.with_suffix(RUN_SUFFIX)
    aside = None
    if out.exists():
        if _is_good_run(out, contents, thorough):
            return _told(journal, contents, "saved already", out, f"{out.name} is its run")
        if _is_other_run(out, contents):
            out = journal.with_name(f"{journal.stem}-{_safe(contents.header.run_id)}{RUN_SUFFIX}")
            if out.exists() and _is_good_run(out, contents, thorough):
                return _told(journal, contents, "saved already", out, f"{out.name} is its run")
        if out.exists():
            aside = _set_aside(out)
    finalise_contents(contents, out, derive(contents) if derive is not None else None)
    text = f"{out.name} was made, {contents.n_samples} samples per channel"
    if contents.lost_samples:
        text += f", {contents.lost_samples} of them missing and listed as gaps"
    if not contents.closed:
        text += "; the recorder had been cut off"
    if aside is not None:
        text += f"; the damaged file was set aside as {aside.name}"
    return _told(journal, contents, "recovered", out, text)


def _told(journal: Path, contents: JournalContents, outcome: Outcome, run: Path, text: str) -> Recovery:
    return Recovery(journal, outcome, text, run, contents.n_samples, contents.lost_samples)


def _is_good_run(path: Path, contents: JournalContents, thorough: bool) -> bool:
    return is_run_of(path, contents) and (not thorough or verify_run(path).ok)


def _is_other_run(path: Path, contents: JournalContents) -> bool:
    """Whether `path` is a run in good order, of another journal."""
    try:
        with open_run(path) as run:
            return run.header.run_id != contents.header.run_id
    except RunFileError:
        return False


def _set_aside(path: Path) -> Path:
    number = 1
    while True:
        aside = path.with_name(f"{path.name}.damaged-{number}")
        if not aside.exists():
            path.rename(aside)
            return aside
        number += 1


def _safe(run_id: str) -> str:
    """A run's id as part of a file name: nothing in it can lead out of the folder."""
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in run_id)[:80]
