"""Where the samples of a run file come from: a journal, or a foreign recording that is imported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from daq_app.config import Channel, ConfigError, Rig, Scaling, parse_rig
from daq_app.runfile.model import Event, Gap, RunHeader

_MAX_RIG_CHARACTERS: Final = 2**22


class RunSource(Protocol):
    """A whole run that can be walked through more than once, always with the same samples."""

    @property
    def header(self) -> RunHeader: ...
    @property
    def first_sample(self) -> int: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def events(self) -> tuple[Event, ...]: ...
    @property
    def gaps(self) -> tuple[Gap, ...]: ...
    def windows(self, size: int) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Readings in windows of `size` samples (the last may be shorter), NaN where missing."""
        ...


@dataclass(frozen=True, slots=True)
class Provenance:
    """What is known about the source beside its samples; kept in the run file."""

    closed: bool
    """The recorder closed the run in good order."""
    damage: tuple[str, ...] = ()
    source_name: str = ""
    source_bytes: int = 0


@dataclass(frozen=True, slots=True)
class RunScaling:
    """How the channels of a run become SI; channels that the rig does not know have no entry."""

    channels: Mapping[str, Channel]
    rows: tuple[int, ...]
    """Rows (of the header's channels) that have a scaling."""
    scaling: Scaling

    @classmethod
    def of(cls, header: RunHeader, rig: Rig | None) -> RunScaling:
        known = {channel.id: channel for channel in rig.channels} if rig else {}
        rows = tuple(row for row, channel_id in enumerate(header.channel_ids) if channel_id in known)
        channels = [known[header.channel_ids[row]] for row in rows]
        return cls({c.id: c for c in channels}, rows, Scaling.of(channels, header.tare))

    def to_si(
        self, window: NDArray[np.float64], out: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """(n_channels, m) readings to (len(rows), m) SI, into `out` if given."""
        known = window if len(self.rows) == len(window) else window[list(self.rows)]
        return self.scaling.to_si(known, out)

    def stored_si(self, window: NDArray[np.float64]) -> NDArray[np.float32]:
        """Engineering units as the run file keeps them: SI in single precision."""
        with np.errstate(over="ignore"):  # what single precision cannot hold becomes infinite
            return self.to_si(window).astype("<f4")


def rig_of(header: RunHeader) -> Rig | None:
    """The rig a run was made with; None where its text is absent or of a version not understood.

    A run is never refused for its rig: the readings stand without it.
    """
    if not header.rig_text or sum(map(len, (header.rig_text, *header.product_texts))) > _MAX_RIG_CHARACTERS:
        return None
    return _parsed(header.rig_text, header.product_texts)


@lru_cache(maxsize=8)
def _parsed(rig_text: str, product_texts: tuple[str, ...]) -> Rig | None:
    """The runs of a campaign share one or two rig texts: each is read and checked once."""
    try:
        return parse_rig(rig_text, "rig text of the run", product_texts)
    except ConfigError:
        return None
