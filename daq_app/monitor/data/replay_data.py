"""A run as the replay page needs it: any channel over any span, reduced to what a plot can show. No Qt.

Nothing but the motion is held in memory for the whole run, so an hour of holding is no trouble.
"""

from __future__ import annotations

import csv
import math
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from daq_app.campaign.recorded import facts_of
from daq_app.config.rig import Channel
from daq_app.config.shown_text import csv_cell
from daq_app.config.shown_units import shown_unit
from daq_app.rocking import RotationGeometry, VelocityFilter
from daq_app.runfile import Event, Gap, open_run
from daq_app.runfile.durable import written_whole

Array = NDArray[np.float64]

ROTATION: Final = "θ"
VELOCITY: Final = "dθ/dt"
_PART: Final = 200_000
"""Samples read at a time."""
_CACHED_SPANS: Final = 96


@dataclass(frozen=True, slots=True)
class Signal:
    """Something that can be drawn: a channel, or the motion computed from the wires."""

    name: str
    family: str
    """Sensor family, or ``motion``."""
    unit: str
    factor: float
    """SI to `unit`."""
    channel: Channel | None = None


@dataclass(frozen=True, slots=True)
class Envelope:
    """Extremes of a signal over columns of a span, in its shown unit; NaN where samples are missing."""

    time_s: Array
    """Centre of each column, seconds from the run's zero of time (release, else first sample)."""
    low: Array
    high: Array


class ReplayRun:
    """An opened run. Raises `RunFileError` on opening and reading; not for several threads at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._run = open_run(path)
        try:
            rig = self._run.rig
            self.header = self._run.header
            self.rig = rig
            self.rate_hz = self._run.rate_hz
            self.n_samples = self._run.n_samples
            self.first_sample = self._run.first_sample
            self.events: tuple[Event, ...] = tuple(self._run.events)
            self.gaps: tuple[Gap, ...] = tuple(self._run.gaps)
            self.facts = facts_of(self._run)
            self._motion: tuple[Array, Array] | None = self._compute_motion()
        except BaseException:
            self._run.close()
            raise
        released = [event.sample for event in self.events if event.kind == "released"]
        self.zero_sample = released[-1] if released else self.first_sample
        self.signals = self._list_signals()
        self._spans: OrderedDict[tuple[str, int, int, int], Envelope] = OrderedDict()

    def _list_signals(self) -> dict[str, Signal]:
        signals = {}
        if self._motion is not None:
            signals[ROTATION] = Signal(ROTATION, "motion", "mrad", 1e3)
            signals[VELOCITY] = Signal(VELOCITY, "motion", "rad/s", 1.0)
        for channel in self.rig.channels if self.rig is not None else ():
            if channel.id in self.header.channel_ids:
                unit, factor = shown_unit(channel.si_unit)
                signals[channel.id] = Signal(channel.id, channel.family, unit, factor, channel)
        return signals

    def _compute_motion(self) -> tuple[Array, Array] | None:
        """θ and dθ/dt of the whole run; None where the run has no wires to compute them from."""
        rig = self.rig
        if rig is None or self.n_samples == 0:
            return None
        try:
            geometry = RotationGeometry.from_rig(rig)
            smooth = VelocityFilter(self.rate_hz, rig.acquisition.velocity_cutoff_hz)
        except ValueError:
            return None
        if any(name not in self.header.channel_ids for name in geometry.wires.ids):
            return None
        rotation = np.empty(self.n_samples)
        part = _PART - _PART % geometry.frame_samples
        watch = geometry.watch()
        for start in range(0, self.n_samples, part):
            shortening = self._run.si(geometry.wires.ids, start, start + part)
            rotation[start : start + part] = geometry.rotation(shortening, watch).rotation_rad
        return rotation, smooth.velocity(rotation)

    # -- reading ---------------------------------------------------------------------------------

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last time of the run."""
        return self.time_of(0), self.time_of(self.n_samples - 1)

    def time_of(self, column: float) -> float:
        """Time of a column (0 is the run's first sample)."""
        return (self.first_sample + column - self.zero_sample) / self.rate_hz

    def column_of(self, time_s: float) -> int:
        """Column nearest to a time, within the run."""
        column = round(time_s * self.rate_hz) + self.zero_sample - self.first_sample
        return max(0, min(self.n_samples - 1, column))

    def values(self, name: str, start: int, stop: int) -> Array:
        """Columns start … stop of a signal in its shown unit."""
        signal = self.signals[name]
        if signal.channel is None:
            assert self._motion is not None
            return np.asarray(self._motion[0 if name == ROTATION else 1][start:stop] * signal.factor)
        return np.asarray(self._run.si([name], start, stop)[0] * signal.factor)

    def envelope(self, name: str, start_s: float, stop_s: float, columns: int) -> Envelope:
        """Extremes of a signal between two times in about `columns` columns, at least one sample each."""
        first, last = self.column_of(start_s), self.column_of(stop_s) + 1
        size = max(1, math.ceil((last - first) / max(1, columns)))
        key = (name, first, last, size)
        if key in self._spans:
            self._spans.move_to_end(key)
            return self._spans[key]
        low: list[Array] = []
        high: list[Array] = []
        step = max(size, _PART - _PART % size)
        for start in range(first, last, step):
            values = self.values(name, start, min(start + step, last))
            pad = -values.size % size
            groups = np.pad(values, (0, pad), mode="edge").reshape(-1, size)
            low.append(np.asarray(np.fmin.reduce(groups, axis=1), dtype=np.float64))
            high.append(np.asarray(np.fmax.reduce(groups, axis=1), dtype=np.float64))
        lows: Array = np.concatenate(low)
        highs: Array = np.concatenate(high)
        centre = first + (np.arange(lows.size) + 0.5) * size - 0.5
        time: Array = np.asarray((self.first_sample + centre - self.zero_sample) / self.rate_hz)
        envelope = Envelope(time, lows, highs)
        self._spans[key] = envelope
        while len(self._spans) > _CACHED_SPANS:
            self._spans.popitem(last=False)
        return envelope

    def value_at(self, name: str, time_s: float) -> float:
        """The sample nearest to a time, in the shown unit; NaN outside the run and in gaps."""
        start, stop = self.span_s
        if not start - 0.5 / self.rate_hz <= time_s <= stop + 0.5 / self.rate_hz:
            return math.nan
        column = self.column_of(time_s)
        return float(self.values(name, column, column + 1)[0])

    def write_csv(self, path: Path, names: list[str], start_s: float, stop_s: float) -> int:
        """Write every sample of some signals between two times; how many rows. Raises `OSError`.

        Columns: time from the run's zero, absolute sample, then the signals with their units.
        """
        first, last = self.column_of(start_s), self.column_of(stop_s) + 1
        with written_whole(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            signals = (csv_cell(f"{name} ({self.signals[name].unit})") for name in names)
            writer.writerow(["time_s", "sample", *signals])
            for start in range(first, last, _PART):
                stop = min(start + _PART, last)
                columns = [self.values(name, start, stop) for name in names]
                for row in range(stop - start):
                    sample = self.first_sample + start + row
                    time = f"{(sample - self.zero_sample) / self.rate_hz:.6f}"
                    writer.writerow([time, sample, *(f"{values[row]:.7g}" for values in columns)])
        return last - first

    def close(self) -> None:
        """Close the file; safe twice."""
        self._run.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
