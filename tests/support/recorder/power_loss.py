"""The machine loses its power while a journal is written.

Each write and flush is logged and replayed as a sudden stop may leave it, with unflushed pages new, old or
never allocated at random.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile import JournalWriter, RunHeader, read_journal
from daq_app.runfile.journal import writer as journal

_PAGE: Final = 4096
_CHANNELS: Final = 8
_RATE_HZ: Final = 4000.0
_BLOCK: Final = 40
_READ: Final = 400
"""Samples between two flushes: the recorder flushes ten times a second."""


def truth(samples: NDArray[np.int64]) -> NDArray[np.float64]:
    """What every channel reads at these samples."""
    return samples[None, :] * 0.5 + np.arange(_CHANNELS)[:, None] * 1e6


class ModelDisk:
    """What the platter holds under a page cache: pages get there in any order until a flush.

    Stands between the journal and the system while it is entered.
    """

    def __init__(self) -> None:
        self.content = bytearray()
        self.flushed = b""

    def __enter__(self) -> Self:
        self._real = (os.write, journal.fsync_data)
        os.write, journal.fsync_data = self._write, self._flush  # type: ignore[assignment]
        return self

    def __exit__(self, *exc: object) -> None:
        os.write, journal.fsync_data = self._real  # type: ignore[assignment]

    def _write(self, fd: int, data: memoryview) -> int:
        written = self._real[0](fd, data)
        self.content += data[:written]
        return written

    def _flush(self, fd: int) -> None:
        self.flushed = bytes(self.content)

    def after_power_loss(self, rng: np.random.Generator) -> bytes:
        """What was flushed is there, of the rest each page is new, old or zeros, and the length is any."""
        length = int(rng.integers(len(self.flushed), len(self.content) + 1))
        image = bytearray(self.content[:length])
        for start in range(len(self.flushed) // _PAGE * _PAGE, length, _PAGE):
            if rng.random() < 0.5:
                old = self.flushed[start : start + _PAGE]
                image[start : start + _PAGE] = old + bytes(min(_PAGE, length - start) - len(old))
        return bytes(image)


@dataclass(frozen=True, slots=True)
class Trial:
    """One loss of power."""

    written: int
    acknowledged: int
    good: int
    """Samples that are read back, right."""
    wrong: int
    """Samples that are read back and are not what was written."""
    uncounted: int
    """Samples that are neither read back nor in the table of gaps, within the length of the run."""
    acknowledged_missing: int

    @property
    def lost_s(self) -> float:
        return (self.written - self.good) / _RATE_HZ

    @property
    def silent_damage(self) -> bool:
        return bool(self.wrong or self.uncounted or self.acknowledged_missing)


def one_trial(folder: Path, rng: np.random.Generator) -> Trial:
    """Write for a while, lose power at random, read what is left."""
    ids = tuple("abcdefgh")
    header = RunHeader(run_id="r", channel_ids=ids, reading_units=("V",) * len(ids), rate_hz=_RATE_HZ)
    path = folder / "run.tmp"
    with ModelDisk() as disk:
        writer = JournalWriter(path, header)
        first = 0
        for _ in range(int(rng.integers(1, 12))):
            for start in range(first, first + _READ, _BLOCK):
                writer.append_block(start, truth(np.arange(start, start + _BLOCK)))
            first += _READ
            writer.sync()
        acknowledged = writer.acknowledged_sample
        for start in range(first, first + int(rng.integers(0, _READ)), _BLOCK):
            writer.append_block(start, truth(np.arange(start, start + _BLOCK)))
        written = writer.next_sample or 0
        writer.abandon()
    path.unlink()
    image = folder / "run.journal"
    image.write_bytes(disk.after_power_loss(rng))
    return _read_back(image, written, acknowledged)


def _read_back(image: Path, written: int, acknowledged: int) -> Trial:
    good = wrong = missing = 0
    with read_journal(image) as contents:
        for at, window in contents.windows(1000):
            present = ~np.isnan(window)
            samples = np.arange(at, at + window.shape[1])
            right = present & (window == truth(samples))
            wrong += int((present & ~right).any(axis=0).sum())
            missing += int((~present[:, samples < acknowledged]).any(axis=0).sum())
            good += int(right.all(axis=0).sum())
        uncounted = contents.n_samples - good - contents.lost_samples
    return Trial(written, acknowledged, good, wrong, uncounted, missing)
