"""Compressed HDF5 chunks made on all cores.

The HDF5 library compresses one chunk at a time. Here the chunks of all channels are shuffled and
deflated in threads (zlib lets go of the interpreter) and handed to the library ready-made; a reader
sees the ordinary filters shuffle, deflate, fletcher32 and needs nothing of ours.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

COMPRESSION_LEVEL: Final = 1
"""Readings are quantised noise: level 4 gains a few percent of size for twice the time."""
_MAX_CHUNK_SAMPLES: Final = 16384
_WINDOW_BYTES: Final = 2**23


def chunk_samples(n_channels: int, n_samples: int) -> int:
    """Samples per chunk: all channels of a window stay within a few megabytes."""
    by_memory = max(256, _WINDOW_BYTES // (8 * n_channels))
    return max(1, min(_MAX_CHUNK_SAMPLES, by_memory, n_samples))


def create_chunked(group: h5py.Group, name: str, n_samples: int, chunk: int, dtype: str) -> h5py.Dataset:
    """An empty one-dimensional dataset with the filters shuffle, deflate, fletcher32 in this order.

    Float datasets are filled with NaN where nothing is written.
    """
    filters = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    filters.set_chunk((chunk,))
    filters.set_shuffle()
    filters.set_deflate(COMPRESSION_LEVEL)
    filters.set_fletcher32()
    filters.set_fill_value(np.array(np.nan, dtype=dtype))
    filters.set_obj_track_times(False)
    space = h5py.h5s.create_simple((n_samples,))
    kind = h5py.h5t.py_create(np.dtype(dtype))
    return h5py.Dataset(h5py.h5d.create(group.id, name.encode(), kind, space, filters))


def fletcher32(data: bytes) -> int:
    """The checksum of HDF5's fletcher32 filter (16-bit big-endian words, sums modulo 65535).

    Source: HDF5 file format, "Fletcher32" filter; an odd last byte is the high byte of a word.
    """
    padded = data if len(data) % 2 == 0 else data + b"\0"
    words = np.frombuffer(padded, dtype=">u2").astype(np.int64)
    weights = np.arange(words.size, 0, -1, dtype=np.int64)
    low = _ones_complement(int(words.sum()))
    high = _ones_complement(int(words @ weights))
    return (high << 16) | low


def _ones_complement(total: int) -> int:
    """Sum folded to 16 bits the way the filter does: zero only if every word was zero."""
    return 0 if total == 0 else (total - 1) % 65535 + 1


def encode_chunk(values: NDArray[Any], chunk: int) -> bytes:
    """One chunk through shuffle, deflate, fletcher32; short values are padded with zeros."""
    if values.size < chunk:
        values = np.concatenate([values, np.zeros(chunk - values.size, dtype=values.dtype)])
    octets = np.ascontiguousarray(values).view(np.uint8).reshape(chunk, values.dtype.itemsize)
    packed = zlib.compress(np.ascontiguousarray(octets.T).data, COMPRESSION_LEVEL)
    return packed + fletcher32(packed).to_bytes(4, "little")


_Job = tuple[tuple[h5py.Dataset, ...], int, "Future[bytes]"]


class ChunkWriter:
    """Writes chunks that worker threads compress. All calls from one thread."""

    def __init__(self, pool: ThreadPoolExecutor, check: Callable[[], None]) -> None:
        self._pool = pool
        self._check = check
        self._waiting: list[_Job] = []
        self._previous: list[_Job] = []

    def put(self, *datasets: h5py.Dataset, start: int, values: NDArray[Any]) -> None:
        """Queue the chunk that starts at element `start`, the same for all `datasets`."""
        job = self._pool.submit(encode_chunk, values, datasets[0].chunks[0])
        self._waiting.append((datasets, start, job))

    def end_window(self) -> None:
        """Write the window before this one: the workers compress one while the next is prepared.

        Called once per window, it bounds the memory to two of them.
        """
        for datasets, start, job in self._previous:
            for dataset in datasets:
                dataset.id.write_direct_chunk((start,), job.result())
        self._previous, self._waiting = self._waiting, []
        self._check()

    def flush(self) -> None:
        """Wait for everything and write it."""
        self.end_window()
        self.end_window()


@contextmanager
def chunk_writer(check: Callable[[], None]) -> Iterator[ChunkWriter]:
    """A `ChunkWriter` with one thread per core (at most eight); `check` is called after each window."""
    with ThreadPoolExecutor(min(8, os.cpu_count() or 1), thread_name_prefix="compress") as pool:
        yield ChunkWriter(pool, check)
