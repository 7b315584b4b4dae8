"""``python -m daq_app.acquisition.closing.finalise_worker``: makes run files, one JSON line a job.

Jobs: ``{"job": "finalise", "journal": PATH, "out": PATH}``, ``{"job": "recover", "journal": PATH}`` and
``{"job": "ring", "journal": FOLDER OF A RING'S SESSION, "out": FOLDER OF THE RUNS}``. The
process ends at once when its standard input closes, that is, when its parent dies: a half-made run
file is a ``.tmp`` beside an untouched journal, and the next start makes it again.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import TextIO

import psutil

from daq_app.acquisition.closing.finaliser import Finished
from daq_app.acquisition.closing.freed_memory import give_back, share_one_heap
from daq_app.guarded import keep_input


def finalise_job(journal: Path, out: Path) -> Finished:
    """Verify the journal, derive, write, prove; the journal goes once its run is proven."""
    from daq_app.acquisition.closing.derive import derive
    from daq_app.runfile import RunFileError, finalise, read_journal

    try:
        with read_journal(journal) as contents:
            empty = contents.n_samples == 0
            derived, trouble = derive(contents)
            damaged = bool(contents.damage)
        if empty:
            _put_away(journal)
            return Finished(True, "It ended before its first sample, so there is no run")
        finalise(journal, out, derived, keep_journal=damaged)
    except RunFileError as error:
        return Finished(False, f"The run file could not be made: {error} The journal is kept: {journal}")
    except Exception as error:
        return Finished(
            False,
            f"Making the run file failed ({type(error).__name__}: {error}). The journal is kept: {journal}",
        )
    return Finished(True, f"Saved as {out.name}{trouble and f'. {trouble}'}", str(out))


def _put_away(journal: Path) -> None:
    """Its run is proven, or it is empty; under its own name it would be read again at every start."""
    journal.replace(journal.with_suffix(".journal-recovered"))


def recover_job(journal: Path) -> Finished:
    """Make the run of an orphan journal. No text where there was nothing to do."""
    from daq_app.acquisition.closing.derive import derive
    from daq_app.runfile import recover

    (recovery,) = recover(journal, derive=lambda contents: derive(contents)[0])
    if recovery.outcome == "in use":
        return Finished(True, "")
    if recovery.outcome in ("recovered", "saved already", "empty"):
        _put_away(journal)
    text = "" if recovery.outcome == "saved already" else recovery.text
    return Finished(recovery.outcome != "failed", text, str(recovery.run or ""))


def ring_job(place: Path, out: Path) -> Finished:
    """Look at a ring that was left behind; a release in it becomes a run."""
    from daq_app.acquisition.closing.ring_recovery import recover_ring

    kept = recover_ring(place, out)
    if not kept.path:
        return kept
    made = recover_job(Path(kept.path))
    return Finished(made.ok, f"{kept.text}. {made.text}", made.path)


def _do(job: dict[str, str]) -> Finished:
    match job:
        case {"job": "finalise", "journal": journal, "out": out}:
            return finalise_job(Path(journal), Path(out))
        case {"job": "ring", "journal": place, "out": out}:
            try:
                return ring_job(Path(place), Path(out))
            except Exception as error:
                return Finished(
                    False, f"Looking at the ring {place} failed ({type(error).__name__}: {error})"
                )
        case {"job": "recover", "journal": journal}:
            try:
                return recover_job(Path(journal))
            except Exception as error:
                return Finished(False, f"Recovery of {journal} failed ({type(error).__name__}: {error})")
    return Finished(False, f"There is no job like {job}")


def _listen(pipe: TextIO, jobs: queue.SimpleQueue[str]) -> None:
    for line in pipe:
        jobs.put(line)
    os._exit(0)


def main() -> None:
    """Serve until the parent goes."""
    # Reading and drawing come first; a run file may take a second longer.
    with contextlib.suppress(psutil.Error, OSError, AttributeError):
        psutil.Process().nice(psutil.BELOW_NORMAL_PRIORITY_CLASS if sys.platform == "win32" else 5)
    share_one_heap()
    answers = sys.stdout
    sys.stdout = sys.stderr  # whatever a library prints must not be taken for an answer
    jobs: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(keep_input(), jobs), daemon=True).start()
    import daq_app.acquisition.closing.derive  # noqa: F401  # loaded now, so that the first run need not wait

    while True:
        answer = _do(json.loads(jobs.get()))
        answers.write(json.dumps(asdict(answer)) + "\n")
        answers.flush()
        give_back()


if __name__ == "__main__":
    main()
