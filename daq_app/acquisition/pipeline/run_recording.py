"""One run on its way to disk: its journal, what waits for it, and what to do when no disk takes it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.acquisition.messages.items import Arrived, Begin, End, Lost, Noted
from daq_app.acquisition.pipeline.latency import Latency
from daq_app.acquisition.pipeline.refuge import find_refuge, open_journal
from daq_app.acquisition.pipeline.unwritten import Unwritten
from daq_app.runfile import (
    Flusher,
    JournalDeviceError,
    JournalDiskFull,
    JournalSlowDisk,
    JournalWriter,
    RunFileError,
    RunHeader,
    read_journal,
)

_SLOW_FLUSH_S: Final = 0.5
_LOOK_S: Final = 1.0
_END_PATIENCE_S: Final = 60.0
"""How long a run that has ended waits for a disk that takes it."""

Piece = Arrived | Lost | Noted
Say = Callable[[str, str, str], None]
"""Tells (kind, text, severity) to viewers, and to the run as long as it goes on."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A run that is over; its journal waits to become a run file."""

    journal: Path | None
    """None: nothing of the run is left."""
    header: RunHeader
    end: End


@dataclass(slots=True)
class RecorderStatus:
    """What the health message says; written by the recorder, read by anybody."""

    recording: bool = False
    sample: int = 0
    acknowledged_sample: int = 0
    gaps: int = 0
    lost_samples: int = 0
    file_bytes: int = 0
    waiting_bytes: int = 0
    journal: Path | None = None


