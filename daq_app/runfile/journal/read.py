"""A journal as a run: header, events, gaps, and readings window by window.

A sample is either proven by two CRCs or missing; nothing is guessed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.journal.frames import HEADING_BYTES, MAX_TEXT_BYTES, Frame, FrameType, unpack_heading
from daq_app.runfile.journal.scan import Scan, payload_is_good, scan_frames
from daq_app.runfile.model import MAX_GAP_SAMPLES, MAX_SAMPLES, Event, Gap, RunHeader, to_json
from daq_app.runfile.plain_text import clean_text

_MAX_EVENT_BYTES: Final = 2**26
"""All events of a run together: a test of half an hour has some hundred kilobytes."""
_LOST: Final = "lost: the journal is damaged here"


@dataclass(frozen=True, slots=True)
class _Span:
    """A run of consecutive good samples inside one data frame."""

    first: int
    end: int
    frame: Frame


class JournalContents:
    """The good part of a journal, opened for reading. Use as a context manager."""

    def __init__(self, path: Path, file: BinaryIO, scan: Scan) -> None:
        self.path = path
        self._file = file
        self._scan = scan
        self.header = self._read_header(scan)
        self.frames: tuple[Frame, ...] = tuple(scan.frames)
        self.damage: list[str] = []
        """One sentence for each thing that is wrong; empty for a journal in good order."""
        self._spans = self._good_spans()
        self.events = self._read_events()
        self.closed = bool(self.frames) and self.frames[-1].type is FrameType.END
        """Whether the recorder closed it in good order."""
        self.first_sample, self.gaps = self._find_gaps()
        self.n_samples = self._end - self.first_sample
        self._describe_damage()

    @property
    def file_bytes(self) -> int:
        return self._scan.file_bytes

    @property
    def tail_bytes(self) -> int:
        """Bytes after the last good frame: what was being written when the recorder died, or damage."""
        ranges = self._scan.bad_ranges
        if ranges and ranges[-1][1] == self._scan.file_bytes:
            return ranges[-1][1] - ranges[-1][0]
        return 0

    @property
    def tail_samples(self) -> int:
        """How many samples of each channel the unreadable end may have held, at most."""
        return self.tail_bytes // (8 * self.header.n_channels)

    @property
    def lost_samples(self) -> int:
        return sum(gap.n_samples for gap in self.gaps)

    def windows(self, size: int) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """The run from its first sample in windows of `size` samples: (first sample, (n_channels, m)).

        Missing samples are NaN. Every payload is checked against its CRC again as it is read;
        raises `RunFileError` if the file changed since it was opened.
        """
        spans = self._spans
        at = 0
        cached: tuple[Frame, NDArray[np.float64]] | None = None
        for first in range(self.first_sample, self._end, size):
            end = min(first + size, self._end)
            window = np.full((self.header.n_channels, end - first), np.nan)
            while at < len(spans) and spans[at].first < end:
                span = spans[at]
                if cached is None or cached[0] is not span.frame:
                    cached = (span.frame, self._payload_samples(span.frame))
                low, high = max(first, span.first), min(end, span.end)
                offset = span.frame.first_sample
                window[:, low - first : high - first] = cached[1][:, low - offset : high - offset]
                if span.end > end:
                    break
                at += 1
            yield first, window

    def close(self) -> None:
        """Close the file; safe twice."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _payload(self, frame: Frame) -> bytes:
        if not payload_is_good(self._file, frame):
            raise RunFileError(f"{self.path} changed while it was read", advice="Is it still being recorded?")
        self._file.seek(frame.payload_offset)
        return self._file.read(frame.payload_bytes)

    def _payload_samples(self, frame: Frame) -> NDArray[np.float64]:
        samples = np.frombuffer(self._payload(frame), dtype="<f8")
        return samples.reshape(frame.n_channels, frame.n_samples)

    def _read_header(self, scan: Scan) -> RunHeader:
        frame = next((frame for frame in scan.frames if frame.type is FrameType.HEADER), None)
        if frame is not None and frame.payload_bytes > MAX_TEXT_BYTES:
            raise RunFileError(f"{self.path}: its header is absurdly long")
        if frame is None:
            raise RunFileError(f"{self.path}: the header of this journal is lost")
        try:
            return RunHeader.model_validate_json(self._payload(frame))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            raise RunFileError(f"{self.path}: its header is not valid: {where}: {first['msg']}") from error

    def _good_spans(self) -> list[_Span]:
        """Data frames in order; one that overlaps samples already there is dropped and said."""
        spans: list[_Span] = []
        previous_end: int | None = None
        for frame in self.frames:
            if frame.type is FrameType.GAP and previous_end is not None:
                previous_end = max(previous_end, frame.end_sample)
            if frame.type is not FrameType.DATA or frame.n_samples == 0:
                continue
            if frame.n_channels != self.header.n_channels:
                self.damage.append(f"a block of {frame.n_channels} channels was left out")
                continue
            if previous_end is not None and frame.first_sample < previous_end:
                self.damage.append(f"a block that repeats sample {frame.first_sample} was left out")
                continue
            spans.append(_Span(frame.first_sample, frame.end_sample, frame))
            previous_end = frame.end_sample
        return spans

    def _read_events(self) -> tuple[Event, ...]:
        events: list[Event] = []
        budget = _MAX_EVENT_BYTES
        for frame in self.frames:
            if frame.type is not FrameType.EVENT:
                continue
            budget -= frame.payload_bytes
            if frame.payload_bytes > MAX_TEXT_BYTES or budget < 0:
                self.damage.append("an event that is absurdly long was left out")
                continue
            try:
                content = json.loads(self._payload(frame))
                kind, text = clean_text(str(content["kind"])), clean_text(str(content["text"]))
                data = json.loads(to_json(dict(content["data"])))
            except (ValueError, KeyError, TypeError, RecursionError):
                self.damage.append("an event that cannot be read was left out")
                continue
            events.append(Event(kind, frame.first_sample, text, data))
        return tuple(events)

    def _find_gaps(self) -> tuple[int, tuple[Gap, ...]]:
        """First sample, and everything between first and end that no good frame covers."""
        recorded = [f for f in self.frames if f.type is FrameType.GAP and f.n_samples > 0]
        starts = [span.first for span in self._spans[:1]] + [frame.first_sample for frame in recorded]
        first = min(starts, default=0)
        end = max(
            [first] + [span.end for span in self._spans[-1:]] + [frame.end_sample for frame in recorded]
        )
        closing = next((frame for frame in self.frames if frame.type is FrameType.END), None)
        if closing is not None and self._spans:
            end = max(end, closing.first_sample)
        holes: list[tuple[int, int]] = []
        position = first
        for span in self._spans:
            if span.first > position:
                holes.append((position, span.first))
            position = span.end
        if end > position:
            holes.append((position, end))
        missing = sum(stop - start for start, stop in holes)
        if missing > MAX_GAP_SAMPLES or end - first > MAX_SAMPLES or abs(first) > 2**62:
            raise RunFileError(
                f"{self.path}: claims that {missing} samples are missing, which cannot be true of a test"
            )
        self._end = end
        return first, tuple(_explained(holes, recorded, self._reason))

    def _reason(self, frame: Frame) -> str:
        if frame.payload_bytes > MAX_TEXT_BYTES:
            return "reason not readable"
        return clean_text(self._payload(frame).decode("utf-8", "replace"))

    @cached_property
    def ends_in_torn_frame(self) -> bool:
        """Whether the unreadable end is no more than the one frame that was being written at the end.

        Where not even its heading is whole, it is one frame if it is no longer than those before it.
        """
        if self.closed or not self.tail_bytes:
            return False  # nothing is written after the end frame
        start = self._scan.file_bytes - self.tail_bytes
        self._file.seek(start)
        torn = unpack_heading(self._file.read(HEADING_BYTES), start)
        if torn is not None:
            return torn.end_offset >= self._scan.file_bytes
        longest = max(
            (frame.payload_bytes for frame in self.frames if frame.type is FrameType.DATA), default=0
        )
        return self.tail_bytes <= HEADING_BYTES + longest

    def _describe_damage(self) -> None:
        scan = self._scan
        inner = len(scan.bad_ranges) - (1 if self.tail_bytes else 0)
        if inner:
            lost = sum(end - start for start, end in scan.bad_ranges[:inner])
            self.damage.append(f"{lost} bytes in {inner} places are damaged")
        if self.tail_bytes and not self.ends_in_torn_frame:
            self.damage.append(
                f"at least {self.tail_bytes} bytes at its end cannot be read: up to {self.tail_samples} "
                "samples of each channel may be missing there"
            )
        for count, what in (
            (scan.foreign, "frames of another journal were left out"),
            (scan.duplicates, "repeated frames were left out"),
            (scan.conflicts, "places hold frames that contradict each other; none of them was used"),
            (scan.reordered, "frames stand out of order; they were put in order by their numbers"),
        ):
            if count:
                self.damage.append(f"{count} {what}")
        numbers = [frame.sequence for frame in self.frames]
        absent = (numbers[-1] + 1 - len(numbers)) if numbers else 0
        if absent:
            self.damage.append(f"{absent} of {numbers[-1] + 1} frames are missing")


def _explained(holes: Sequence[tuple[int, int]], recorded: Sequence[Frame], reason: Any) -> Iterator[Gap]:
    """Holes cut at the edges of the gaps that the recorder declared, each with its reason."""
    for start, stop in holes:
        position = start
        for frame in sorted(recorded, key=lambda f: f.first_sample):
            low, high = max(position, frame.first_sample), min(stop, frame.end_sample)
            if low >= high:
                continue
            if low > position:
                yield Gap(position, low - position, _LOST)
            yield Gap(low, high - low, reason(frame))
            position = high
        if position < stop:
            yield Gap(position, stop - position, _LOST)


def read_journal(path: Path) -> JournalContents:
    """Open a journal in whatever state it is. Raises `RunFileError` if nothing of it can be used."""
    try:
        file = path.open("rb")
    except OSError as error:
        raise RunFileError(f"{path} cannot be read ({error.strerror})") from error
    try:
        size = file.seek(0, 2)
        try:
            return JournalContents(path, file, scan_frames(file, size))
        except RunFileError as error:
            if str(path) in error.message:
                raise
            raise RunFileError(f"{path}: {error.message}", advice=error.advice) from error
    except BaseException:
        file.close()
        raise
