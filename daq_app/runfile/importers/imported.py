"""A foreign recording as a run: readings in windows, gaps, events, and doubts about the values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from daq_app.config import Rig, Scaling
from daq_app.runfile.importers.mapping import MappedChannel
from daq_app.runfile.importers.recording import Findings, Spool
from daq_app.runfile.importers.timing import Timing
from daq_app.runfile.importers.unit_text import is_time
from daq_app.runfile.model import Event, Gap, RunHeader
from daq_app.runfile.plain_text import clean_text

_MAX_COMMENTS = 10_000


@dataclass(frozen=True, slots=True)
class ImportedRun:
    """Satisfies `RunSource`; its samples live in the spool."""

    header: RunHeader
    spool: Spool
    mapped: tuple[MappedChannel, ...]
    timing: Timing
    findings: Findings
    first_sample: int = 0

    @property
    def n_samples(self) -> int:
        return self.timing.n_samples

    @property
    def gaps(self) -> tuple[Gap, ...]:
        gaps = []
        end = 0
        for first, rows in self.timing.pieces:
            if first > end:
                gaps.append(Gap(end, first - end, "not in the imported file"))
            end = first + rows
        return tuple(gaps)

    @property
    def events(self) -> tuple[Event, ...]:
        """Comments of the file, and where single channels end early."""
        events = [
            Event("comment", self._sample_of_row(row), clean_text(text))
            for row, text in self.findings.comments[:_MAX_COMMENTS]
        ]
        for channel_id, rows in self._short():
            events.append(
                Event("short channel", self._sample_of_row(rows), f"{channel_id} ends here", {"rows": rows})
            )
        return tuple(sorted(events, key=lambda event: event.sample))

    def windows(self, size: int) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """Readings in windows of `size` samples, NaN in gaps and beyond the end of short channels."""
        starts = np.cumsum([0, *(rows for _, rows in self.timing.pieces)])
        for first in range(0, self.n_samples, size):
            end = min(first + size, self.n_samples)
            window = np.full((len(self.mapped), end - first), np.nan)
            for (sample, rows), row in zip(self.timing.pieces, starts, strict=False):
                low, high = max(first, sample), min(end, sample + rows)
                if low >= high:
                    continue
                at = int(row) + low - sample
                for index, item in enumerate(self.mapped):
                    values = self.spool.read(item.foreign.name, at, at + high - low)
                    window[index, low - first : high - first] = item.to_readings(values)
            yield first, window

    def with_origin(self, doubts: tuple[str, ...]) -> ImportedRun:
        """The same run whose header also tells the doubts."""
        origin = {**(self.header.origin or {}), "doubts": [clean_text(doubt) for doubt in doubts]}
        return replace(self, header=self.header.model_copy(update={"origin": origin}))

    def doubts(self, rig: Rig) -> list[str]:
        """What the values and units make doubtful; walks through all samples once."""
        doubts_in_words = []
        units = {item.foreign.unit for item in self.mapped if item.foreign.unit}
        if len(units) == 1 and len(self.mapped) > 1 and is_time(next(iter(units))):
            doubts_in_words.append(
                f"every unit in the file is {next(iter(units))!r}, which cannot be true: not believed"
            )
        for channel_id, rows in self._short():
            longest = max(self._lengths())
            doubts_in_words.append(
                f"{channel_id} has {rows} samples where others have {longest}: the rest is NaN"
            )
        if not self.findings.pieces:  # in a file of several pieces each announces its own number
            for item in self.mapped:
                declared, rows = item.foreign.n_declared, self.spool.length(item.foreign.name)
                if declared is not None and declared != rows:
                    doubts_in_words.append(
                        f"{item.channel.id}: the file announces {declared} samples and holds {rows}"
                    )
        if abs(self.header.rate_hz / rig.acquisition.rate_hz - 1) > 1e-6:
            doubts_in_words.append(
                f"the rate is {self.header.rate_hz:g} Hz and not the rig's {rig.acquisition.rate_hz:g} Hz"
            )
        return doubts_in_words + self._doubts_about_values()

    def _doubts_about_values(self) -> list[str]:
        doubts_in_words = []
        for item in self.mapped:
            low, high, absent, rows = np.inf, -np.inf, 0, 0
            for chunk in self.spool.chunks(item.foreign.name):
                bad = ~np.isfinite(chunk)
                absent += int(bad.sum())
                rows += chunk.size
                if not bad.all():
                    low, high = min(low, float(chunk[~bad].min())), max(high, float(chunk[~bad].max()))
            name = item.channel.id
            if absent:
                doubts_in_words.append(f"{name}: {absent} of {rows} values are missing or no numbers")
            if low == high and rows > 1:
                doubts_in_words.append(
                    f"{name} never changes: is the sensor connected, the column the right one?"
                )
            if low > high:
                continue
            ends = item.to_readings(np.array([low, high]))
            si = np.sort(Scaling.of([item.channel]).to_si(ends[None, :])[0])
            allowed = item.channel.range_si
            span = allowed[1] - allowed[0]
            if si[0] < allowed[0] - span or si[1] > allowed[1] + span:
                doubts_in_words.append(
                    f"{name} goes from {si[0]:.4g} to {si[1]:.4g} {item.channel.si_unit}, its sensor only "
                    f"from {allowed[0]:g} to {allowed[1]:g}: is {item.unit} the right unit?"
                )
        return doubts_in_words

    def _lengths(self) -> list[int]:
        return [self.spool.length(item.foreign.name) for item in self.mapped]

    def _short(self) -> list[tuple[str, int]]:
        lengths = self._lengths()
        longest = max(lengths)
        return [
            (item.channel.id, rows) for item, rows in zip(self.mapped, lengths, strict=True) if rows < longest
        ]

    def _sample_of_row(self, row: int) -> int:
        start = 0
        for first, rows in self.timing.pieces:
            if row < start + rows:
                return first + row - start
            start += rows
        return max(0, self.n_samples - 1)
