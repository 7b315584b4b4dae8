"""A recording with what was found about its instruments put right; the recording itself stays as it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.families.channels.hum import Hum
from daq_app.rocking.record import TestRecord, rows_of

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Corrections:
    """What is done to channels, by id."""

    factors: Mapping[str, float] = field(default_factory=dict)
    """Readings are multiplied by this."""
    earlier_s: Mapping[str, float] = field(default_factory=dict)
    """A late channel's samples show instants that lie this much earlier."""
    left_out: frozenset[str] = frozenset()

    def applied(self, record: TestRecord) -> TestRecord:
        """The record as these corrections see it."""
        if not (self.factors or self.earlier_s or self.left_out):
            return record

        def load(ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats:
            values = record.load(ids, start, stop)
            if not any(channel_id in self.factors for channel_id in ids):
                return values
            return np.asarray(values * np.array([[self.factors.get(channel_id, 1.0)] for channel_id in ids]))

        offsets = dict(record.time_offsets_s)
        for channel_id, earlier in self.earlier_s.items():
            offsets[channel_id] = offsets.get(channel_id, 0.0) - earlier
        kept = tuple(channel_id for channel_id in record.channel_ids if channel_id not in self.left_out)
        return replace(record, load=load, time_offsets_s=offsets, channel_ids=kept)


def held_in_memory(record: TestRecord, families: Sequence[tuple[str, ...]]) -> TestRecord:
    """The same record with the channels of some families read once, however often they are asked for.

    They come as views, which cannot be written to.
    """
    held = [(ids, record.load(ids)) for ids in families if ids]

    def load(ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats:
        for known, values in held:
            if set(ids) <= set(known):
                return rows_of(values, [known.index(channel_id) for channel_id in ids], start, stop)
        return record.load(ids, start, stop)

    return replace(record, load=load)


def without_hum(record: TestRecord, searched: tuple[str, ...], hum: Hum) -> TestRecord:
    """The record with a mains line taken out of its channels `searched`, the rows of `hum`."""
    rows = {channel_id: row for row, channel_id in enumerate(searched) if hum.amplitude[row]}

    def load(ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats:
        values = record.load(ids, start, stop).copy()
        first, last, _ = slice(start, stop).indices(record.n_samples)
        for place, channel_id in enumerate(ids):
            if channel_id in rows:
                values[place] -= hum.waves(rows[channel_id], first, last, record.rate_hz)
        return values

    return replace(record, load=load)
