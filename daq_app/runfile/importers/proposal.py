"""A map proposed for a foreign file: which column is probably which channel, and why.

Four things speak for a pair: the names, the units, the size of the numbers against the range of the sensor,
and the course of the column against what a rigid block that rocks would show at the sensor's place. For the
last, each column in turn is tried as the rotation, in both directions; the one under which all columns fit
best counts.
"""

from __future__ import annotations

import difflib
import json
import re
import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from daq_app.config import Channel, Rig
from daq_app.runfile.errors import RunFileError
from daq_app.runfile.importers.import_file import open_foreign
from daq_app.runfile.importers.import_map import SourceMap
from daq_app.runfile.importers.recording import ForeignChannel, Spool
from daq_app.runfile.importers.unit_text import is_time, parse_unit

_N_POINTS: Final = 2000
"""Samples of each column that are compared: a test of ten seconds at 200 Hz."""
_SURE: Final = 1.0
"""Score from which a pair is proposed without a question mark. A name that agrees gives 2 by itself."""
_LEAST: Final = 0.3
"""Score below which a channel is left without a column."""
_WRONG_UNIT: Final = -3.0


@dataclass(frozen=True, slots=True)
class ProposedChannel:
    """One pair, and what speaks for it."""

    channel_id: str
    column: str
    unit: str
    """Unit to put into the map: what the file says, or the channel's where it says nothing that can be."""
    unit_is_assumed: bool
    score: float
    reasons: tuple[str, ...]

    @property
    def sure(self) -> bool:
        return self.score >= _SURE and not self.unit_is_assumed


@dataclass(frozen=True, slots=True)
class Proposal:
    """The pairs in the order of the rig, and what stayed without a partner."""

    pairs: tuple[ProposedChannel, ...]
    missing: tuple[str, ...]
    """Channels of the rig."""
    unused: tuple[str, ...]
    """Columns of the file."""

    def text(self, file: str) -> str:
        """The map as TOML, with the reasons beside."""
        lines = [
            f"# Proposed for {file}. Lines with `check` are guesses: look at them before you import.",
            "# What the file says of time can be corrected here:",
            "# [source]",
            "# rate_hz = 4000.0",
            "# start_utc = 2026-05-04T10:00:00+02:00  # with its time zone; LVM has local time, taken as UTC",
        ]
        for pair in self.pairs:
            mark = "" if pair.sure else "check: "
            lines += ["", f"[channels.{json.dumps(pair.channel_id)}]  # {mark}{', '.join(pair.reasons)}"]
            lines.append(f"from = {json.dumps(pair.column, ensure_ascii=False)}")
            assumed = "  # check: assumed, the file gives no unit that can be" if pair.unit_is_assumed else ""
            lines.append(f"unit = {json.dumps(pair.unit, ensure_ascii=False)}{assumed}")
        if self.missing:
            lines += ["", f"# No column for: {', '.join(self.missing)}"]
        if self.unused:
            lines += ["", f"# Columns without a channel: {', '.join(self.unused)}"]
        return "\n".join([*lines, ""])


def propose_map(path: Path, rig: Rig, source: SourceMap | None = None) -> Proposal:
    """Compare every column of `path` with every channel of `rig`. Raises `RunFileError`."""
    with closing(open_foreign(path, source or SourceMap())) as reader:
        columns = [c for c in reader.channels if c.name != reader.time_channel and c.preferred]
        if not columns:
            raise RunFileError(f"{path} holds no columns of numbers")
        with tempfile.TemporaryDirectory() as folder, Spool(Path(folder), [c.name for c in columns]) as spool:
            reader.copy(spool)
            values = np.array([_thinned(spool, column.name) for column in columns])
    scores = _score_of_names(rig.channels, columns) + _score_of_units(rig.channels, columns, values)
    courses = _score_of_courses(rig, values, scores)
    rows, places = linear_sum_assignment(-(scores + courses))
    pairs = []
    for row, place in sorted(zip(rows.tolist(), places.tolist(), strict=True)):
        channel, column = rig.channels[row], columns[place]
        score = float(scores[row, place] + courses[row, place])
        if score >= _LEAST:
            pairs.append(_pair(channel, column, score, float(courses[row, place])))
    taken_ids, taken = {p.channel_id for p in pairs}, {p.column for p in pairs}
    return Proposal(
        tuple(pairs),
        tuple(channel.id for channel in rig.channels if channel.id not in taken_ids),
        tuple(column.name for column in columns if column.name not in taken),
    )


