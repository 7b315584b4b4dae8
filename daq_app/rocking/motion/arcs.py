"""One half-cycle at a time: peak, times and one-sided speeds from a local model of the rotation.

θ̇ jumps at each impact, so no symmetric filter can show the speeds just before and after it. Each
half-cycle ("arc") is therefore fitted by itself, strictly between its two impacts, with

    θ(t) = a + b cosh q(t−t_c) + c sinh q(t−t_c)  [+ powers 3…6 of (t−t_c) where the data ask for them]

with q² = p² cos(mean of α − |θ|). The first three terms are the general motion, linearised about the
middle of the half-cycle, with free constants; the powers take up another p, a yielding joint, what
else the wall does. They are used only where the data ask for them clearly (Bayesian information
criterion with a margin). Nothing is assumed about energy or the neighbouring half-cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.motion.arc_fits import POWERS, crossings, extrema, fit_stack, speed_kept

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_GUARD_S = 0.002
_GUARD_SHARE = 0.015
"""Kept clear of each impact: the crossing's own error, filters of the sensors, the shock itself."""
_FALL_SHARE = 0.7
"""Part of the fall from release to first impact that is used: its beginning depends on the release."""
_POINTS = 160
"""Samples are averaged to about this many points: noise becomes white and fits become cheap."""
_MIN_POINTS = 12


@dataclass(frozen=True, slots=True)
class Arc:
    """One half-cycle, signed values; arc 0 is the fall from the release to impact 1."""

    index: int
    """Number of the impact that starts it; 0 for the fall."""
    start_s: float
    """Zero crossing at which the arc starts (the release for arc 0), as this arc shows it."""
    end_s: float
    sigma_start_s: float
    sigma_end_s: float
    peak_rad: float
    peak_s: float
    sigma_peak_rad: float
    """NaN with the peak where the arc has none (the fall: its peak is the hold)."""
    speed_start_rad_s: float
    """θ̇⁺ just after the impact that starts it; NaN for the fall."""
    sigma_speed_start_rad_s: float
    speed_end_rad_s: float
    """θ̇⁻ just before the impact that ends it."""
    sigma_speed_end_rad_s: float
    kept: float
    """ln of the speed at its end over that at its start by a basis that is free to lose speed; NaN for the
    fall."""
    sigma_kept: float
    powers: tuple[int, ...]
    """Powers that were added to the basis."""
    residual_rad: float
    """rms of what the fit leaves, at the averaged points."""
    points: int

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


def fit_arcs(
    time_s: Floats,
    rotation_rad: Floats,
    bounds_s: Sequence[float],
    *,
    first_index: int,
    p_rad_s: float,
    alpha_rad: float,
    zero_sigma_rad: float = 2e-5,
    slow_noise_rad: float = 0.0,
) -> list[Arc | None]:
    """Fit consecutive half-cycles between zero crossings (that of index 0 between release and crossing).

    `bounds_s` (arcs + 1,) are where they start and end. `time_s`, `rotation_rad` (n,) must cover them; NaN
    samples are left out. `zero_sigma_rad` is what the zero of the rotation may be wrong by: it moves the
    crossings. None where too little is left to fit, or where the fit has no zero crossing or peak where it
    should.
    `slow_noise_rad`: rms of one sample of the white noise whose long means scatter as the recording's do.
    """
    bounds = np.asarray(bounds_s, dtype=np.float64)
    start, end = bounds[:-1], bounds[1:]
    index = first_index + np.arange(start.size)
    length = end - start
    guard = np.maximum(_GUARD_S, _GUARD_SHARE * length)
    first = np.where(index == 0, start + (1.0 - _FALL_SHARE) * length, start + guard)
    low, size, groups = _grouping(time_s, first, end - guard)
    fitted: list[Arc | None] = [None] * start.size
    kept = np.flatnonzero(groups >= _MIN_POINTS)
    if not kept.size:
        return fitted
    t, y = _averaged(time_s, rotation_rad, low[kept], size[kept], groups[kept])
    present = np.isfinite(y)
    enough = present.sum(axis=1) >= _MIN_POINTS
    kept, t, y, present = kept[enough], t[enough], y[enough], present[enough]
    if not kept.size:
        return fitted
    left = np.where(index == 0, first, start)[kept]
    noise = slow_noise_rad / np.sqrt(size[kept])
    stack = _Stack(index[kept], start[kept], (left + end[kept]) / 2.0, (end[kept] - left) / 2.0, noise)
    arcs = stack.fitted(t, y, present, p_rad_s, alpha_rad, zero_sigma_rad)
    for place, arc in zip(kept.tolist(), arcs, strict=True):
        fitted[place] = arc
    return fitted


