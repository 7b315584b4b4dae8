"""A recorded test as the analysis sees it: SI values on demand, known time offsets, the rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from daq_app.config.rig import Family, Rig
from daq_app.config.scaling import Scaling

Floats = NDArray[np.float64]


_LONGEST_S: Final = 240.0
"""Longest part of a recording that is analysed, s. Assumed; a wall rocks for 3 to 10 s. One second of 41
channels at 4000 Hz takes 6 MB of memory: raising it lets a wall that stood armed for long fill it."""
_BEFORE_RELEASE_S: Final = 120.0
"""Length before the release that is analysed of a long recording, s: noise, zero and hold are read from it
(assumed)."""
_RELEASE_EVENTS: Final = frozenset({"released", "rocking"})


class HeaderLike(Protocol):
    """What the analysis needs of a run's header."""

    @property
    def run_id(self) -> str: ...
    @property
    def test(self) -> str: ...
    @property
    def tare(self) -> Mapping[str, float]: ...
    def time_offset_s(self, channel_id: str) -> float: ...


class EventLike(Protocol):
    """What the analysis needs of an event."""

    @property
    def kind(self) -> str: ...
    @property
    def sample(self) -> int: ...


class RunSpan(Protocol):
    """Which samples a run has, and what happened in them."""

    @property
    def first_sample(self) -> int: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def events(self) -> Sequence[EventLike]: ...


class RunLike(RunSpan, Protocol):
    """What the analysis needs of an opened run."""

    @property
    def header(self) -> HeaderLike: ...
    @property
    def rate_hz(self) -> float: ...
    @property
    def channel_ids(self) -> tuple[str, ...]: ...
    def si(self, ids: Sequence[str] | None = None, start: int = 0, stop: int | None = None) -> Floats:
        """Values (channels, stop − start), SI, NaN in gaps; all channels and samples if not given."""
        ...


class Load(Protocol):
    """SI values (len(ids), stop − start) of channels, NaN in gaps; the columns count from 0."""

    def __call__(self, ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats: ...


@dataclass(frozen=True)
class TestRecord:
    """One recording: everything from arming to the end, rows by channel id."""

    __test__ = False  # not a test class, whatever its name begins with

    rig: Rig
    rate_hz: float
    n_samples: int
    channel_ids: tuple[str, ...]
    """Channels that the recording has; a channel of the rig may be missing."""
    load: Load
    """Reads channels, whole or in part."""
    first_sample: int = 0
    time_offsets_s: Mapping[str, float] = field(default_factory=dict)
    """Sample k of a channel shows the instant k / rate + this; 0 where not listed."""
    tared: bool = True
    """Whether zeros were taken with the wall upright before the test."""
    label: str = ""
    zeros_si: Mapping[str, float] = field(default_factory=dict)
    """What that zero took off each channel, SI: ranges hold for values with it. 0 where not listed."""
    part_of: int | None = None
    """Number of samples of the recording of which this is only a part; None where it is all of it."""

    @classmethod
    def from_array(
        cls,
        rig: Rig,
        rate_hz: float,
        si: Floats,
        *,
        channel_ids: Sequence[str] | None = None,
        first_sample: int = 0,
        time_offsets_s: Mapping[str, float] | None = None,
        tared: bool = True,
        label: str = "",
    ) -> TestRecord:
        """A record in memory: `si` (n_channels, n) in the order of `channel_ids` (the rig's if not given).

        Neighbours are loaded as views, which cannot be written to.
        """
        known = tuple(channel_ids) if channel_ids is not None else rig.channel_ids
        if si.ndim != 2 or si.shape[0] != len(known):
            raise ValueError(
                f"{len(known)} channels need an array with as many rows, not of shape {si.shape}"
            )
        row = {channel_id: index for index, channel_id in enumerate(known)}

        def load(ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats:
            return rows_of(si, [row[channel_id] for channel_id in ids], start, stop)

        return cls(
            rig, rate_hz, si.shape[1], known, load, first_sample, dict(time_offsets_s or {}), tared, label
        )

    @classmethod
    def from_run(cls, run: RunLike, rig: Rig) -> TestRecord:
        """A record on the `analysed_part` of an opened run, which must stay open while it is analysed."""
        begin, end = analysed_part(run, run.rate_hz)

        def load(ids: tuple[str, ...], start: int = 0, stop: int | None = None) -> Floats:
            first, last, _ = slice(start, stop).indices(end - begin)
            return run.si(ids, begin + first, begin + max(first, last))

        return cls(
            rig=rig,
            rate_hz=run.rate_hz,
            n_samples=end - begin,
            channel_ids=run.channel_ids,
            load=load,
            first_sample=run.first_sample + begin,
            time_offsets_s={cid: run.header.time_offset_s(cid) for cid in run.channel_ids},
            tared=bool(run.header.tare),
            label=run.header.test or run.header.run_id,
            zeros_si=tare_si(rig, run.header.tare),
            part_of=None if end - begin == run.n_samples else run.n_samples,
        )

    def family(self, family: Family, axis: str | None = None) -> tuple[str, ...]:
        """Ids of the recorded channels of a family (and sensitive axis), rig order."""
        recorded = set(self.channel_ids)
        return tuple(
            channel.id
            for channel in self.rig.of_family(family)
            if channel.id in recorded and (axis is None or channel.axis == axis)
        )

    def offset_s(self, channel_id: str) -> float:
        return self.time_offsets_s.get(channel_id, 0.0)

    def time_s(self, offset_s: float = 0.0) -> Floats:
        """(n,) absolute sample index / rate, plus an offset."""
        return np.asarray((self.first_sample + np.arange(self.n_samples)) / self.rate_hz + offset_s)


def rows_of(values: Floats, rows: Sequence[int], start: int = 0, stop: int | None = None) -> Floats:
    """Columns start … stop of rows; neighbours, which most are, as a view that cannot be written to."""
    if not rows or list(rows) != list(range(rows[0], rows[0] + len(rows))):
        return values[list(rows), start:stop]
    view = values[rows[0] : rows[0] + len(rows), start:stop]
    view.flags.writeable = False
    return view


def analysed_part(run: RunSpan, rate_hz: float) -> tuple[int, int]:
    """First sample and end (from the run's first sample on) of what is analysed: all of a usual run.

    A wall may stand armed for half an hour; its readings are kept whole, but the analysis would need
    gigabytes of memory for them. So a long run is analysed from two minutes before its release on, or, where
    nothing was released, at its end.
    """
    longest = round(_LONGEST_S * rate_hz)
    if run.n_samples <= longest:
        return 0, run.n_samples
    released = [event.sample for event in run.events if event.kind in _RELEASE_EVENTS]
    if not released:
        return run.n_samples - longest, run.n_samples
    before = round(_BEFORE_RELEASE_S * rate_hz)
    start = min(max(0, released[-1] - run.first_sample - before), run.n_samples - longest)
    return start, start + longest


def tare_si(rig: Rig, tare: Mapping[str, float]) -> dict[str, float]:
    """A tare (unit of the readings, by channel id) in SI, for `TestRecord.zeros_si`."""
    channels = [channel for channel in rig.channels if channel.id in tare]
    gains = Scaling.of(channels).gain[:, 0]
    return {c.id: tare[c.id] * float(gain) for c, gain in zip(channels, gains, strict=True)}
