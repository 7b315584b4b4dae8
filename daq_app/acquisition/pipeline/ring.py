"""The last minutes on disk while nothing is recorded: journal segments in a hidden folder, oldest first out.

A thread of its own, after the recorder's: a disk that hangs holds up neither samples nor a test. What is
written here matters when the process dies with a wall in the air that nobody had armed; while the process
lives, a release is kept from memory.
"""

from __future__ import annotations

import contextlib
import queue
import secrets
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final

from daq_app.acquisition.messages.items import Arrived, Lost, Noted
from daq_app.runfile import (
    JOURNAL_SUFFIX,
    Flusher,
    JournalSlowDisk,
    JournalWriter,
    RunFileError,
    RunHeader,
    idle_flusher,
)

FOLDER: Final = ".ring"
"""Inside the folder of the runs; one folder a session of the ring below it."""
_SEGMENTS: Final = 8
"""Pieces that the ring is cut into: an eighth more than asked for lies on disk at most."""
_SYNC_EVERY_S: Final = 1.0
_RETRY_S: Final = 5.0
_WAITING_LIMIT_BYTES: Final = 64 * 2**20
"""Blocks held for a disk that hangs; what comes then is left out of the ring, not out of a run."""

Piece = Arrived | Lost | Noted
HeaderOf = Callable[[str], RunHeader]
"""Makes the header of a segment from its run id, with the zero that is in force."""


class Ring(threading.Thread):
    """Keeps about `keep_samples` samples of the present session on disk. All calls return at once."""

    def __init__(self, folder: Path, keep_samples: int, header_of: HeaderOf) -> None:
        """`folder`: that of the runs. Segments of other sessions in it are left alone."""
        super().__init__(name="ring", daemon=True)
        self.session = secrets.token_hex(8)
        """Names the ring in a run that was kept from it."""
        self.trouble = ""
        """Why the ring cannot be written; empty when it can."""
        self._root = folder / FOLDER
        self._segment_samples = max(1, keep_samples // _SEGMENTS)
        self._header_of = header_of
        self._inbox: queue.SimpleQueue[Piece | str] = queue.SimpleQueue()
        self._waiting_bytes = 0
        self._journal: JournalWriter | None = None
        self._flusher = Flusher()
        self._began_at = 0
        self._number = 0
        self._segments: deque[Path] = deque()
        self._synced_s = 0.0
        self._retry_at_s = 0.0

    @property
    def place(self) -> Path:
        """Folder of this session's segments."""
        return self._root / self.session

    def put(self, piece: Piece) -> None:
        """Write it when its turn comes."""
        if isinstance(piece, Arrived):
            if self._waiting_bytes > _WAITING_LIMIT_BYTES:
                return
            self._waiting_bytes += piece.block.readings.nbytes
        self._inbox.put(piece)

    def clear(self) -> None:
        """Forget everything: a run has it, or it will never be wanted."""
        self._inbox.put("clear")

    def close(self, *, keep: bool) -> None:
        """End the thread; with `keep` the segments stay for the next start to look at."""
        self._inbox.put("keep" if keep else "end")
        if self.is_alive():
            self.join(10.0)

    def run(self) -> None:
        """Until `close`."""
        while True:
            piece = self._inbox.get()
            if isinstance(piece, str):
                self._shut()
                if piece != "keep":
                    self._remove_all()
                if piece != "clear":
                    self._flusher.end()
                    return
                continue
            if isinstance(piece, Arrived):
                self._waiting_bytes -= piece.block.readings.nbytes
            if time.monotonic() < self._retry_at_s:
                continue
            try:
                self._write(piece)
                self.trouble = ""
            except (OSError, ValueError, RunFileError, MemoryError) as error:
                # The ring is a second line: it gives way at once and is begun anew a little later.
                self.trouble = str(error) or "no memory"
                self._retry_at_s = time.monotonic() + _RETRY_S
                with contextlib.suppress(MemoryError):
                    self._shut()
                    self._remove_all()

    def _write(self, piece: Piece) -> None:
        match piece:
            case Arrived(block=block):
                journal = self._segment(block.first_sample)
                journal.append_block(block.first_sample, block.readings)
                if block.first_sample + block.n_samples - self._began_at >= self._segment_samples:
                    self._shut()
                elif time.monotonic() - self._synced_s > _SYNC_EVERY_S:
                    self._synced_s = time.monotonic()
                    with contextlib.suppress(JournalSlowDisk):
                        journal.sync(0.0)
            case Lost():
                self._shut()
            case Noted(event=event):
                if event.kind == "tare":
                    self._shut()  # the next segment's header has the new zero
                elif self._journal is not None:
                    self._journal.append_event(event.kind, event.sample, event.text, {**event.data})

    def _segment(self, first_sample: int) -> JournalWriter:
        if self._journal is None:
            self._drop_oldest()
            self.place.mkdir(parents=True, exist_ok=True)
            run_id = f"{self.session}-{self._number:06d}"
            path = self.place / f"{run_id}{JOURNAL_SUFFIX}"
            self._flusher = idle_flusher(self._flusher)
            self._journal = JournalWriter(path, self._header_of(run_id), self._flusher)
            self._number += 1
            self._began_at = first_sample
            self._segments.append(path)
        return self._journal

    def _drop_oldest(self) -> None:
        while len(self._segments) > _SEGMENTS:
            with contextlib.suppress(OSError):
                self._segments[0].unlink(missing_ok=True)
            self._segments.popleft()

    def _shut(self) -> None:
        """Close the segment that is being written; unproven bytes are no loss here."""
        if self._journal is not None:
            with contextlib.suppress(OSError, RunFileError):
                self._journal.abandon()
            self._journal = None

    def _remove_all(self) -> None:
        shutil.rmtree(self.place, ignore_errors=True)
        with contextlib.suppress(OSError):
            self._root.rmdir()  # only where no other session has left anything
        self._segments.clear()


def ring_sessions(folder: Path) -> list[Path]:
    """Folders of ring sessions that were left in a folder of runs, oldest first."""
    root = folder / FOLDER
    if not root.is_dir() or root.is_symlink():
        return []
    sessions = [path for path in root.iterdir() if path.is_dir() and not path.is_symlink()]
    return sorted(sessions, key=lambda path: path.stat().st_mtime_ns)
