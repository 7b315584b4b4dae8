"""When samples are taken, and what the converters see then.

Nothing is stored: a sample is a function of its index, so a block may be read in any pieces, twice,
or late, and is the same. Samples are made in chunks, the next one ahead of need; when the world is
changed by a command, a fresh sampler takes over and what was made ahead is forgotten.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim_hardware.daqmx_server.channels.converter import Converter
from sim_hardware.daqmx_server.timing.open_inputs import noisy_sines
from sim_hardware.daqmx_server.timing.sample_times import SampleTimes


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

    @property
    def step(self) -> float:
        """One code of the converter, electrical quantity."""
        return self.converter.step


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
        taken_before: int = 0,
        chunk: int | None = None,
    ) -> None:
        """`helper` makes the next chunk while this one is read.

        NI's sine goes on from `taken_before` samples. `chunk`: samples made at a time; by default half a
        second of them.
        """
        self._taken_before = taken_before
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
        self._chunk = chunk or int(np.clip(times.rate_hz * 0.5, 1000, 65536))
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
                inputs = [self._inputs[row] for row in rows[open_rows]]
                numbers = self._taken_before + np.arange(start, start + taken)
                ideal[open_rows] = noisy_sines(inputs, rows[open_rows], numbers)
            volts[rows, :taken] = self._distortion.distort(terminals, times, ideal)
        np.subtract(volts, self._middle, out=volts)
        np.multiply(volts, self._scale, out=volts)
        np.rint(volts, out=volts)
        np.clip(volts, self._low, self._high, out=volts)
        return volts.astype(np.int32)
