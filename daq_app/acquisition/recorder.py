"""The recorder thread: everything goes to disk here first, then to analysis and viewers.

One flush covers all blocks that are waiting, so a slow disk means larger groups, not a growing queue.
A full disk or a slow one costs no sample: blocks wait in memory until the disk takes them.
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.acquisition.items import Arrived, Begin, End, Item, Lost, Noted, RequestRefused
from daq_app.acquisition.latency import Latency
from daq_app.acquisition.messages import EventMessage
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
        self._unsafe: deque[Arrived | Lost | Noted] = deque()
        """In the journal but not known to be on the device."""
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
                self._commit()
                continue
            if item is None:
                break
            self._take(item)
            overdue = time.monotonic() - self._last_flush_s > _GROUP_S
            if (self._waiting or self._unsafe) and (overdue or self.inbox.empty()):
                self._commit()
        self._shut()

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
        self._write()
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
                    self._waiting.popleft()
                    return
                self._append(self._journal, item)
            except JournalDiskFull as error:
                self._raise_alarm("disk", str(error))
                return
            except JournalDeviceError as error:
                self._move_to_spare(str(error))
                return
            self._waiting.popleft()
            self._unsafe.append(item)
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
            self._raise_alarm("disk", str(error))
            return
        except JournalDeviceError as error:
            self._move_to_spare(str(error))
            return
        self._last_flush_s = time.monotonic()
        if not self._still_there(journal):
            return
        self.status.acknowledged_sample = acknowledged
        now = time.perf_counter()
        while self._unsafe:
            item = self._unsafe[0]
            if isinstance(item, Arrived):
                if item.block.first_sample + item.block.n_samples > acknowledged:
                    break
                self.latency.add(now - item.arrived_s)
            self._unsafe.popleft()
        if self._alarm and not self._waiting:
            self._alarm = ""
            self._say("disk", "The disk takes data again; nothing was lost", "info")

    def _still_there(self, journal: JournalWriter) -> bool:
        """Whether the journal still has its name; looked at once a second. If not, its content is rescued."""
        now = time.monotonic()
        if now - self._last_look_s < _LOOK_S:
            return True
        self._last_look_s = now
        if journal.is_in_place():
            return True
        self._move_to_spare(f"{journal.path} was deleted or moved while it was recorded", rescue=True)
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
        self._unsafe.clear()
        self.status.recording = False
        self.status.journal = None
        if recorded is not None:
            self._hand_over(recorded)

    def _move_to_spare(self, why: str, *, rescue: bool = False) -> None:
        """Go on in another folder from the first sample that is not known to be safe.

        `rescue` copies what the old file holds first: its name is gone, its content is not.
        """
        journal, spare = self._journal, self._spare_folder
        assert journal is not None
        if spare is None or (spare == journal.path.parent and not rescue):
            self._give_up(why)
            return
        old = journal.header
        header = old.model_copy(
            update={
                "run_id": f"{old.run_id}-continued",
                "notes": f"{old.notes}\nContinues run {old.run_id} after: {why}",
                "start_utc_ns": time.time_ns(),
            }
        )
        try:
            spare.mkdir(parents=True, exist_ok=True)
            if rescue:
                journal.copy_to(spare / journal.path.name)
            self._journal = JournalWriter(spare / f"{header.run_id}{journal.path.suffix}", header)
        except (OSError, RunFileError) as second:
            self._give_up(f"{why}; and the spare folder: {second}")
            return
        journal.abandon()
        self._waiting.extendleft(reversed(self._unsafe))
        self.status.waiting_bytes += sum(
            item.block.readings.nbytes for item in self._unsafe if isinstance(item, Arrived)
        )
        self._unsafe.clear()
        self.status.journal = self._journal.path
        self._raise_alarm("disk", f"{why} Recording goes on in {self._journal.path}")
        self._write()

    def _give_up(self, why: str) -> None:
        """No disk takes the data: say so, and keep what is on disk for recovery."""
        journal = self._journal
        if journal is None:
            return
        journal.abandon()
        lost = sum(item.block.n_samples for item in self._waiting if isinstance(item, Arrived))
        self._waiting.clear()
        self.status.waiting_bytes = 0
        self.status.lost_samples += lost
        end = End("failed", self.status.sample, f"Recording failed: {why}. {lost} samples could not be kept")
        self._release(Recorded(journal.path, journal.header, end))

    def _raise_alarm(self, kind: str, text: str) -> None:
        """Once per trouble, not at each try."""
        if self._alarm == kind:
            return
        self._alarm = kind
        self._say(kind, text, "error")

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
