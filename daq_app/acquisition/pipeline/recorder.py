"""The recorder thread: everything goes to disk here first, then to analysis and viewers.

One flush covers all blocks that are waiting, so a slow disk means larger groups, not a growing queue.
A full disk or a slow one costs no sample: blocks wait in memory until the disk takes them.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from daq_app.acquisition.messages.items import Arrived, Begin, End, Item, Lost, Noted, RequestRefused
from daq_app.acquisition.messages.published import EventMessage
from daq_app.acquisition.pipeline.latency import Latency
from daq_app.runfile import (
    JournalDeviceError,
    JournalDiskFull,
    JournalSlowDisk,
    JournalWriter,
    RunFileError,
    RunHeader,
)

_GROUP_S: Final = 0.05
"""Longest wait of a written block for its flush while more blocks keep coming."""
_SLOW_FLUSH_S: Final = 0.5
_RETRY_S: Final = 0.2
_MOST_FAULTS: Final = 50
"""Failures in a row, of no kind that a disk has, after which a journal is closed."""
_LOOK_S: Final = 1.0
_MEMORY_LIMIT_BYTES: Final = 512 * 2**20
"""Blocks held in memory while the disk takes none: six minutes of 41 channels at 4000 Hz."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """A run whose journal is closed and waits to become a run file."""

    journal: Path
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


class Recorder(threading.Thread):
    """Takes items from `inbox`; hands each on with `forward` once it has been written."""

    def __init__(
        self,
        forward: Callable[[Item], None],
        announce: Callable[[EventMessage], None],
        hand_over: Callable[[Recorded], None],
        spare_folder: Path | None = None,
    ) -> None:
        super().__init__(name="recorder", daemon=True)
        self.inbox: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self.status = RecorderStatus()
        self.latency = Latency()
        self._forward = forward
        self._announce = announce
        self._hand_over = hand_over
        self._spare_folder = spare_folder
        self._journal: JournalWriter | None = None
        self._waiting: deque[Arrived | Lost | Noted | End] = deque()
        """Not yet in the journal."""
        self._unsafe: deque[tuple[int, Arrived | Lost | Noted]] = deque()
        """In the journal but not known to be on the device, with the number of frames up to it."""
        self._faults = 0
        self._last_flush_s = 0.0
        self._last_look_s = 0.0
        self._last_read_ns = 0
        self._alarm = ""

    def run(self) -> None:
        """Until None comes; an open journal is closed then."""
        while True:
            busy = bool(self._waiting or self._unsafe)
            try:
                item = self.inbox.get(timeout=_RETRY_S if busy else None)
            except queue.Empty:
                self._guarded(self._commit)
                continue
            if item is None:
                break
            self._guarded(partial(self._take, item))
            overdue = time.monotonic() - self._last_flush_s > _GROUP_S
            if (self._waiting or self._unsafe) and (overdue or self.inbox.empty()):
                self._guarded(self._commit)
        self._guarded(self._shut)

    def _guarded(self, step: Callable[[], None]) -> None:
        """This thread never dies of an error: what waits stays in memory and is tried again.

        Memory that is short may come back; anything else that repeats itself is no trouble of the moment.
        """
        try:
            step()
            self._faults = 0
        except MemoryError:
            with contextlib.suppress(MemoryError):
                self._raise_alarm(
                    "memory",
                    "The memory of this computer is full: samples wait to be written. Close other programs",
                )
        except Exception as error:
            self._faults += 1
            self._raise_alarm(
                "recorder",
                f"Writing failed ({type(error).__name__}: {error}). It is tried again; if this stays, stop "
                "the test: what is on disk is safe",
            )
            if self._faults > _MOST_FAULTS:
                self._faults = 0
                self._give_up(f"writing failed again and again ({type(error).__name__}: {error})")

    def _take(self, item: Item) -> None:
        match item:
            case Begin():
                self._begin(item)
                return
            case Arrived(block=block):
                self.status.sample = block.first_sample + block.n_samples
                self._last_read_ns = block.read_time_ns
                self._enqueue(item)
            case Lost():
                self._enqueue(item)
                self._say(
                    "gap",
                    f"{item.n_samples} samples lost from sample {item.first_sample}: {item.reason}",
                    "error",
                    item.first_sample,
                )
            case Noted(event=event):
                self._enqueue(item)
                self._announce(event)
            case End():
                self._enqueue(item)
                return
        try:
            self._write()
        finally:
            self._forward(item)

    def _enqueue(self, item: Arrived | Lost | Noted | End) -> None:
        if self._journal is None:
            return
        self._waiting.append(item)
        if isinstance(item, Arrived):
            self.status.waiting_bytes += item.block.readings.nbytes
            if self.status.waiting_bytes > _MEMORY_LIMIT_BYTES:
                self._give_up("the disk has taken nothing for so long that the memory is full")

    def _begin(self, begin: Begin) -> None:
        if self._journal is not None:
            begin.done.set_exception(
                RequestRefused("A run is being recorded already. Stop or abort it before the next one.")
            )
            return
        header = begin.header.model_copy(update={"start_utc_ns": self._last_read_ns or time.time_ns()})
        try:
            self._journal = JournalWriter(begin.journal, header)
        except RunFileError as error:
            begin.done.set_exception(RequestRefused(str(error)))
            return
        self.status = RecorderStatus(recording=True, sample=self.status.sample, journal=begin.journal)
        self._alarm = ""
        self._forward(begin)
        begin.done.set_result(begin.journal)

    def _write(self) -> None:
        """Hand to the operating system what is waiting, in order, as far as the disk takes it."""
        while self._waiting and self._journal is not None:
            item = self._waiting[0]
            try:
                if isinstance(item, End):
                    self._close(item)
                    return
                self._append(self._journal, item)
            except JournalDiskFull as error:
                self._raise_alarm("full", str(error))
                return
            except JournalDeviceError as error:
                self._move_to_spare(str(error))
                return
            self._waiting.popleft()
            self._unsafe.append((self._journal.frames, item))
            if isinstance(item, Arrived):
                self.status.waiting_bytes -= item.block.readings.nbytes
        if self._journal is not None:
            self.status.file_bytes = self._journal.size_bytes

    def _append(self, journal: JournalWriter, item: Arrived | Lost | Noted) -> None:
        match item:
            case Arrived(block=block):
                journal.append_block(block.first_sample, block.readings)
            case Lost():
                # Lost before the run's first sample is no gap of this run.
                if journal.next_sample is not None:
                    journal.append_gap(item.first_sample, item.n_samples, item.reason)
                    self.status.gaps += 1
                    self.status.lost_samples += item.n_samples
            case Noted(event=event):
                data = {"severity": event.severity, **event.data}
                journal.append_event(event.kind, event.sample, event.text, data)

    def _commit(self) -> None:
        """Write, flush, and count what is safe now."""
        self._write()
        journal = self._journal
        if journal is None:
            return
        try:
            acknowledged = journal.sync(_SLOW_FLUSH_S)
        except JournalSlowDisk as error:
            self._raise_alarm("slow", str(error))
            return
        except JournalDeviceError as error:
            self._move_to_spare(str(error))
            return
        self._last_flush_s = time.monotonic()
        if not self._still_there(journal):
            return
        self.status.acknowledged_sample = acknowledged
        now = time.perf_counter()
        while self._unsafe and self._unsafe[0][0] <= journal.acknowledged_frames:
            _, item = self._unsafe.popleft()
            if isinstance(item, Arrived):
                self.latency.add(now - item.arrived_s)
        if self._alarm and not self._waiting:
            kind, self._alarm = _kind_of(self._alarm), ""
            again = "The disk takes data again" if kind == "disk" else "Samples are written again"
            self._say(kind, f"{again}; nothing was lost", "info")

    def _still_there(self, journal: JournalWriter) -> bool:
        """Whether the journal still has its name; looked at once a second. If not, its content is rescued."""
        now = time.monotonic()
        if now - self._last_look_s < _LOOK_S:
            return True
        self._last_look_s = now
        if journal.is_in_place():
            return True
        self._move_to_spare(f"{journal.path} was deleted or moved while it was recorded.")
        return False

    def _close(self, end: End) -> None:
        journal = self._journal
        assert journal is not None
        journal.append_event("end", end.sample, end.text, {"outcome": end.outcome})
        journal.close()
        self.status.acknowledged_sample = journal.acknowledged_sample
        self._release(Recorded(journal.path, journal.header, end))

    def _release(self, recorded: Recorded | None) -> None:
        self._journal = None
        # Blocks that came in behind the end belong to no run, and must not begin the next one.
        self._waiting.clear()
        self._unsafe.clear()
        self.status.waiting_bytes = 0
        self.status.recording = False
        self.status.journal = None
        if recorded is not None:
            self._hand_over(recorded)

    def _move_to_spare(self, why: str) -> None:
        """Go on in another folder, with what is safe copied there; one run comes of it.

        Where the old file can no longer be read, a run of its own begins with the first sample that is not
        known to be safe.
        """
        journal, spare = self._journal, self._spare_folder
        assert journal is not None
        if spare is None or spare == journal.path.parent:
            self._give_up(why)
            return
        old, moved, safe_frames = journal.path, journal, journal.acknowledged_frames
        try:
            spare.mkdir(parents=True, exist_ok=True)
            try:
                journal.move_to(spare / old.name)
            except (OSError, RunFileError):
                moved = self._continued(journal, spare, why)
                journal.abandon()
        except (OSError, RunFileError) as second:
            self._give_up(f"{why} And the spare folder: {second}")
            return
        self._journal = moved
        if moved is journal:
            # All of it is in the new file; under its old name it would be taken for a run that was cut off.
            with contextlib.suppress(OSError):
                old.replace(old.with_suffix(".journal-moved"))
        # What has been acknowledged meanwhile is in the copy, or safe in the old file.
        again = [item for frames, item in self._unsafe if frames > safe_frames]
        self._unsafe.clear()
        self._waiting.extendleft(reversed(again))
        for item in again:  # written once more, and counted then
            match item:
                case Arrived(block=block):
                    self.status.waiting_bytes += block.readings.nbytes
                case Lost(n_samples=count):
                    self.status.gaps -= 1
                    self.status.lost_samples -= count
        self.status.journal = moved.path
        self._raise_alarm("moved", f"{why} Recording goes on in {moved.path}")
        self._write()

    @staticmethod
    def _continued(journal: JournalWriter, spare: Path, why: str) -> JournalWriter:
        old = journal.header
        header = old.model_copy(
            update={
                "run_id": f"{old.run_id}-continued",
                "notes": f"{old.notes}\nContinues run {old.run_id} after: {why}",
                "start_utc_ns": time.time_ns(),
            }
        )
        return JournalWriter(spare / f"{header.run_id}{journal.path.suffix}", header)

    def _give_up(self, why: str) -> None:
        """No disk takes the data: say so, and keep what is on disk for recovery."""
        journal = self._journal
        if journal is None:
            return
        journal.abandon()
        lost = sum(item.block.n_samples for item in self._waiting if isinstance(item, Arrived))
        self.status.lost_samples += lost
        end = End("failed", self.status.sample, f"Recording failed: {why}. {lost} samples could not be kept")
        self._release(Recorded(journal.path, journal.header, end))

    def _raise_alarm(self, trouble: str, text: str) -> None:
        """Once per trouble, not at each try."""
        if self._alarm == trouble:
            return
        self._alarm = trouble
        self._say(_kind_of(trouble), text, "error")

    def _say(self, kind: str, text: str, severity: str, sample: int | None = None) -> None:
        at = self.status.sample if sample is None else sample
        event = EventMessage(
            kind=kind,
            sample=at,
            text=text,
            severity="error" if severity == "error" else "info",
        )
        if self._journal is not None:
            self._waiting.append(Noted(event))
        self._announce(event)

    def _shut(self) -> None:
        """The process ends: whatever is open is closed in good order."""
        if self._journal is None:
            return
        self._waiting.append(End("stopped", self.status.sample, "The acquisition process was ended"))
        deadline = time.monotonic() + 10.0
        while self._journal is not None and time.monotonic() < deadline:
            self._write()
            if self._journal is not None:
                time.sleep(_RETRY_S)
        self._give_up("the disk took no data while the process ended")


def _kind_of(trouble: str) -> str:
    """The kind of event that tells of a trouble."""
    return trouble if trouble in ("memory", "recorder") else "disk"