class RunRecording:
    """Give it the pieces of the run in order with `add`; `write` and `commit` bring them to disk.

    A full disk, a slow one or none at all costs nothing as long as there is memory. `recorded` is set once
    the run is over.
    """

    def __init__(
        self,
        begin: Begin,
        spares: Sequence[Path],
        status: RecorderStatus,
        latency: Latency,
        say: Say,
        make_room: Callable[[], None],
        flusher: Flusher,
    ) -> None:
        """Open the journal. A run that was armed raises `RunFileError` where its own disk does not take it;

        one that is kept takes any place, and waits in memory where there is none.
        """
        self.recorded: Recorded | None = None
        self._begin = begin
        self._begun_s = time.perf_counter()
        """What was read before the order could not be on its disk earlier."""
        self._spares = tuple(spares)
        self._status = status
        self._latency = latency
        self._say = say
        self._make_room = make_room
        self._unwritten = Unwritten()
        self._taken_samples = 0
        self._journal: JournalWriter | None = None
        """None as long as no disk takes a new file."""
        self._stranded = ""
        """What every disk said when none took the run; empty otherwise."""
        self._end_since_s = 0.0
        self._try_again_s = 0.0
        self.last_flush_s = 0.0
        self._last_look_s = 0.0
        self._alarm = ""
        try:
            # A release that nobody armed cannot wait for another disk: any place will do.
            spares = self._spares if begin.kept else ()
            self._journal = open_journal(begin.journal, begin.header, spares, flusher)
        except RunFileError as error:
            if not begin.kept:
                raise
            self._stranded = str(error)

    @property
    def path(self) -> Path:
        """Where the run is being written, or would be."""
        return self._journal.path if self._journal is not None else self._begin.journal

    @property
    def pending(self) -> bool:
        """Whether something is not known to be on disk."""
        return bool(self._unwritten)

    @property
    def whole_on_disk(self) -> bool:
        """Whether everything that came has been handed to a disk."""
        return self._journal is not None and not self._unwritten.waits

    def add(self, piece: Piece | End) -> None:
        """Take in the next piece of the run."""
        if isinstance(piece, End):
            self._end_since_s = time.monotonic()
        elif self._unwritten.end_waits:
            self._unwritten.add(piece)  # behind the end: it belongs to what comes next
            return
        if isinstance(piece, Arrived):
            self._taken_samples += piece.block.n_samples
        self._unwritten.add(piece)
        self._status.waiting_bytes = self._unwritten.waiting_bytes
        if self._unwritten.dropped_samples:
            self.raise_alarm(
                "overflow",
                "Samples are being lost: no disk takes data and the memory is full. Free a disk now",
            )

    def note(self, event: Noted) -> None:
        """Take in an event of our own; what is said after the end is not part of the run."""
        if not self._unwritten.end_waits:
            self._unwritten.add(event)

    @property
    def ended(self) -> bool:
        """Whether the run is over, though no disk has taken its end yet."""
        return self._unwritten.end_waits

    def take_behind_the_end(self) -> list[Piece]:
        """What came after the end of the run, which still waits for a disk."""
        return self._unwritten.take_behind_the_end()

    def forget(self) -> list[Piece]:
        """What came after the end of the run; the rest is on disk, or given up."""
        return self._unwritten.clear()

    # -- to disk ---------------------------------------------------------------------------------

    def write(self) -> None:
        """Hand to the operating system what is waiting, in order, as far as the disk takes it."""
        if self.recorded is not None or (self._stranded and not self._found_refuge()):
            return
        while self._unwritten.waits and self._journal is not None:
            piece = self._unwritten.first
            try:
                if isinstance(piece, End):
                    self._close(piece)
                    return
                self._append(self._journal, piece)
            except JournalDiskFull as error:
                self._make_room()
                self.raise_alarm("full", str(error))
                return
            except JournalDeviceError as error:
                self._move(str(error))
                return
            self._unwritten.written(self._journal.frames)
        self._status.waiting_bytes = self._unwritten.waiting_bytes
        if self._journal is not None:
            self._status.file_bytes = self._journal.size_bytes

    def _append(self, journal: JournalWriter, piece: Arrived | Lost | Noted) -> None:
        match piece:
            case Arrived(block=block):
                journal.append_block(block.first_sample, block.readings)
            case Lost():
                # Lost before the run's first sample is no gap of this run.
                if journal.next_sample is not None:
                    journal.append_gap(piece.first_sample, piece.n_samples, piece.reason)
                    self._status.gaps += 1
                    self._status.lost_samples += piece.n_samples
            case Noted(event=event):
                data = {"severity": event.severity, **event.data}
                journal.append_event(event.kind, event.sample, event.text, data)

    def commit(self) -> None:
        """Write, flush, and count what is safe now."""
        self.write()
        journal = self._journal
        if journal is None or self._stranded or self.recorded is not None:
            return
        try:
            acknowledged = journal.sync(_SLOW_FLUSH_S)
        except JournalSlowDisk as error:
            self.raise_alarm("slow", str(error))
            return
        except JournalDeviceError as error:
            self._move(str(error))
            return
        self.last_flush_s = time.monotonic()
        if not self._still_there(journal):
            return
        self._status.acknowledged_sample = acknowledged
        now = time.perf_counter()
        for piece in self._unwritten.acknowledged(journal.acknowledged_frames):
            if isinstance(piece, Arrived):
                self._latency.add(now - max(piece.arrived_s, self._begun_s))
        if self._alarm and not self._unwritten.waits:
            kind, self._alarm = _kind_of(self._alarm), ""
            again = "The disk takes data again" if kind == "disk" else "Samples are written again"
            dropped = self._unwritten.dropped_samples
            lost = f"{dropped} samples were lost meanwhile" if dropped else "nothing was lost"
            self._say(kind, f"{again}; {lost}", "info")

    def _still_there(self, journal: JournalWriter) -> bool:
        """Whether the journal still has its name; looked at once a second. If not, its content is rescued."""
        now = time.monotonic()
        if now - self._last_look_s < _LOOK_S:
            return True
        self._last_look_s = now
        if journal.is_in_place():
            return True
        self._move(f"{journal.path} was deleted or moved while it was recorded.")
        return False

    def _close(self, end: End) -> None:
        journal = self._journal
        assert journal is not None
        journal.append_event("end", end.sample, end.text, {"outcome": end.outcome})
        journal.close()
        self._status.acknowledged_sample = journal.acknowledged_sample
        self.recorded = Recorded(journal.path, journal.header, end)

    # -- trouble with disks ----------------------------------------------------------------------

    def _move(self, why: str) -> None:
        """Go on in another place; where none takes the run, it waits in memory with its file held open."""
        journal = self._journal
        assert journal is not None
        old, safe_frames = journal.path, journal.acknowledged_frames
        moved = find_refuge(journal, self._spares, why)
        if isinstance(moved, str):
            self._stranded = why
            self._try_again_s = time.monotonic() + _LOOK_S
            self.raise_alarm(
                "stranded",
                f"{why} No other place takes the run ({moved}). It waits in memory and is tried again every "
                "second: free a disk now",
            )
            return
        self._stranded = ""
        if moved.whole and old != moved.journal.path:
            # All of it is in the new file; under its old name it would be taken for a run that was cut off.
            with contextlib.suppress(OSError):
                old.replace(old.with_suffix(".journal-moved"))
        if not moved.whole:
            journal.abandon()
        self._journal = moved.journal
        # What has been acknowledged meanwhile is in the copy, or safe in the old file.
        for piece in self._unwritten.write_again(safe_frames):
            if isinstance(piece, Lost):  # written once more, and counted then
                self._status.gaps -= 1
                self._status.lost_samples -= piece.n_samples
        self._status.journal = moved.journal.path
        self.raise_alarm("moved", f"{why} Recording goes on in {moved.journal.path}")
        self.write()

    def _found_refuge(self) -> bool:
        """Try every place again, once a second; a run that is over and finds none is given up."""
        now = time.monotonic()
        if now < self._try_again_s:
            return False
        self._try_again_s = now + _LOOK_S
        begin = self._begin
        if self._journal is not None:
            self._move(self._stranded)
        else:
            try:
                self._journal = open_journal(begin.journal, begin.header, self._spares)
                self._stranded = ""
                self._status.journal = self._journal.path
            except RunFileError as error:
                self._stranded = str(error)
                self.raise_alarm(
                    "stranded", f"{error} The run waits in memory and is tried again: free a disk now"
                )
        if self._stranded and self._unwritten.end_waits and now - self._end_since_s > _END_PATIENCE_S:
            self.give_up(self._stranded)
        return self.recorded is None and not self._stranded

    def give_up(self, why: str) -> None:
        """No disk takes the data: say so, and count what is really there."""
        begin, journal = self._begin, self._journal
        path = None
        if journal is not None:
            path = journal.path if journal.is_in_place() else None
            journal.abandon()
        kept = _samples_in(path) if path is not None else 0
        lost = max(0, self._taken_samples - kept)
        self._status.lost_samples += lost
        place = f"The first {kept} are in {path}" if kept else "No file of it is left"
        text = f"Recording failed: {why}. {lost} of {self._taken_samples} samples could not be kept. {place}"
        header = journal.header if journal is not None else begin.header
        self.recorded = Recorded(path if kept else None, header, End("failed", self._status.sample, text))

    def raise_alarm(self, trouble: str, text: str) -> None:
        """Once per trouble, not at each try."""
        if self._alarm == trouble:
            return
        self._alarm = trouble
        self._say(_kind_of(trouble), text, "error")


def _samples_in(journal: Path) -> int:
    """Samples per channel that can be read from a journal."""
    try:
        with read_journal(journal) as contents:
            return contents.n_samples - contents.lost_samples
    except RunFileError:
        return 0


def _kind_of(trouble: str) -> str:
    """The kind of event that tells of a trouble."""
    return trouble if trouble in ("memory", "recorder") else "disk"
