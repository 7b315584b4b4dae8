"""When samples are taken, and what the converters see then.

Nothing is stored: a sample is a function of its index, so a block may be read in any pieces, twice,
or late, and is the same. Samples are made in chunks, the next one ahead of need; when the world is
changed by a command, a fresh sampler takes over and what was made ahead is forgotten.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.channels.converter import Converter
from sim_hardware.faults.model import ClockChange

_SINE_SAMPLES: Final = 100


class SampleTimes:
    """Sample index ↔ simulated time: straight pieces between changes of the clock."""

    def __init__(self, first_s: float, rate_hz: float, changes: Sequence[ClockChange] = ()) -> None:
        self.first_s = first_s
        self.rate_hz = rate_hz
        self._changes = tuple(changes)
        edges = {first_s}
        for change in changes:
            edges.update(t for t in (change.start_s, change.end_s) if first_s < t < np.inf)
        times = np.array(sorted(edges))
        rates = np.full(len(times), rate_hz)
        for change in changes:
            inside = (times >= change.start_s) & (times < change.end_s)
            rates[inside] *= change.factor
        self._times = times
        self._rates = rates
        counts = np.concatenate(([0.0], np.cumsum(np.diff(times) * rates[:-1])))
        self._counts = counts
        self._moving = rates > 0

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Instant of each sample; inf where the clock has stopped for good."""
        if len(self._times) == 1 and self._moving[0]:
            return self.first_s + index / float(self._rates[0])
        piece = np.clip(np.searchsorted(self._counts, index, side="right") - 1, 0, None)
        rates = self._rates[piece]
        with np.errstate(divide="ignore", invalid="ignore"):
            out = self._times[piece] + np.where(rates > 0, (index - self._counts[piece]) / rates, np.inf)
        return np.where(index == self._counts[piece], self._times[piece], out)

    def later(self, delay_s: float) -> SampleTimes:
        """The same clock, each sample later by a delay."""
        return SampleTimes(self.first_s + delay_s, self.rate_hz, self._changes)

    def from_sample(self, index: int) -> SampleTimes:
        """The same clock, counted from a later sample."""
        return SampleTimes(self.time_of(index), self.rate_hz, self._changes)

    def time_of(self, index: int) -> float:
        return float(self.at(np.array([index]))[0])

    def count(self, now_s: float) -> int:
        """Samples taken up to and including `now_s`."""
        if now_s < self.first_s:
            return 0
        piece = int(np.searchsorted(self._times, now_s, side="right")) - 1
        position = self._counts[piece] + (now_s - self._times[piece]) * self._rates[piece]
        return int(np.floor(position + 1e-6)) + 1


@dataclass(frozen=True, slots=True)
class Input:
    """One converter input of a task."""

    terminal: str
    converter: Converter
    time_offset_s: float
    """Skew minus input delay: sample k shows the instant ``time of k + time_offset_s``."""
    hold_s: float = 0.0
    """A slow converter's own period: between its conversions it repeats the last one."""
    shown: tuple[float, float] = (-1.0, 1.0)
    """Ends of the sine that a simulated device shows where nothing is wired, electrical quantity."""


class Wiring(Protocol):
    """Whatever is wired to the terminals (`SignalSource.volts`)."""

    def volts(self, terminals: tuple[str, ...], times_s: NDArray[np.float64]) -> NDArray[np.float64]: ...


