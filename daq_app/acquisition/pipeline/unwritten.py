"""What of a run is not known to be on a disk yet, in order: nothing of it is forgotten before it is."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final

from daq_app.acquisition.messages.items import Arrived, End, Lost, Noted

MEMORY_LIMIT_BYTES: Final = 512 * 2**20
"""Blocks held in memory while no disk takes any: six minutes of 41 channels at 4000 Hz."""
_OVERFLOW: Final = "no disk took data for so long that the memory was full"

Piece = Arrived | Lost | Noted


class Unwritten:
    """The queue in front of a journal, and what has been written into it without being acknowledged."""

    def __init__(self, limit_bytes: int = MEMORY_LIMIT_BYTES) -> None:
        self._limit_bytes = limit_bytes
        self._waiting: deque[Piece | End] = deque()
        self._unsafe: deque[tuple[int, Piece]] = deque()
        """Written, with the number of frames up to it."""
        self.waiting_bytes = 0
        self.dropped_samples = 0
        """Samples per channel that the memory could not hold."""

    def __bool__(self) -> bool:
        return bool(self._waiting or self._unsafe)

    @property
    def waits(self) -> bool:
        """Whether something has not been written."""
        return bool(self._waiting)

    @property
    def first(self) -> Piece | End:
        """What is to be written next."""
        return self._waiting[0]

    def add(self, piece: Piece | End) -> None:
        """Put it at the end. A block for which there is no memory becomes a gap, and is counted."""
        if isinstance(piece, Arrived):
            if self.waiting_bytes > self._limit_bytes:
                self._drop(piece)
                return
            self.waiting_bytes += piece.block.readings.nbytes
        self._waiting.append(piece)

    def _drop(self, piece: Arrived) -> None:
        block, last = piece.block, self._waiting[-1]
        self.dropped_samples += block.n_samples
        if isinstance(last, Lost) and last.reason == _OVERFLOW:
            first, known = last.first_sample, last.n_samples
            self._waiting[-1] = Lost(first, known + block.n_samples, _OVERFLOW)
        else:
            self._waiting.append(Lost(block.first_sample, block.n_samples, _OVERFLOW))

    def written(self, frames: int) -> None:
        """The first has been written; the journal has so many frames now."""
        piece = self._waiting.popleft()
        assert not isinstance(piece, End)
        if isinstance(piece, Arrived):
            self.waiting_bytes -= piece.block.readings.nbytes
        self._unsafe.append((frames, piece))

    def acknowledged(self, frames: int) -> Iterator[Piece]:
        """Hand out what is safe now that so many frames are on the device."""
        while self._unsafe and self._unsafe[0][0] <= frames:
            yield self._unsafe.popleft()[1]

    def write_again(self, safe_frames: int) -> list[Piece]:
        """Put back in front what was written after that frame: another file takes the place of the old."""
        again = [piece for frames, piece in self._unsafe if frames > safe_frames]
        self._unsafe.clear()
        self._waiting.extendleft(reversed(again))
        self.waiting_bytes += sum(p.block.readings.nbytes for p in again if isinstance(p, Arrived))
        return again

    def take_behind_the_end(self) -> list[Piece]:
        """Hand out what stands behind the end of the run, and belongs to no run; the run itself stays."""
        pieces = list(self._waiting)
        ends = [place for place, piece in enumerate(pieces) if isinstance(piece, End)]
        if not ends:
            return []
        behind = [piece for piece in pieces[ends[0] + 1 :] if not isinstance(piece, End)]
        self._waiting = deque(pieces[: ends[0] + 1])
        self.waiting_bytes -= sum(p.block.readings.nbytes for p in behind if isinstance(p, Arrived))
        return behind

    def clear(self) -> list[Piece]:
        """Forget the run; what stands behind its end is handed out."""
        behind = self.take_behind_the_end()
        self._waiting.clear()
        self._unsafe.clear()
        self.waiting_bytes = self.dropped_samples = 0
        return behind

    @property
    def end_waits(self) -> bool:
        """Whether the end of the run is in the queue."""
        return any(isinstance(piece, End) for piece in self._waiting)
