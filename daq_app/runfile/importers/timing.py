"""When the samples of a foreign recording were taken, as far as the file can be believed."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.mapping import MappedChannel
from daq_app.runfile.importers.recording import Reader, Spool
from daq_app.runfile.importers.time_axis import time_axis
from daq_app.runfile.model import LATEST_NS, MAX_GAP_SAMPLES

_SAME: Final = 1e-6
"""Relative difference up to which two increments are the same number, written differently."""
_ROUGH: Final = 1e-3
_FEW_DIGITS: Final = 1e-5
"""An increment rounded more coarsely than that is doubted: a rate is good to 50 ppm."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Rate, stretches of rows, start, and what is doubtful about them."""

    rate_hz: float
    pieces: tuple[tuple[int, int], ...]
    """(first sample, rows): a run's sample index for each stretch of rows of the file."""
    start_utc_ns: int
    doubts: tuple[str, ...]

    @property
    def n_samples(self) -> int:
        return self.pieces[-1][0] + self.pieces[-1][1]


def timing_of(
    path: Path,
    reader: Reader,
    spool: Spool,
    mapped: tuple[MappedChannel, ...],
    source: SourceMap,
    time_name: str | None,
) -> Timing:
    """Decide on rate and gaps. The map wins over a column of times, that over increments in the head.

    Raises `RunFileError` if nothing gives a rate, or if what is given cannot be true.
    """
    doubts: list[str] = []
    n_rows = max(spool.length(item.foreign.name) for item in mapped)
    if n_rows == 0:
        raise RunFileError(f"{path} holds no samples of these channels")
    pieces = tuple(reader.findings.pieces) or ((0, n_rows),)
    rate_hz = _stated_rate(path, mapped, source, time_name, reader.time_hint, doubts)
    if source.rate_hz is None and time_name:
        rate_hz, pieces = _from_column(path, spool, time_name, rate_hz, n_rows, doubts)
    elif rate_hz is not None:
        _doubt_column(spool, time_name or reader.time_hint, rate_hz, doubts)
    if rate_hz is None:
        raise RunFileError(
            f"{path} does not say how fast it was sampled", advice="Give rate_hz under [source] in the map."
        )
    if not 0 < rate_hz <= 1e7:
        raise RunFileError(
            f"{path}: a rate of {rate_hz:g} Hz cannot be true", advice="Give rate_hz in the map."
        )
    if sum(later[0] - sum(sooner) for sooner, later in itertools.pairwise(pieces)) > MAX_GAP_SAMPLES:
        raise RunFileError(f"{path} has gaps of many hours: import its parts one by one")
    return Timing(rate_hz, pieces, _start(mapped, source, doubts), tuple(doubts))


def _from_column(
    path: Path, spool: Spool, name: str, stated: float | None, n_rows: int, doubts: list[str]
) -> tuple[float, tuple[tuple[int, int], ...]]:
    """Rate and pieces from the column of times."""
    try:
        axis = time_axis(spool, name)
    except RunFileError as error:
        raise RunFileError(f"{path}: {error.message}", advice=error.advice) from error
    rate_hz = _clean(1.0 / axis.interval_s)
    if stated is not None and abs(stated / rate_hz - 1) < _ROUGH:
        rate_hz = stated  # the column of times only prints fewer digits
    elif stated is not None:
        doubts.append(
            f"the head of the file says {stated:g} Hz and its column {name!r} {rate_hz:g} Hz: "
            "the column was believed"
        )
    pieces = list(axis.pieces)
    rows = spool.length(name)
    while rows > n_rows:  # times that no channel has samples for
        first, length = pieces.pop()
        rows -= length
        if rows < n_rows:
            pieces.append((first, n_rows - rows))
            rows = n_rows
    if rows < n_rows:
        doubts.append(f"the last {n_rows - rows} rows have no time; they were taken to follow on")
        pieces[-1] = (pieces[-1][0], pieces[-1][1] + n_rows - rows)
    return rate_hz, tuple(pieces)


def _doubt_column(spool: Spool, name: str | None, rate_hz: float, doubts: list[str]) -> None:
    """Compare a column of times that does not decide with the rate that does."""
    if name is None or spool.length(name) < 2:
        return
    try:
        column_hz = 1.0 / time_axis(spool, name).interval_s
    except RunFileError as error:
        doubts.append(f"{error.message}; {rate_hz:g} Hz was used all the same")
        return
    if abs(column_hz / rate_hz - 1) > _ROUGH:
        doubts.append(
            f"a column {name!r} says {column_hz:g} Hz, but {rate_hz:g} Hz was used; settle it in the map "
            "(time_column or rate_hz)"
        )


def _clean(rate_hz: float) -> float:
    """Without the last digits that 1 / increment leaves: 50000, not 50000.00000000001."""
    return float(f"{rate_hz:.12g}")


def _stated_rate(
    path: Path,
    mapped: tuple[MappedChannel, ...],
    source: SourceMap,
    time_name: str | None,
    time_hint: str | None,
    doubts: list[str],
) -> float | None:
    """The rate of the map, or of the increments in the file's head if they agree."""
    increments = [item.foreign.increment_s for item in mapped]
    known = sorted({value for value in increments if value is not None})
    if any(value <= 0 for value in known):
        raise RunFileError(
            f"{path}: an increment of {known[0]} s cannot be true", advice="Give rate_hz in the map."
        )
    disagree = bool(known) and known[-1] / known[0] - 1 > _SAME
    listing = ", ".join(f"{value:g}" for value in known[:6])
    if source.rate_hz is not None:
        off = [value for value in known if abs(value * source.rate_hz - 1) > _ROUGH]
        if off:
            doubts.append(
                f"the file gives increments of {listing} s; the map's {source.rate_hz:g} Hz was believed"
            )
        return source.rate_hz
    if disagree and time_name is None:
        column = f", or time_column = {time_hint!r}, which the file has" if time_hint else ""
        raise RunFileError(
            f"{path}: the channels disagree about the time between samples ({listing} s); "
            "a run has one rate for all",
            advice="Map only channels that agree, or give the true rate_hz under [source] in the map"
            + column,
        )
    if disagree:
        doubts.append(f"the channels disagree about the time between samples ({listing} s)")
    if disagree or not known:
        return None
    rounding = max(item.foreign.increment_rounding_s for item in mapped)
    if time_name is None and rounding > _FEW_DIGITS * known[0]:
        low, high = 1.0 / (known[0] + rounding), 1.0 / (known[0] - rounding)
        doubts.append(
            f"the time between samples is printed as {known[0]:g} s: the rate may be anything from "
            f"{low:.2f} to {high:.2f} Hz; give rate_hz in the map if you know it"
        )
    return _clean(1.0 / known[0])


def _start(mapped: tuple[MappedChannel, ...], source: SourceMap, doubts: list[str]) -> int:
    if source.start_utc is not None:
        return _possible(int(source.start_utc.timestamp() * 1_000_000) * 1000, doubts)
    starts = {item.foreign.start_utc_ns for item in mapped if item.foreign.start_utc_ns is not None}
    if not starts:
        doubts.append("the file does not say when it was recorded")
        return 0
    if max(starts) != min(starts):
        late = (max(starts) - min(starts)) / 1e9
        doubts.append(f"channels start up to {late:g} s apart according to the file; they were taken as one")
    return _possible(min(starts), doubts)


def _possible(start_utc_ns: int, doubts: list[str]) -> int:
    if 0 <= start_utc_ns <= LATEST_NS:
        return start_utc_ns
    doubts.append("the time of recording lies before 1970 or after 2262: it was not believed")
    return 0