class Distortion(Protocol):
    """What a fault does to the volts at the terminals."""

    def distort(
        self, terminals: Sequence[str], times_s: NDArray[np.float64], volts: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Volts (len(terminals), len(times_s)) as the converters see them."""
        ...


class BlockSource(Protocol):
    """Samples of a task by index."""

    def codes(self, start: int, stop: int) -> NDArray[Any]:
        """Samples start … stop−1, shape (channels, samples)."""
        ...


class Sampler:
    """Codes of a task's inputs by sample index."""

    def __init__(
        self,
        source: Wiring,
        distortion: Distortion,
        inputs: Sequence[Input],
        times: SampleTimes,
        helper: Executor | None = None,
    ) -> None:
        """`helper` makes the next chunk while this one is read."""
        self._source = source
        self._helper = helper
        self._ahead: tuple[int, Future[NDArray[np.int32]]] | None = None
        self._distortion = distortion
        self._inputs = tuple(inputs)
        self.times = times
        groups: dict[tuple[float, float], list[int]] = {}
        for row, entry in enumerate(self._inputs):
            groups.setdefault((entry.time_offset_s, entry.hold_s), []).append(row)
        self._groups = [
            (offset, hold, np.array(rows), tuple(self._inputs[row].terminal for row in rows))
            for (offset, hold), rows in groups.items()
        ]
        steps = np.array([entry.converter.step for entry in self._inputs])
        middles = np.array([entry.converter.middle for entry in self._inputs])
        limits = np.array([entry.converter.code_limits for entry in self._inputs], dtype=float)
        self._scale = (1.0 / steps)[:, None]
        self._middle = middles[:, None]
        self._low, self._high = limits[:, :1], limits[:, 1:]
        self._chunk = int(np.clip(times.rate_hz * 0.5, 1000, 65536))
        self._cache: tuple[int, NDArray[np.int32]] | None = None

    def codes(self, start: int, stop: int) -> NDArray[np.int32]:
        """Codes of samples start … stop−1, shape (inputs, samples)."""
        pieces = []
        while start < stop:
            number = start // self._chunk
            chunk = self._chunk_codes(number)
            first = number * self._chunk
            end = min(stop, first + self._chunk)
            pieces.append(chunk[:, start - first : end - first])
            start = end
        if not pieces:
            return np.empty((len(self._inputs), 0), dtype=np.int32)
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=1)

    def _chunk_codes(self, number: int) -> NDArray[np.int32]:
        if self._cache is not None and self._cache[0] == number:
            return self._cache[1]
        if self._ahead is not None and self._ahead[0] == number:
            codes = self._ahead[1].result()
        else:
            codes = self._make(number)
        self._cache = (number, codes)
        if self._helper is not None:
            self._ahead = (number + 1, self._helper.submit(self._make, number + 1))
        return codes

    def _sines(self, inputs: Sequence[Input], start: int, count: int) -> NDArray[np.float64]:
        """NI's sine between the channel's minimum and maximum, one period in `_SINE_SAMPLES` samples.

        It keeps one code away from both ends, so that no rounded reading lies beyond them.
        """
        phase = 2.0 * np.pi * np.arange(start, start + count) / _SINE_SAMPLES
        ends = np.array([entry.shown for entry in inputs])
        steps = np.array([entry.converter.step for entry in inputs])
        middle, half = ends.mean(axis=1), np.maximum(0.5 * (ends[:, 1] - ends[:, 0]) - steps, 0.0)
        sines: NDArray[np.float64] = middle[:, None] + half[:, None] * np.sin(phase)
        return sines

    def _make(self, number: int) -> NDArray[np.int32]:
        start, stop = number * self._chunk, (number + 1) * self._chunk
        instants = self.times.at(np.arange(start, stop))
        taken = int(np.searchsorted(instants, np.inf))
        volts = np.zeros((len(self._inputs), stop - start))
        for offset, hold, rows, terminals in self._groups:
            times = instants[:taken] + offset
            if hold:
                times = np.floor(times / hold + 1e-9) * hold
            ideal = self._source.volts(terminals, times)
            open_rows = np.flatnonzero(np.isnan(ideal[:, :1]).any(axis=1))
            if len(open_rows):
                ideal[open_rows] = self._sines([self._inputs[rows[row]] for row in open_rows], start, taken)
            volts[rows, :taken] = self._distortion.distort(terminals, times, ideal)
        np.subtract(volts, self._middle, out=volts)
        np.multiply(volts, self._scale, out=volts)
        np.rint(volts, out=volts)
        np.clip(volts, self._low, self._high, out=volts)
        return volts.astype(np.int32)