def _thinned(spool: Spool, name: str) -> NDArray[np.float64]:
    """(_N_POINTS,) means of equal parts of a column; NaN where there is nothing."""
    length = spool.length(name)
    if length == 0:
        return np.full(_N_POINTS, np.nan)
    values = spool.read(name, 0, length)
    edges = np.linspace(0, length, _N_POINTS + 1).astype(int)
    starts = np.minimum(edges[:-1], length - 1)
    sums = np.add.reduceat(values, starts)
    means: NDArray[np.float64] = sums / np.maximum(np.diff(edges), 1)
    return means


def _plain(name: str) -> str:
    return re.sub(r"[\W_]+", "", name.rpartition("/")[2].casefold())


def _score_of_names(channels: Sequence[Channel], columns: Sequence[ForeignChannel]) -> NDArray[np.float64]:
    """2 for the same name, up to 0.5 for one alike; (channel, column)."""

    def score(channel: Channel, column: ForeignChannel) -> float:
        names = {_plain(column.name), *(_plain(alias) for alias in column.aliases)}
        wanted = _plain(channel.id)
        if wanted in names:
            return 2.0
        return 0.5 * max(difflib.SequenceMatcher(None, wanted, name).ratio() for name in names)

    return np.array([[score(channel, column) for column in columns] for channel in channels])


def _score_of_units(
    channels: Sequence[Channel], columns: Sequence[ForeignChannel], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """0.5 for a unit that fits, −3 for one that cannot; ± 0.25 for numbers within the range or far beyond."""
    scores = np.zeros((len(channels), len(columns)))
    for j, column in enumerate(columns):
        parsed = None if is_time(column.unit) else parse_unit(column.unit)
        finite = values[j][np.isfinite(values[j])]
        for i, channel in enumerate(channels):
            if parsed is None:
                continue
            if parsed[0] not in (channel.si_unit, channel.reading_unit):
                scores[i, j] = _WRONG_UNIT
                continue
            scores[i, j] = 0.5
            if parsed[0] == channel.si_unit and finite.size:
                low, high = channel.range_si
                inside = np.ptp(finite) * parsed[1] <= 1.5 * (high - low)
                scores[i, j] += 0.25 if inside else -0.25
    return scores


def _score_of_courses(
    rig: Rig, values: NDArray[np.float64], others: NDArray[np.float64]
) -> NDArray[np.float64]:
    """|correlation| of each column with what each place should show of the best rotation; 0 if unknown."""
    courses = values - values[:, -1:]
    courses[~np.isfinite(courses)] = 0.0
    best, best_sum = np.zeros(others.shape), -np.inf
    for course in courses:
        if not np.any(course):
            continue
        for rotation in (course, -course):
            score = np.abs(_correlation(_expected(rig, rotation), courses))
            rows, places = linear_sum_assignment(-(others + score))
            total = float((others + score)[rows, places].sum())
            if total > best_sum + 1e-9:
                best, best_sum = score, total
    return best


def _expected(rig: Rig, rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """(channel, n) what each sensor would show of a rigid block that rocks about its edges; 0 if unknown."""
    half = 0.5 * rig.specimen.base_width_m
    right, left = np.maximum(rotation, 0.0), np.maximum(-rotation, 0.0)
    expected = np.zeros((len(rig.channels), rotation.size))
    for i, channel in enumerate(rig.channels):
        x, _, z = channel.position_m
        if channel.auxiliary:
            continue
        if channel.family == "lvdt":
            expected[i] = (half - x) * right + (half + x) * left
        elif channel.family == "wire":
            expected[i] = z * rotation
        elif channel.family == "tiltmeter" and channel.axis == "x":
            expected[i] = rotation
    return expected


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(rows of a, rows of b) correlation coefficients; 0 for a row that never changes."""

    def unit(rows: NDArray[np.float64]) -> NDArray[np.float64]:
        centred = rows - rows.mean(axis=1, keepdims=True)
        norm = np.linalg.norm(centred, axis=1, keepdims=True)
        scaled: NDArray[np.float64] = centred / np.where(norm > 0.0, norm, 1.0)
        return scaled

    product: NDArray[np.float64] = unit(a) @ unit(b).T
    return product


def _pair(channel: Channel, column: ForeignChannel, score: float, course: float) -> ProposedChannel:
    parsed = None if is_time(column.unit) else parse_unit(column.unit)
    reasons = ["same name" if _plain(channel.id) == _plain(column.name) else "by elimination"]
    if parsed is not None:
        reasons.append(f"its unit is {column.unit}")
    if course > 0.0:
        reasons.append(f"correlation with what this place should show {course:.2f}")
    if len(reasons) > 1 and reasons[0] == "by elimination":
        del reasons[0]
    unit = column.unit if parsed is not None else channel.si_unit
    return ProposedChannel(channel.id, column.name, unit, parsed is None, score, tuple(reasons))
