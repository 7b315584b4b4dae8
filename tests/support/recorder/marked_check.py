"""Shows of every sample of a run on a marked line (`sim_hardware.marked_line`) that it is the right one."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from daq_app.config import Rig
from daq_app.runfile import Run, open_run
from sim_hardware.marked_line import PERIOD_SAMPLES, MarkedLine

_WINDOW: Final = 40_000
_PIECE: Final = 4_000
_MOST_LEAPS: Final = 3
"""In a second."""
_STEPS: Final = 1.5
"""A reading may differ from its mark by so many steps of a 16-bit converter."""
_KNOWN_TO: Final = re.compile(r"known to ([\d.]+) ms")
_SLACK: Final = 4
_EXPLAINED_WITHIN: Final = 8_000
"""Samples between a leap of the marks and the gap or the event that says why."""

Floats = NDArray[np.float64]


@dataclass(slots=True)
class Leap:
    """From `sample` on the marks stand `by` samples further than the sample numbers say."""

    sample: int
    by: int
    explained: bool = False


@dataclass(slots=True)
class MarkedReport:
    """What was found in one run."""

    n_samples: int = 0
    missing: int = 0
    """In the table of gaps."""
    unexplained: int = 0
    """Samples that are no gap and not what was at the terminals at their time."""
    leaps: list[Leap] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        return self.unexplained == 0 and all(leap.explained for leap in self.leaps)


class _Walk:
    """Goes through the run in order, with the lag of the marks found so far."""

    def __init__(self, rig: Rig, report: MarkedReport, lag: int | None) -> None:
        marks = MarkedLine(rig)
        ticks = np.arange(PERIOD_SAMPLES)
        self._marks = np.stack([marks.reading(row, ticks) for row in range(len(rig.channels))])
        self._sharp = [row for row, channel in enumerate(rig.channels) if channel.family == "lvdt"]
        low, high = np.array([channel.input_range_v for channel in rig.channels]).T
        self._allowed = (_STEPS * (high - low) / 2**16)[:, None]
        self._report = report
        self._lag = lag

    def piece(self, first: int, readings: Floats) -> None:
        """Judge a piece without a gap."""
        for _ in range(_MOST_LEAPS):
            wrong = self._wrong(first, readings)
            if not wrong.any():
                return
            at = int(np.argmax(wrong))
            lag = self._find_lag(first + at, readings[:, at])
            if lag is None:
                break
            if self._lag is not None:
                self._report.leaps.append(Leap(first + at, lag - self._lag))
            self._lag = lag
            first, readings = first + at, readings[:, at:]
        self._report.unexplained += int(np.count_nonzero(self._wrong(first, readings)))

    def _wrong(self, first: int, readings: Floats) -> NDArray[np.bool_]:
        if self._lag is None:
            return np.ones(readings.shape[1], dtype=np.bool_)
        samples = first + self._lag + np.arange(readings.shape[1])
        wrong = np.abs(readings - self._marks[:, samples % PERIOD_SAMPLES]) > self._allowed
        at = np.flatnonzero(wrong.any(axis=0))
        if at.size:
            # Tasks that were started again sample between two marks: some channels see the next one already.
            next_marks = self._marks[:, (samples[at] + 1) % PERIOD_SAMPLES]
            wrong[:, at] &= np.abs(readings[:, at] - next_marks) > self._allowed
        return np.asarray(wrong.any(axis=0), dtype=np.bool_)

    def _find_lag(self, sample: int, values: Floats) -> int | None:
        lags = np.arange(-PERIOD_SAMPLES // 2, PERIOD_SAMPLES // 2)
        worst = np.zeros(lags.size)
        for row in self._sharp:
            off = np.abs(self._marks[row, (sample + lags) % PERIOD_SAMPLES] - values[row])
            worst = np.maximum(worst, np.minimum(off, np.roll(off, -1)) / self._allowed[row])
        good = lags[worst <= 1.0]
        if not good.size:
            return None
        # The lag that fits this sample and is closest to the lag before: time does not leap by itself.
        previous = self._lag or 0
        distance = (good - previous + PERIOD_SAMPLES // 2) % PERIOD_SAMPLES - PERIOD_SAMPLES // 2
        return previous + int(distance[np.argmin(np.abs(distance))])


def check_marked(
    path: Path, rig: Rig, lag: int | None = 0, speed: float = 1.0, *, clock_ppm: float = 0.0
) -> MarkedReport:
    """Walk through a run. `lag` is where its marks stand at its first sample; None: found from there.

    `speed` is how much faster than real time the device ran; `clock_ppm` how much faster than it said: its
    marks slip by one each time that this has come to a sample, and no more often.
    """
    report = MarkedReport()
    with open_run(path) as run:
        report.n_samples = run.n_samples
        report.missing = sum(gap.n_samples for gap in run.gaps)
        walk = _Walk(rig, report, lag)
        for start in range(0, run.n_samples, _WINDOW):
            readings = run.readings(start=start, stop=min(start + _WINDOW, run.n_samples))
            _walk_window(walk, run.first_sample + start, readings, report, run)
        for leap in report.leaps:
            leap.explained = _is_explained(leap, run, speed)
    slips = [leap for leap in report.leaps if leap.by * clock_ppm < 0 and abs(leap.by) == 1]
    for slip in slips[: 1 + int(report.n_samples * abs(clock_ppm) * 1e-6)]:
        slip.explained = True
    return report


def _walk_window(walk: _Walk, first: int, readings: Floats, report: MarkedReport, run: Run) -> None:
    absent = np.isnan(readings).any(axis=0)
    for gap in run.gaps:
        low, high = gap.first_sample - first, gap.end - first
        absent[max(low, 0) : max(high, 0)] &= ~np.isnan(readings[:, max(low, 0) : max(high, 0)]).all(axis=0)
    report.unexplained += int(absent.sum())
    present = ~np.isnan(readings).any(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], present.view(np.int8), [0]))))
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        for start in range(low, high, _PIECE):
            walk.piece(first + start, readings[:, start : min(start + _PIECE, high)])


def _is_explained(leap: Leap, run: Run, speed: float) -> bool:
    for gap in run.gaps:
        known = _KNOWN_TO.search(gap.reason)
        if known is not None and 0 <= leap.sample - gap.end < _WINDOW // 100:
            # The gap says how well its length is known; the marks say how long it was.
            return abs(leap.by) <= _SLACK + speed * run.rate_hz * 1e-3 * float(known[1])
    return any(
        event.kind == "clock"
        and event.data.get("clock") == "stood_still"
        and abs(event.sample - leap.sample) < _EXPLAINED_WITHIN
        for event in run.events
    )