@dataclass(frozen=True, slots=True)
class _Stack:
    """Half-cycles that have enough points, one after the other; arrays (arcs,)."""

    index: NDArray[np.intp]
    start_s: Floats
    centre_s: Floats
    half_s: Floats
    noise_rad: Floats
    """Least uncertainty of a point."""

    def fitted(
        self, t: Floats, y: Floats, present: Bools, p_rad_s: float, alpha_rad: float, zero_sigma_rad: float
    ) -> list[Arc | None]:
        """Arcs of the points (arcs, points) that are present."""
        x = np.where(present, (t - self.centre_s[:, None]) / self.half_s[:, None], 0.0)
        y = np.where(present, y, 0.0)
        points = present.sum(axis=1)
        middle = np.maximum(alpha_rad - np.abs(y).sum(axis=1) / points, 0.0)
        fits = fit_stack(x, y, present, p_rad_s * np.sqrt(np.cos(middle)) * self.half_s, self.noise_rad)
        starting, ending = crossings(fits, self.half_s, zero_sigma_rad)
        peak = extrema(fits)
        fall = self.index == 0
        # The fall has neither a crossing at its start nor a peak of its own: its peak is the hold.
        starting[:, fall], peak[:, fall] = np.nan, np.nan
        good = np.isfinite(ending[0]) & (fall | (np.isfinite(starting[0]) & np.isfinite(peak[0])))
        kept = speed_kept(fits, np.stack([starting[0], ending[0]]))
        begins = np.where(fall, self.start_s, self.centre_s + self.half_s * starting[0])
        peak_s = np.where(fall, self.start_s, self.centre_s + self.half_s * peak[0])
        columns = {
            "start_s": begins,
            "end_s": self.centre_s + self.half_s * ending[0],
            "sigma_start_s": self.half_s * starting[1],
            "sigma_end_s": self.half_s * ending[1],
            "peak_rad": peak[1],
            "peak_s": peak_s,
            "sigma_peak_rad": np.hypot(peak[2], zero_sigma_rad),
            "speed_start_rad_s": starting[2],
            "sigma_speed_start_rad_s": starting[3],
            "speed_end_rad_s": ending[2],
            "sigma_speed_end_rad_s": ending[3],
            "kept": kept[0],
            "sigma_kept": kept[1],
            "residual_rad": fits.residual,
        }
        rows = np.stack(list(columns.values()), axis=1).tolist()
        return [
            Arc(
                index=int(self.index[n]),
                powers=POWERS[int(fits.candidate[n])],
                points=int(points[n]),
                **dict(zip(columns, row, strict=True)),
            )
            if good[n]
            else None
            for n, row in enumerate(rows)
        ]


def _grouping(
    time_s: Floats, first_s: Floats, last_s: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """First sample, samples per point and points of each stretch first … last."""
    low, high = np.searchsorted(time_s, first_s), np.searchsorted(time_s, last_s)
    n = np.maximum(high - low, 0)
    size = np.maximum(1, n // _POINTS)
    return low, size, n // size


def _averaged(
    time_s: Floats,
    rotation_rad: Floats,
    low: NDArray[np.intp],
    size: NDArray[np.intp],
    groups: NDArray[np.intp],
) -> tuple[Floats, Floats]:
    """(arcs, points) means of consecutive samples; NaN beyond an arc's own points."""
    # Borders of all groups of all arcs in one row, one more for the end of each arc's last group.
    place = np.arange(int(groups.max()) + 1)
    inside = place <= groups[:, None]
    borders = (low[:, None] + size[:, None] * place)[inside]
    within = np.minimum(borders, time_s.size - 1)
    means = []
    for values in (time_s, rotation_rad):
        table = np.full(inside.shape, np.nan)
        table[inside] = np.add.reduceat(values, within)
        # An arc that reaches the last sample: its last border stands before the end.
        for row in np.flatnonzero(low + size * groups > time_s.size - 1):
            begin = int(low[row] + size[row] * (groups[row] - 1))
            table[row, groups[row] - 1] = values[begin:].sum()
        table[np.arange(groups.size), groups] = np.nan
        means.append(table[:, :-1] / size[:, None])
    return means[0], means[1]
