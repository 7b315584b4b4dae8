"""The journal: readings on disk first, in frames that prove themselves.

Threads: appends come from one thread; `sync` and the properties may be called from any.
"""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from concurrent.futures import Future, wait
from concurrent.futures import TimeoutError as FutureTimeout
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile.durable import fsync_data, fsync_folder
from daq_app.runfile.errors import (
    JournalDeviceError,
    JournalDiskFull,
    JournalError,
    JournalSlowDisk,
    RunFileError,
)
from daq_app.runfile.journal.flusher import Flusher
from daq_app.runfile.journal.frames import MAX_PAYLOAD_BYTES, MAX_TEXT_BYTES, TAG_BYTES, FrameType, pack_frame
from daq_app.runfile.journal.locks import lock_file
from daq_app.runfile.journal.scan import scan_frames
from daq_app.runfile.model import MAX_GAP_SAMPLES, RunHeader, to_json

_HEADER_COPY_AFTER_FRAMES: Final = 100
_FULL: Final = (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)


class JournalWriter:
    """Appends a run to a new file.

    *Written* means handed to the operating system: safe from the death of this process.
    *Acknowledged* means flushed to the device: safe from the death of the machine.  The caller
    decides when to `sync` (every read, or ten times a second, costs about 4 ms each); `sync` may run
    in another thread while blocks are appended.
    """

    def __init__(self, path: Path, header: RunHeader, flusher: Flusher | None = None) -> None:
        """Create `path` (never overwrites), lock it, and flush the header.

        `flusher` does what `sync` may not wait for; without one the journal makes its own when it needs it.
        Raises `RunFileError` if it exists or cannot be created, `JournalError` if the disk fails.
        """
        self.path = path
        self.header = header
        self._tag = os.urandom(TAG_BYTES)
        self._sequence = 0
        self._next_sample: int | None = None
        self._acknowledged = 0
        self._safe = (0, 0)
        """Bytes and frames known to be on the device."""
        self._bytes = 0
        self._failed: JournalDeviceError | None = None
        self._closed = False
        self._header_copied = False
        self._append_lock = threading.Lock()
        self._sync_lock = threading.Lock()
        self._flusher, self._owns_flusher = flusher, False
        self._pending_sync: Future[int] | None = None
        self._header_payload = header.model_dump_json().encode()
        if len(self._header_payload) > MAX_TEXT_BYTES:
            raise RunFileError(f"{path}: the run's header is too long", advice="Shorten notes or truth.")
        self._fd = _create(path)
        try:
            lock_file(self._fd, str(path))
            self._append(FrameType.HEADER, self._header_payload)
            self.sync()
            fsync_folder(path.parent)
        except BaseException:
            os.close(self._fd)
            self._closed = True
            raise

    @property
    def next_sample(self) -> int | None:
        """One past the last sample written; None before the first."""
        return self._next_sample

    @property
    def acknowledged_sample(self) -> int:
        """One past the last sample known to be on the device."""
        return self._acknowledged

    @property
    def size_bytes(self) -> int:
        return self._bytes

    @property
    def frames(self) -> int:
        """Frames written."""
        return self._sequence

    @property
    def acknowledged_frames(self) -> int:
        """Frames known to be on the device."""
        return self._safe[1]

    def append_block(self, first_sample: int, readings: NDArray[np.float64]) -> None:
        """Write readings (n_channels, n_samples), rows as in the header.

        A jump ahead of the last sample is written as a gap by itself; going back raises `ValueError`.
        Raises `JournalError` if the disk fails; after `JournalDiskFull` the same block may be tried again.
        """
        if readings.ndim != 2 or readings.shape[0] != self.header.n_channels:
            raise ValueError(f"a block of shape {readings.shape} for {self.header.n_channels} channels")
        n_samples = int(readings.shape[1])
        if n_samples == 0:
            return
        expected = self._next_sample
        if expected is not None and first_sample < expected:
            raise ValueError(f"block starts at sample {first_sample}, but {expected} is the next")
        if expected is not None and first_sample > expected:
            self.append_gap(expected, first_sample - expected, "samples never arrived")
        step = max(1, MAX_PAYLOAD_BYTES // (8 * self.header.n_channels))
        for start in range(0, n_samples, step):
            piece = np.ascontiguousarray(readings[:, start : start + step], dtype="<f8")
            size = int(piece.shape[1])
            self._append(
                FrameType.DATA,
                piece.data.cast("B"),
                first_sample=first_sample + start,
                n_samples=size,
                n_channels=self.header.n_channels,
            )
            self._next_sample = first_sample + start + size
        if self._sequence >= _HEADER_COPY_AFTER_FRAMES and not self._header_copied:
            self._append(FrameType.HEADER, self._header_payload)
            self._header_copied = True

    def append_event(self, kind: str, sample: int, text: str, data: dict[str, Any] | None = None) -> None:
        """Write an event at an absolute sample (it may lie in the past). `data` is kept as JSON."""
        payload = to_json({"kind": kind, "text": text, "data": data or {}}).encode()
        self._append(FrameType.EVENT, payload, first_sample=sample)

    def append_gap(self, first_sample: int, n_samples: int, reason: str) -> None:
        """Say that samples are missing; the next block starts after them.

        Raises `ValueError` if they are not the next samples, or absurdly many.
        """
        if n_samples <= 0:
            raise ValueError(f"a gap of {n_samples} samples")
        if n_samples > MAX_GAP_SAMPLES:
            raise ValueError(f"a gap of {n_samples} samples is too long for one run: start another run")
        if self._next_sample is not None and first_sample != self._next_sample:
            raise ValueError(f"gap starts at sample {first_sample}, but {self._next_sample} is the next")
        self._append(
            FrameType.GAP, reason.encode("utf-8", "replace"), first_sample=first_sample, n_samples=n_samples
        )
        self._next_sample = first_sample + n_samples

    def sync(self, timeout_s: float | None = None) -> int:
        """Flush to the device and return the acknowledged sample (one past the last safe one).

        With `timeout_s`, raises `JournalSlowDisk` if the device takes longer; the flush goes on, and the
        next call waits for it. Raises `JournalDeviceError` if the device fails: nothing is acknowledged
        ever after, since the system may have dropped the unwritten pages.
        """
        if timeout_s is None:
            return self._flush()
        if self._flusher is None:
            self._flusher, self._owns_flusher = Flusher(), True
        if self._pending_sync is None:
            self._pending_sync = self._flusher.submit(self._flush)
        try:
            acknowledged = self._pending_sync.result(timeout_s)
        except FutureTimeout:
            raise JournalSlowDisk(
                f"{self.path.name}: the disk has not confirmed a write for {timeout_s:g} s",
                advice="Close other programs that use this disk; recording goes on in memory and cache.",
                safe_sample=self._acknowledged,
            ) from None
        except JournalError:
            self._pending_sync = None
            raise
        self._pending_sync = None
        return acknowledged

    def is_in_place(self) -> bool:
        """Whether the file is still there under its name: a folder can be deleted under a recording."""
        try:
            return os.path.samestat(os.fstat(self._fd), self.path.stat())
        except OSError:
            return False

    def move_to(self, path: Path) -> None:
        """Go on in a new file at `path`: the way out of a disk that fails or a file that was deleted.

        It begins with everything that was acknowledged. What had been written but not acknowledged is not
        taken along: append it again. Every frame is checked while it is copied. Raises `RunFileError` or
        `OSError`, with the old file still in use.
        """
        n_bytes, n_frames = self._safe
        fd = _create(path)
        try:
            lock_file(fd, str(path))
            self._copy(fd, n_bytes)
            with path.open("rb") as copied:
                frames = scan_frames(copied, n_bytes).frames
            if [frame.sequence for frame in frames] != list(range(n_frames)):
                raise RunFileError(
                    f"{self.path} can no longer be read in full", advice="What is left of it is kept."
                )
            fsync_data(fd)
            fsync_folder(path.parent)
        except BaseException:
            os.close(fd)
            path.unlink(missing_ok=True)
            raise
        hangs, old_fd = self._pending_sync is not None, self._fd
        with self._append_lock:
            # A flush of the old file may hang for ever: it is left to itself, with a lock of its own.
            self._sync_lock, self._pending_sync = threading.Lock(), None
            self._fd, self.path = fd, path
            self._bytes, self._sequence = n_bytes, n_frames
            self._next_sample = max(
                (f.end_sample for f in frames if f.type in (FrameType.DATA, FrameType.GAP)), default=None
            )
            self._failed = None
        if hangs:
            self._leave_flusher()
        with contextlib.suppress(OSError):
            os.close(old_fd)

    def _copy(self, fd: int, n_bytes: int) -> None:
        position = os.lseek(self._fd, 0, os.SEEK_CUR)
        try:
            os.lseek(self._fd, 0, os.SEEK_SET)
            left = n_bytes
            while left > 0 and (piece := os.read(self._fd, min(left, 2**20))):
                view = memoryview(piece)
                while view:
                    view = view[os.write(fd, view) :]
                left -= len(piece)
        finally:
            os.lseek(self._fd, position, os.SEEK_SET)

    def close(self) -> None:
        """Write the end frame and a last copy of the header, flush, unlock. Safe twice."""
        if self._closed:
            return
        try:
            self._append(FrameType.HEADER, self._header_payload)
            self._append(FrameType.END, b"", first_sample=self._next_sample or 0)
            self.sync()
        finally:
            self._release()

    def abandon(self) -> None:
        """Close the file as it is, without an end frame (after an error). Safe twice."""
        if not self._closed:
            self._release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self.abandon()

    def _release(self) -> None:
        self._closed = True
        if self._pending_sync is not None:
            wait([self._pending_sync])
        self._leave_flusher()
        with self._sync_lock:
            os.close(self._fd)

    def _leave_flusher(self) -> None:
        if self._flusher is not None and self._owns_flusher:
            self._flusher.end()
        self._flusher = None

    def _append(
        self,
        type_: FrameType,
        payload: bytes | memoryview,
        *,
        first_sample: int = 0,
        n_samples: int = 0,
        n_channels: int = 0,
    ) -> None:
        if self._closed:
            raise RunFileError(f"{self.path} is closed", advice="Open a new journal.")
        if self._failed is not None:
            raise self._failed
        with self._append_lock:
            frame = pack_frame(
                type_,
                self._tag,
                self._sequence,
                payload,
                first_sample=first_sample,
                n_samples=n_samples,
                n_channels=n_channels,
            )
            self._write_all(frame)
            self._sequence += 1

    def _write_all(self, data: bytes) -> None:
        """Write every byte, however short the single writes; on failure cut back to the last whole frame."""
        view = memoryview(data)
        done = 0
        try:
            while done < len(view):
                written = os.write(self._fd, view[done:])
                if written == 0:
                    raise OSError(errno.EIO, "the system wrote nothing")
                done += written
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._fd, self._bytes)
                os.lseek(self._fd, self._bytes, os.SEEK_SET)
            raise self._write_error(error) from error
        self._bytes += len(view)

    def _write_error(self, error: OSError) -> JournalError:
        if error.errno in _FULL:
            return JournalDiskFull(
                f"{self.path.name}: the disk is full",
                advice="Free space on this disk now; recording continues when there is room.",
                safe_sample=self._acknowledged,
            )
        return self._refuse_for_good(error)

    def _refuse_for_good(self, error: OSError) -> JournalDeviceError:
        """After a failed flush the system may have dropped pages: what follows can't be acknowledged."""
        self._failed = JournalDeviceError(
            f"{self.path.name}: the disk failed ({error.strerror})",
            advice="Stop, record to another disk, and run `daq-app recover` on this folder.",
            safe_sample=self._acknowledged,
        )
        return self._failed

    def _flush(self) -> int:
        with self._sync_lock:
            if self._closed:
                return self._acknowledged
            if self._failed is not None:
                raise self._failed
            fd = self._fd
            with self._append_lock:
                written, safe = self._next_sample or 0, (self._bytes, self._sequence)
            try:
                fsync_data(fd)
            except OSError as error:
                if fd != self._fd:  # a flush of the file that was left behind
                    return self._acknowledged
                raise self._refuse_for_good(error) from error
            if fd == self._fd:
                self._acknowledged, self._safe = max(self._acknowledged, written), max(self._safe, safe)
            return self._acknowledged


def _create(path: Path) -> int:
    """A new file, open for reading and writing. Raises `RunFileError`."""
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
    try:
        return os.open(path, flags, 0o644)
    except FileExistsError as error:
        raise RunFileError(f"{path} exists already", advice="A journal is never overwritten.") from error
    except OSError as error:
        raise RunFileError(
            f"{path} cannot be created ({error.strerror})", advice="Choose a folder on a writable disk."
        ) from error
