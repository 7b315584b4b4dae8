"""From a column of times to a rate and gaps, or to the reason why it is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.recording import Spool

_JITTER: Final = 0.15
"""A time may lie this fraction of an interval off its place (times are printed with few digits)."""
_MAX_GAPS: Final = 10_000


@dataclass(frozen=True, slots=True)
class TimeAxis:
    """Equally spaced times, with pieces missing perhaps."""

    interval_s: float
    pieces: tuple[tuple[int, int], ...]
    """(first sample, rows) of each consecutive stretch of rows."""


def time_axis(spool: Spool, name: str) -> TimeAxis:
    """Check a column of times in seconds. Raises `RunFileError` if it is no recording at a fixed rate.

    Rows whose distance is a whole multiple of the usual interval are a gap; times that go back or lie
    anywhere in between are refused.
    """
    n_rows = spool.length(name)
    if n_rows < 2:
        raise RunFileError(f"column {name!r} has {n_rows} times: no rate can be told")
    usual = _usual_interval(spool, name)
    jumps: list[tuple[int, int]] = []  # (row, missing samples before it)
    last = first = None
    row = 0
    for chunk in spool.chunks(name):
        if not np.isfinite(chunk).all():
            bad = row + int(np.argmin(np.isfinite(chunk)))
            raise RunFileError(f"column {name!r} has no time in row {bad + 1}")
        if first is None:
            first = float(chunk[0])
        joined = chunk if last is None else np.concatenate([[last], chunk])
        steps = np.diff(joined)
        if (steps <= 0).any():
            bad = row + int(np.argmax(steps <= 0)) + (1 if last is None else 0)
            raise RunFileError(f"times in column {name!r} do not increase at row {bad + 1}")
        for index in np.flatnonzero(steps > 1.5 * usual):
            jumps.append((row + int(index) + (1 if last is None else 0), round(steps[index] / usual) - 1))
            if len(jumps) > _MAX_GAPS:
                raise RunFileError(f"times in column {name!r} are not equally spaced")
        last = float(chunk[-1])
        row += chunk.size
    assert first is not None and last is not None
    total = n_rows - 1 + sum(missing for _, missing in jumps)
    interval = (last - first) / total
    pieces = _pieces(n_rows, jumps)
    _check_places(spool, name, first, interval, pieces)
    return TimeAxis(interval, pieces)


def _usual_interval(spool: Spool, name: str) -> float:
    """Mean of the ordinary steps: the median alone would keep the rounding of printed times."""
    steps = np.diff(spool.read(name, 0, min(spool.length(name), 100_000)))
    steps = steps[np.isfinite(steps) & (steps > 0)]
    if steps.size == 0:
        raise RunFileError(f"times in column {name!r} do not increase")
    median = float(np.median(steps))
    ordinary = steps[np.abs(steps - median) <= 0.5 * median]
    return float(np.mean(ordinary)) if ordinary.size else median


def _pieces(n_rows: int, jumps: list[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    pieces = []
    start_row, shift = 0, 0
    for row, missing in jumps:
        pieces.append((start_row + shift, row - start_row))
        start_row, shift = row, shift + missing
    pieces.append((start_row + shift, n_rows - start_row))
    return tuple(pieces)


def _check_places(
    spool: Spool, name: str, first: float, interval: float, pieces: tuple[tuple[int, int], ...]
) -> None:
    row = 0
    for sample, rows in pieces:
        for start in range(0, rows, 2**18):
            stop = min(start + 2**18, rows)
            times = spool.read(name, row + start, row + stop)
            off = np.abs(times - first - interval * np.arange(sample + start, sample + stop))
            if float(off.max()) > _JITTER * interval:
                worst = row + start + int(off.argmax())
                raise RunFileError(
                    f"times in column {name!r} are not equally spaced: row {worst + 1} is "
                    f"{off.max() / interval:.1f} intervals off its place",
                    advice="A run has one fixed rate: resample the file, or give rate_hz.",
                )
        row += rows
