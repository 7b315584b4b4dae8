"""The recorder thread: everything goes to disk here first, then to analysis and viewers.

One flush covers all blocks that are waiting, so a slow disk means larger groups, not a growing queue.
A full disk, a slow one or none at all costs no sample as long as there is memory: blocks wait until some
disk takes them. While no run is recorded the blocks go into the ring and the last of them stay in memory,
so that a run can begin before its order came.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from daq_app.acquisition.messages.items import (
    Arrived,
    Begin,
    End,
    Item,
    Lost,
    Noted,
    RequestRefused,
    SourceEnded,
    Started,
)
from daq_app.acquisition.messages.published import EventMessage
from daq_app.acquisition.pipeline.latency import Latency
from daq_app.acquisition.pipeline.recent import Recent
from daq_app.acquisition.pipeline.ring import Ring
from daq_app.acquisition.pipeline.run_recording import Recorded, RecorderStatus, RunRecording
from daq_app.runfile import Flusher, RunFileError, idle_flusher

_GROUP_S: Final = 0.05
"""Longest wait of a written block for its flush while more blocks keep coming."""
_RETRY_S: Final = 0.2
_MOST_FAULTS: Final = 50
"""Failures in a row, of no kind that a disk has, after which a journal is closed."""
_SHUT_S: Final = 10.0
"""How long the end of the process waits for a disk."""
_WRITTEN_BY_HAND: Final = ("marker", "note")
"""Events that go into a run that begins before its order came; all others are told again by their makers."""


class Recorder(threading.Thread):
    """Takes items from `inbox`; hands each on with `forward` once it has been written."""

    def __init__(
        self,
        forward: Callable[[Item], None],
        announce: Callable[[EventMessage], None],
        hand_over: Callable[[Recorded], None],
        spares: Sequence[Path] = (),
        ring: Ring | None = None,
        recent: Recent | None = None,
    ) -> None:
        """`spares`: folders to go on in, in order, when the run's own disk fails."""
        super().__init__(name="recorder", daemon=True)
        self.inbox: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self.status = RecorderStatus()
        self.latency = Latency()
        self._forward = forward
        self._announce = announce
        self._hand_over = hand_over
        self._spares = tuple(spares)
        self._ring = ring
        self._recent = recent or Recent(0)
        self._flusher = Flusher()
        self._run: RunRecording | None = None
        """The run that is being recorded."""
        self._ended: list[RunRecording] = []
        """Runs that are over and wait for a disk, while the next one is recorded."""
        self._faults = 0
        self._last_read_ns = 0

    def run(self) -> None:
        """Until None comes; an open journal is closed then."""
        while True:
            try:
                item = self.inbox.get(timeout=_RETRY_S if self._pending else None)
            except queue.Empty:
                self._guarded(self._commit)
                continue
            if item is None:
                break
            self._guarded(partial(self._take, item))
            run = self._run
            if run is not None and run.pending:
                overdue = time.monotonic() - run.last_flush_s > _GROUP_S
                if overdue or self.inbox.empty():
                    self._guarded(self._commit)
        self._guarded(self._shut)
        self._flusher.end()

    @property
    def _pending(self) -> bool:
        return bool(self._ended) or (self._run is not None and self._run.pending)

    @property
    def _runs(self) -> list[RunRecording]:
        """All that is not on disk as a whole, oldest first."""
        return [*self._ended, *([] if self._run is None else [self._run])]

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
            if self._faults > _MOST_FAULTS and self._runs:
                self._faults = 0
                oldest = self._runs[0]
                oldest.give_up(f"writing failed again and again ({type(error).__name__}: {error})")
                self._after_writing(oldest)

    def _raise_alarm(self, trouble: str, text: str) -> None:
        if self._run is not None:
            self._run.raise_alarm(trouble, text)
        elif self._faults <= 1:
            self._say(trouble, text, "error")

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
                if self._run is not None:
                    self._run.add(item)
                return
            case Started() | SourceEnded():
                self._recent.clear()
                if self._ring is not None and isinstance(item, Started):
                    self._ring.clear()
        try:
            self._write()
        finally:
            self._forward(item)

    def _enqueue(self, piece: Arrived | Lost | Noted) -> None:
        if self._run is None:
            self._keep(piece)
        else:
            self._run.add(piece)

    def _keep(self, piece: Arrived | Lost | Noted) -> None:
        """No run is recorded: into the ring, and for some seconds into memory."""
        if self._ring is not None:
            self._ring.put(piece)
        if not isinstance(piece, Noted) or piece.event.kind in _WRITTEN_BY_HAND:
            self._recent.add(piece)

    def _begin(self, begin: Begin) -> None:
        self._let_an_ended_run_wait()
        if self._run is not None:
            begin.done.set_exception(
                RequestRefused("A run is being recorded already. Stop or abort it before the next one.")
            )
            return
        before = self._recent.take(begin.before_samples)
        behind = sum(piece.block.n_samples for piece in before if isinstance(piece, Arrived))
        started_ns = (self._last_read_ns or time.time_ns()) - round(1e9 * behind / begin.header.rate_hz)
        header = begin.header.model_copy(update={"start_utc_ns": max(0, started_ns)})
        status = RecorderStatus(recording=True, sample=self.status.sample)
        order = replace(begin, header=header)
        try:
            self._flusher = idle_flusher(self._flusher)
            run = RunRecording(
                order, self._spares, status, self.latency, self._say, self._make_room, self._flusher
            )
        except RunFileError as error:
            for piece in before:
                self._recent.add(piece)
            begin.done.set_exception(RequestRefused(str(error)))
            return
        self._run, self.status = run, status
        status.journal = run.path
        for piece in before:
            run.add(piece)
        self._forward(begin)
        begin.done.set_result(run.path)
        self._write()
        if self._ring is not None and run.whole_on_disk:
            self._ring.clear()  # what mattered of it is in the run

    def _let_an_ended_run_wait(self) -> None:
        """A disk that does not take the end of a run must not keep the next release from being recorded."""
        run = self._run
        if run is None or not run.ended:
            return
        self._ended.append(run)
        self._run, self.status = None, RecorderStatus(sample=self.status.sample)
        for piece in run.take_behind_the_end():
            self._keep(piece)

    def _write(self) -> None:
        for run in self._runs:
            run.write()
            self._after_writing(run)

    def _commit(self) -> None:
        for run in self._runs:
            run.commit()
            self._after_writing(run)

    def _after_writing(self, run: RunRecording) -> None:
        """A run that is over is handed on; what came behind its end is the beginning of what comes next."""
        recorded = run.recorded
        if recorded is None:
            return
        behind_the_end = run.forget()
        if run is self._run:
            self._run = None
            self.status.waiting_bytes = 0
            self.status.recording = False
            self.status.journal = None
        else:
            self._ended.remove(run)
        for piece in behind_the_end:
            self._keep(piece)
        self._hand_over(recorded)

    def _say(self, kind: str, text: str, severity: str, sample: int | None = None) -> None:
        at = self.status.sample if sample is None else sample
        event = EventMessage(
            kind=kind,
            sample=at,
            text=text,
            severity="error" if severity == "error" else "info",
        )
        if self._run is not None:
            self._run.note(Noted(event))
        self._announce(event)

    def _make_room(self) -> None:
        """A test needs the disk more than the ring does."""
        if self._ring is not None:
            self._ring.clear()

    def _shut(self) -> None:
        """The process ends: whatever is open is closed in good order."""
        if self._run is not None:
            self._run.add(End("stopped", self.status.sample, "The acquisition process was ended"))
        deadline = time.monotonic() + _SHUT_S
        for run in self._runs:
            while run.recorded is None:
                run.write()
                if run.recorded is None and time.monotonic() > deadline:
                    run.give_up("no disk took data while the process ended")
                elif run.recorded is None:
                    time.sleep(_RETRY_S)
            self._after_writing(run)
