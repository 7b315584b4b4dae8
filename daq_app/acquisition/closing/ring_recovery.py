"""What a dead recorder left in its ring: a release that nobody armed becomes a run, the rest goes.

A ring of a wall that stood still is no test, so nothing is made of it. A release in it is one: its recorder
died before it had begun a run of it, or while it did.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import math
import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.acquisition.closing.finaliser import Finished
from daq_app.acquisition.course.sequence import Change, Sequence
from daq_app.acquisition.course.unarmed import KEPT_BEFORE_S
from daq_app.acquisition.course.unheld_release import UnheldReleaseWatch
from daq_app.acquisition.messages.items import End
from daq_app.acquisition.messages.published import UNARMED
from daq_app.acquisition.pipeline.ring import ring_sessions
from daq_app.config import Rig
from daq_app.rocking import LiveAnalyser
from daq_app.rocking.motion.phases import Phase, PhaseEvent
from daq_app.runfile import (
    JOURNAL_SUFFIX,
    BusyError,
    JournalContents,
    JournalWriter,
    RunFileError,
    RunHeader,
    open_run,
    read_journal,
    rig_of,
)
from daq_app.runfile.durable import replace_durably
from daq_app.runfile.folder import find_journals, find_runs
from daq_app.runfile.journal.locks import journal_locked

_BLOCK: Final = 400


def recover_rings(folder: Path) -> list[Finished]:
    """Look at every ring left in a folder of runs; one answer for each that had something to tell."""
    told = [recover_ring(place, folder) for place in ring_sessions(folder)]
    return [finished for finished in told if finished.text]


def recover_ring(place: Path, out: Path) -> Finished:
    """Make a journal in `out` of a release in the ring of one session, then remove the ring.

    The journal becomes a run as any other that was cut off. No text where there was nothing to keep. A ring
    that is being written, or that cannot be read, is left alone.
    """
    try:
        with ExitStack() as stack:
            segments = _open_segments(place, stack)
            journal = _keep_release(segments, place.name, out) if segments else None
    except BusyError:
        return Finished(True, "")
    except (OSError, RunFileError, ValueError) as error:
        return Finished(False, f"The ring {place} cannot be read ({error}); it is left as it is")
    shutil.rmtree(place, ignore_errors=True)
    with contextlib.suppress(OSError):
        place.parent.rmdir()
    if journal is None:
        return Finished(True, "")
    text = (
        f"The wall was released while nobody had armed, and the recorder was cut off: kept as {journal.stem}"
    )
    return Finished(True, text, str(journal))


def _open_segments(place: Path, stack: ExitStack) -> list[JournalContents]:
    """Readable segments in order of their samples. Raises `BusyError` if one is being written."""
    segments = []
    for path in sorted(place.glob(f"*{JOURNAL_SUFFIX}")):
        stack.enter_context(journal_locked(path))
        with contextlib.suppress(RunFileError):
            segments.append(stack.enter_context(read_journal(path)))
    return [segment for segment in segments if segment.n_samples]


def _keep_release(segments: list[JournalContents], session: str, out: Path) -> Path | None:
    header = segments[-1].header
    rig = rig_of(header)
    if rig is None or rig.channel_ids != header.channel_ids or _is_kept(session, out):
        return None
    watch = _Watch(rig, header)
    release = None
    for first, block in _blocks(segments):
        moving = [event for event in watch.process(first, block) if event.kind in ("release", "impact")]
        if moving:
            release = round(moving[0].sample)
            break
    if release is None:
        return None
    start = release - round(KEPT_BEFORE_S * header.rate_hz)
    begin = next(s for s in segments if s.first_sample + s.n_samples > start)
    first = max(start, begin.first_sample)
    since_s = (first - begin.first_sample) / header.rate_hz
    started_ns = begin.header.start_utc_ns + round(1e9 * since_s)
    stamp = dt.datetime.fromtimestamp(started_ns / 1e9, dt.UTC)
    run_id = f"{UNARMED}_{stamp:%Y%m%dT%H%M%S}-{stamp.microsecond // 1000:03d}Z"
    kept = {"ring": session, "release_sample": release}
    whole = header.model_copy(
        update={
            "run_id": run_id,
            "start_utc_ns": started_ns,
            "kept": kept,
            "notes": "Not armed: kept from the ring that a recorder left behind.",
        }
    )
    part, path = out / f".{run_id}.part", out / f"{run_id}{JOURNAL_SUFFIX}"
    part.unlink(missing_ok=True)
    with JournalWriter(part, whole) as writer:
        _write_run(rig, whole, segments, first, writer)
    replace_durably(part, path)
    return path


def _write_run(
    rig: Rig, header: RunHeader, segments: list[JournalContents], start: int, writer: JournalWriter
) -> None:
    """Samples from `start` on with the events of their course; left open where the recorder died."""
    watch = _Watch(rig, header)
    course = Sequence(rig.acquisition, header.rate_hz, start, math.inf, armed=False)
    for first, block in _blocks(segments):
        if first + block.shape[1] <= start:
            continue
        writer.append_block(first, block)
        events = watch.process(first, block)
        for event in events:
            if event.kind == "impact":
                writer.append_event("impact", round(event.sample), event.text, {"sample": event.sample})
        for change in course.advance(events, first + block.shape[1]):
            if isinstance(change, End):
                writer.append_event("end", change.sample, change.text, {"outcome": change.outcome})
                return
            if isinstance(change, Change) and course.release_sample is not None:
                writer.append_event(change.state.value, change.sample, change.text, {"severity": "info"})


def _blocks(segments: list[JournalContents]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Good samples of all segments in order; what is missing is left out."""
    for segment in segments:
        for first, window in segment.windows(_BLOCK):
            good = np.isfinite(window).all(axis=0)
            if good.all():
                yield first, window


class _Watch:
    """The analysis that the recorder does while it samples."""

    def __init__(self, rig: Rig, header: RunHeader) -> None:
        self._analyser = LiveAnalyser(rig, header.rate_hz, header.tare)
        self._unheld = UnheldReleaseWatch(rig, header.rate_hz)

    def process(self, first: int, block: NDArray[np.float64]) -> tuple[PhaseEvent, ...]:
        result = self._analyser.process(first, block)
        if result.phase is not Phase.WAITING:
            self._unheld.reset()
            return result.events
        unheld = self._unheld.process(result.first_sample, result.rotation_rad, result.velocity_rad_s)
        return result.events + unheld


def _is_kept(session: str, out: Path) -> bool:
    """Whether the recorder had begun a run of this ring's release before it died."""
    for path in find_journals(out):
        if path.name.startswith(UNARMED):
            with contextlib.suppress(RunFileError), read_journal(path) as contents:
                if (contents.header.kept or {}).get("ring") == session:
                    return True
    for path in find_runs(out):
        if path.name.startswith(UNARMED):
            with contextlib.suppress(RunFileError), open_run(path) as run:
                if (run.header.kept or {}).get("ring") == session:
                    return True
    return False
