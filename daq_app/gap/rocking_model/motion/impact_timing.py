"""How late the accelerometers are against the reference rotation, from the velocity jumps of the impacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray, robust_sd
from daq_app.gap.rocking_model.motion.motion_grid import Grid
from daq_app.gap.rocking_model.motion.rotation import GRID_HZ, gridded
from daq_app.gap.rocking_model.records import GRAVITY_M_S2, GapRun
from daq_app.gap.rocking_model.tolerances.walls import ALONE, IMPACT_FORM_S, SHARP_S
from daq_app.rocking.geometry.parabola import vertex

MOST = 14
"""Impacts used: the first ones are the loudest."""
WINDOW_S = 0.11
REACH_S = 0.065
_SLOW_SHAPES = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 2 * round(WINDOW_S * GRID_HZ)), 5))[0]
"""Powers of time that are free around each impact, an orthonormal base of them over a window, (samples, 5):
as much as a wall does that rings below 7 Hz."""
_NEAR_S = 3e-3
"""How far from its lowest point the shape of a sharp dip is read."""


def acceleration_delay(run: GapRun, grid: Grid) -> tuple[float, float] | None:
    """(delay, its variance): shift of the record that fits the rotation's own acceleration best.

    What is compared are averages over 5 ms of z θ̈ − g sin θ with the jump of θ̇ at every impact: any
    linear response of the accelerometers shifts its centroid by its delay. The largest value of
    a long and lopsided one comes sooner than that, which the variance says. None without enough impacts.
    """
    chosen = run.steady_accelerometers("x")
    if not chosen or grid.impact_s.size < 3:
        return None
    height = float(run.positions(chosen)[:, 2].mean())
    measured = np.mean([gridded(run, i) for i in chosen], axis=0)
    windows = _windows(grid)
    if len(windows) < 3:
        return None
    fine = np.arange(grid.speed.size) / run.rate_hz + grid.time_s[0] - 0.5 / GRID_HZ
    gravity = np.interp(fine, grid.time_s, GRAVITY_M_S2 * np.sin(grid.theta))
    velocity = height * grid.speed - np.cumsum(gravity) / run.rate_hz
    ends = np.append(grid.time_s - 0.5 / GRID_HZ, grid.time_s[-1] + 0.5 / GRID_HZ)
    ends = ends[np.column_stack([windows, windows[:, -1] + 1])]

    def misfit(delays: FloatArray) -> FloatArray:
        """Squares left, (delays, windows)."""
        expected = np.diff(np.interp(ends - delays[:, None, None], fine, velocity)) * GRID_HZ
        difference = measured[windows] - expected
        slow = (difference @ _SLOW_SHAPES) @ _SLOW_SHAPES.T
        return np.asarray(np.sum((difference - slow) ** 2, axis=2))

    delays = np.arange(-REACH_S, REACH_S, 1e-3)
    dip = _Dip.of(delays, misfit(delays).sum(axis=1))
    reach = min(dip.sooner_s, dip.later_s) if dip.broad else _NEAR_S
    fine_delays = dip.middle_s + np.linspace(-reach, reach, 2 * round(reach / 2.5e-4) + 1)
    tables = misfit(fine_delays)
    lowest = _middle if dip.broad else _minimum
    shift = lowest(fine_delays, tables.sum(axis=1))
    each = np.array([lowest(fine_delays, tables[:, k]) for k in range(tables.shape[1])])
    spread = robust_sd(each - np.median(each))
    form = dip.lopsided_s if dip.broad else 0.0
    return shift, 1.57 * spread**2 / len(windows) + IMPACT_FORM_S**2 + form**2


def _windows(grid: Grid) -> NDArray[np.intp]:
    """Samples of the grid around each impact that stands alone, (impacts, samples of a window)."""
    windows = []
    half = round(WINDOW_S * GRID_HZ)
    gaps = np.diff(grid.impact_s, append=grid.impact_s[-1] + 0.5)
    for k, (time, gap) in enumerate(zip(grid.impact_s, gaps, strict=True)):
        before = time - grid.impact_s[k - 1] if k else 1.0
        if min(gap, before) < ALONE * WINDOW_S:
            break
        centre = int(np.searchsorted(grid.time_s, time))
        if centre < half or centre + half > grid.time_s.size:
            continue
        windows.append(np.arange(centre - half, centre + half))
        if len(windows) == MOST:
            break
    return np.array(windows, dtype=np.intp)


@dataclass(frozen=True, slots=True)
class _Dip:
    """Where the misfit is least, s, and how broad it is to either side where it has half its depth, s."""

    middle_s: float
    sooner_s: float
    later_s: float

    @classmethod
    def of(cls, delays: FloatArray, curve: FloatArray) -> _Dip:
        """The dip of a misfit, in steps of 1 ms, smoothed over 5 ms."""
        smooth = np.convolve(np.pad(curve, 2, mode="edge"), np.full(5, 0.2), "valid")
        k = int(np.argmin(smooth))
        out = np.flatnonzero(smooth - smooth[k] > 0.5 * (np.median(smooth) - smooth[k]))
        left, right = out[out < k].max(initial=0), out[out > k].min(initial=smooth.size - 1)
        middle, first, last = (float(delays[i]) for i in (k, left, right))
        return cls(middle, middle - first, last - middle)

    @property
    def broad(self) -> bool:
        """Whether the accelerometers' response is longer than an impact: 5 to 6 ms as they are, 17 behind a
        filter of 20 ms."""
        return min(self.sooner_s, self.later_s) > SHARP_S

    @property
    def lopsided_s(self) -> float:
        """How far the middle of a response may be from where it is largest."""
        return 0.5 * abs(self.later_s - self.sooner_s)


def _middle(where: FloatArray, values: FloatArray) -> float:
    """Lowest point of the parabola through all samples: a broad dip is ragged by what rings at 5 ms."""
    centre = float(where.mean())
    bend, slope, _ = np.polyfit(where - centre, values, 2)
    shift = -0.5 * slope / bend if bend > 0 else 0.0
    return centre + float(np.clip(shift, where[0] - centre, where[-1] - centre))


def _minimum(where: FloatArray, values: FloatArray) -> float:
    """Lowest point of a sampled curve, by a parabola through its lowest sample and both neighbours."""
    k, shift, bend = vertex(values, int(np.argmin(values)))
    between = np.clip(shift, -1.0, 1.0) if bend > 0 else 0.0
    return float(where[k] + between * (where[1] - where[0]))
