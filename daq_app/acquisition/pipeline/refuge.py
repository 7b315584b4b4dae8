"""Where a run goes on when its disk fails: every place that is left, tried in turn."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from daq_app.runfile import Flusher, JournalError, JournalWriter, RunFileError, RunHeader


@dataclass(frozen=True, slots=True)
class Moved:
    """The journal that goes on, and whether it begins with all that was safe in the old one."""

    journal: JournalWriter
    whole: bool


def find_refuge(journal: JournalWriter, spares: Sequence[Path], why: str) -> Moved | str:
    """Move `journal` to another place, with its acknowledged content where the old file can still be read.

    The open file is read, so a file that was deleted under the recorder is still whole. Its own folder
    comes last: a disk that failed for a moment takes a new file again. Where the content cannot be read, a
    run of its own begins. Answers with what every place said if none takes it; `journal` is as it was then.
    """
    home = journal.path.parent
    places = [place for place in spares if place != home] + [home]
    refusals = []
    for place in places:
        target = _free_name(place, journal.path)
        try:
            place.mkdir(parents=True, exist_ok=True)
            journal.move_to(target)
            return Moved(journal, whole=True)
        except (OSError, RunFileError) as error:
            refusals.append(f"{place}: {_words(error)}")
    header = _continued(journal.header, why)
    for place in places:
        target = _free_name(place, journal.path.with_stem(header.run_id))
        try:
            return Moved(open_journal(target, header, ()), whole=False)
        except RunFileError:
            continue
    return "; ".join(refusals)


def open_journal(
    path: Path, header: RunHeader, spares: Sequence[Path], flusher: Flusher | None = None
) -> JournalWriter:
    """A new journal at `path`, or in the first other place that takes it. Raises what its own place said."""
    first: RunFileError | None = None
    for place in [path.parent, *spares]:
        target = path if place == path.parent else _free_name(place, path)
        try:
            if spares:
                place.mkdir(parents=True, exist_ok=True)
            return JournalWriter(target, header, flusher)
        except OSError as error:
            first = first or RunFileError(f"{place}: {_words(error)}")
        except JournalError as error:
            first = first or error
            with contextlib.suppress(OSError):
                target.unlink(missing_ok=True)
        except RunFileError as error:
            first = first or error
    assert first is not None
    raise first


def _free_name(place: Path, path: Path) -> Path:
    number, candidate = 2, place / path.name
    while candidate.exists():
        candidate = place / f"{path.stem}-{number}{path.suffix}"
        number += 1
    return candidate


def _continued(old: RunHeader, why: str) -> RunHeader:
    return old.model_copy(
        update={
            "run_id": f"{old.run_id}-continued",
            "notes": f"{old.notes}\nContinues run {old.run_id} after: {why}",
            "start_utc_ns": time.time_ns(),
        }
    )


def _words(error: OSError | RunFileError) -> str:
    return error.message if isinstance(error, RunFileError) else str(error.strerror or error)
