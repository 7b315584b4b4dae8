"""When a held wall is let go, as the start of its fall shows it."""

from __future__ import annotations

from typing import Final

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.rocking_model.tolerances.motion import (
    FALLEN,
    HARDLY_RISES,
    RISEN,
    RISES,
    START_LEAVES,
    SWAYS_ON,
)

_FALL: Final = (0.05, 0.3)
"""Shares of the held rotation between which a fall is seen whatever the wall swayed by before it."""
_HELD_S: Final = (0.6, 0.25)
"""Before the wall is falling, s: from when to when it is held; it falls to nine tenths within 0.1–0.2 s."""
_SWAYS_S: Final = 1.2
"""Before the wall is falling, s: from when on its sway is looked at."""
_SEARCHED_S: Final = 0.5
"""Times before and after the top of the fall, s, within which a swaying wall is let go."""
_SWAY_S: Final = 0.1
"""Time before the release, s, over which a sway of less than 3 Hz is a cubic."""
_FALLS_S: Final = 0.1
"""Time after the release, s, that a fall is seen in at least."""
_FEWEST: Final = 8
"""Readings of a rise and fall from which its motion is fitted."""
_COARSE: Final = 4
"""Readings from one start to the next before those beside the best are looked at."""
_WORK_HZ: Final = 500.0
"""Rate, Hz, of the readings that are fitted: the rotation is smoothed to far less."""


def release_sample(
    smooth: FloatArray, noise: float, first_crossing: int, p_rad_s: float, rate_hz: float
) -> float:
    """Sample of the release: the fall extrapolated back to the held rotation, |θ₀| − ½ a t².

    `smooth` (n,), rad, is the rotation without its fast noise, `noise` that of a sample before it was
    smoothed, rad, `first_crossing` the sample at which it first passes upright, and `p_rad_s` about the
    frequency parameter of the wall.

    The held rotation is that of the last moments before the fall: a hand that sways and a zero that walks
    move it by more than the first part of the fall does. Where a sway is as large as that, the release is
    where the acceleration leaves that of the sway for that of the fall, whatever the rotation there. A wall
    that is thrown up is let go where its rise begins, not at its top.
    """
    size = np.abs(smooth[:first_crossing])
    fallen = int(np.flatnonzero(size > FALLEN * size.max())[-1])
    first, last = (max(fallen - round(back * rate_hz), 0) for back in _HELD_S)
    hold = size[first : max(last, first + 1)]
    held = float(np.median(hold))
    swaying = size[max(fallen - round(_SWAYS_S * rate_hz), 0) : max(last, first + 1)]
    thrown = _thrown_up(size[first : fallen + 1], held, RISES * float(np.std(swaying)))
    if thrown is not None:
        return first + thrown
    if float(np.std(swaying)) > SWAYS_ON * held:
        return _let_go(size, held, fallen, p_rad_s, rate_hz)
    moved = held - size
    low, high = max(2.0 * noise, 0.01 * held), 0.1 * held
    still = np.flatnonzero(moved[: fallen + 1] < low)
    start = int(still[-1]) + 1 if still.size else first
    window = np.flatnonzero(moved[start:] < high) + start
    if window.size < 5:
        return float(start)
    slope, intercept = np.polyfit(window, np.sqrt(np.maximum(moved[window], 0.0)), 1)
    return float(max(-intercept / slope, 0.0)) if slope > 0.0 else float(start)


def _thrown_up(size: FloatArray, held: float, least: float) -> float | None:
    """Sample of `size`, (n,), rad, at which a wall leaves its hold and rises by `least`, rad; None for less.

    From there until it passes its hold again it moves as a stone that is thrown up, |θ₀| + ω t − ½ a t².
    """
    top = int(np.argmax(size))
    if size[top] - held < max(least, HARDLY_RISES * held):
        return None
    above = size > held + RISEN * (size[top] - held)
    begin, end = (int(np.argmin(above[top::step])) for step in (-1, 1))
    around = np.arange(1 - begin, end)
    if not begin or not end or around.size < _FEWEST:
        return None
    bend, slope, level = np.polyfit(around, size[top + around] - held, 2)
    under = slope**2 - 4.0 * bend * level
    return float(top + (np.sqrt(under) - slope) / (2.0 * bend)) if bend < 0.0 < under else None


def _let_go(size: FloatArray, held: float, fallen: int, p_rad_s: float, rate_hz: float) -> float:
    """Sample at which a sway goes over into a fall of the same rotation and speed.

    The parabola through a fall by a twentieth to three tenths says about when: its top is the release of a
    wall that is let go at rest, and one that moves is let go some tenths of a second before or after it. A
    fall explains every later start as well, so that the release is the earliest that explains what is seen
    better than those beside it.
    """
    begin = int(np.flatnonzero(size[: fallen + 1] > (1.0 - _FALL[0]) * held)[-1]) + 1
    below = np.flatnonzero(size[begin:] < (1.0 - _FALL[1]) * held)
    end = begin + int(below[0]) if below.size else size.size
    if end - begin < 5:
        return float(begin)
    bend, slope, _ = np.polyfit(np.arange(end - begin), size[begin:end], 2)
    if bend >= 0.0:
        return float(begin)
    top = max(begin - 0.5 * slope / bend, 0.0)
    step = max(round(rate_hz / _WORK_HZ), 1)
    near = range(round(top - _SEARCHED_S * rate_hz), round(top + _SEARCHED_S * rate_hz), step)
    before, least = round(_SWAY_S * rate_hz), round(_FALLS_S * rate_hz)
    starts = [start for start in near if start >= before and start + least <= end]
    if not starts:
        return float(top)

    def left_by(start: int) -> float:
        since_s = np.arange(-before, end - start, step) / rate_hz
        return _left_over(size[start - before : end : step], since_s, p_rad_s)

    coarse = starts[::_COARSE]
    left = np.array([left_by(start) for start in coarse])
    lowest = (left[1:-1] <= left[:-2]) & (left[1:-1] < left[2:]) & (left[1:-1] < START_LEAVES * left.max())
    if not lowest.any():
        return float(top)
    middle = _COARSE * (1 + int(np.argmax(lowest)))
    return float(min(starts[middle - _COARSE : middle + _COARSE + 1], key=left_by))


def _left_over(seen: FloatArray, since_s: FloatArray, p_rad_s: float) -> float:
    """Variance, rad², that a release at time 0 leaves of what is seen at times `since_s`; (m,) both.

    Before it the sway is a cubic, after it the wall falls as the linearised block does.
    """
    after = p_rad_s * np.maximum(since_s, 0.0)
    before = np.minimum(since_s, 0.0)
    shapes = (
        np.ones_like(after),
        before + np.sinh(after) / p_rad_s,
        np.cosh(after) - 1.0,
        before**2,
        before**3,
    )
    columns = np.stack(shapes, axis=1)
    solution, *_ = np.linalg.lstsq(columns, seen, rcond=None)
    return float(np.sum((seen - columns @ solution) ** 2) / (seen.size - columns.shape[1]))
