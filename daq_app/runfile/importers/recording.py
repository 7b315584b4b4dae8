"""A foreign recording: channels by name, and their samples on disk while they are converted."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from daq_app.runfile.errors import RunFileError

MAX_CHANNELS: Final = 512
"""More mapped channels than this are no rig."""


@dataclass(frozen=True, slots=True)
class ForeignChannel:
    """What a foreign file says of one channel. None of it is believed before it is checked."""

    name: str
    """Unique in its file; ``Group/Channel`` for TDMS."""
    unit: str = ""
    increment_s: float | None = None
    increment_rounding_s: float = 0.0
    """Half a unit in the last place that the increment was printed with."""
    start_utc_ns: int | None = None
    n_declared: int | None = None
    aliases: tuple[str, ...] = ()
    """Shorter names by which a rig may know it."""
    preferred: bool = True
    """False for decimated copies of other channels."""


@dataclass(slots=True)
class Findings:
    """What a reader noticed beside the samples."""

    doubts: list[str] = field(default_factory=list)
    """One sentence each: what the file says that cannot be true, or is missing."""
    comments: list[tuple[int, str]] = field(default_factory=list)
    """(row, text)."""
    pieces: list[tuple[int, int]] = field(default_factory=list)
    """(first sample, rows) where the file itself says that rows are not consecutive; empty: one piece."""


_CHECK_EVERY_BYTES: Final = 2**26
_KEPT_FREE_BYTES: Final = 2**29
"""Left free on the disk of the runs, where a test may be recorded at this moment."""


class Spool:
    """Samples of the chosen channels in unnamed files beside the output, which vanish with the process.

    A channel is appended to in any order and length, so that no reader needs more memory than its
    own chunks.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        if len(names) > MAX_CHANNELS:
            raise RunFileError(f"{len(names)} channels are more than any rig has")
        self._stack = contextlib.ExitStack()
        self._lengths = dict.fromkeys(names, 0)
        self._folder = folder
        self._unchecked = 0
        with self._stack:
            self._files = {
                name: self._stack.enter_context(
                    tempfile.TemporaryFile(dir=folder, prefix=".import-")  # noqa: SIM115  # the stack closes it
                )
                for name in names
            }
            self._stack = self._stack.pop_all()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._files)

    def length(self, name: str) -> int:
        return self._lengths[name]

    def append(self, name: str, values: NDArray[np.float64]) -> None:
        """Add samples to a channel."""
        self._require_room(8 * values.size)
        file = self._files[name]
        file.seek(8 * self._lengths[name])
        file.write(np.ascontiguousarray(values, dtype="<f8").data)
        self._lengths[name] += values.size

    def _require_room(self, n_bytes: int) -> None:
        """A file that unpacks to more than was foreseen must not fill the disk of a recorder."""
        self._unchecked += n_bytes
        if self._unchecked < _CHECK_EVERY_BYTES:
            return
        self._unchecked = 0
        if shutil.disk_usage(self._folder).free < _KEPT_FREE_BYTES:
            raise RunFileError(
                f"the recording unpacks to more than {self._folder} has room for",
                advice="Free space on this disk, or give another folder with --out.",
            )

    def read(self, name: str, start: int, stop: int) -> NDArray[np.float64]:
        """Samples [start, stop) of a channel; NaN beyond its end."""
        out = np.full(stop - start, np.nan)
        have = min(stop, self._lengths[name]) - start
        if have > 0:
            file = self._files[name]
            file.seek(8 * start)
            out[:have] = np.frombuffer(file.read(8 * have), dtype="<f8")
        return out

    def chunks(self, name: str, size: int = 2**18) -> Iterator[NDArray[np.float64]]:
        """A channel from beginning to end."""
        for start in range(0, self._lengths[name], size):
            yield self.read(name, start, min(start + size, self._lengths[name]))

    def close(self) -> None:
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Reader(Protocol):
    """An opened foreign file. `channels` come from its head; `copy` walks through its samples once."""

    @property
    def channels(self) -> tuple[ForeignChannel, ...]: ...
    @property
    def time_channel(self) -> str | None:
        """Name of the channel that holds the times of the rows, if the file has one."""
        ...

    @property
    def time_hint(self) -> str | None:
        """Name of a channel that is called like a time though the file does not mark it as such."""
        ...

    @property
    def findings(self) -> Findings: ...
    def copy(self, spool: Spool) -> None:
        """Append the samples of ``spool.names`` to the spool. Raises `RunFileError`."""
        ...

    def close(self) -> None: ...
