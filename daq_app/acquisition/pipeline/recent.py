"""The last seconds of the stream in memory: a run may begin before the order to record came."""

from __future__ import annotations

from collections import deque
from typing import Final

from daq_app.acquisition.messages.items import Arrived, Lost, Noted

LIMIT_BYTES: Final = 128 * 2**20
"""96 s of 41 channels at 4000 Hz."""

Piece = Arrived | Lost | Noted


class Recent:
    """Blocks, gaps and events in order, the newest `keep_samples` samples of them."""

    def __init__(self, keep_samples: int) -> None:
        self._keep_samples = keep_samples
        self._pieces: deque[Piece] = deque()
        self._bytes = 0
        self._end = 0

    def add(self, piece: Piece) -> None:
        """Take in the newest piece; the oldest go."""
        self._pieces.append(piece)
        if isinstance(piece, Arrived):
            self._bytes += piece.block.readings.nbytes
            self._end = piece.block.first_sample + piece.block.n_samples
        while self._pieces and (self._bytes > LIMIT_BYTES or self._is_old(self._pieces[0])):
            oldest = self._pieces.popleft()
            if isinstance(oldest, Arrived):
                self._bytes -= oldest.block.readings.nbytes

    def _is_old(self, piece: Piece) -> bool:
        if isinstance(piece, Arrived):
            return piece.block.first_sample + piece.block.n_samples <= self._end - self._keep_samples
        at = piece.first_sample if isinstance(piece, Lost) else piece.event.sample
        return at < self._end - self._keep_samples

    def take(self, samples: int) -> list[Piece]:
        """The whole blocks of the last `samples` samples, with gaps and events; forgets everything."""
        start = self._end - samples
        pieces: list[Piece] = []
        for piece in self._pieces:
            if isinstance(piece, Arrived):
                if piece.block.first_sample + piece.block.n_samples > start:
                    pieces.append(piece)
            elif pieces and isinstance(piece, (Lost, Noted)):
                pieces.append(piece)
        self.clear()
        return pieces if samples > 0 else []

    def clear(self) -> None:
        """Forget everything: the stream begins anew, or a run has it."""
        self._pieces.clear()
        self._bytes = 0
