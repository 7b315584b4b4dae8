"""What wires show at impacts that no rotation makes: the wall slides, or turns about the vertical.

LVDTs under the wall show neither. Between what the wires read and what they should at the rotation of the
LVDTs, a slide is a step that all wires share, a turn one that grows with their place along the wall. Slides
grow with the speed of impacts; a base that gives way steps by as much at every one, to the side that the
wall falls to.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from daq_app.rocking.families.base.slip import HalfCycleSlips

Floats = NDArray[np.float64]

_SKIPPED_S: Final = 2e-3
"""Time beside an impact that is not looked at: impacts last as long."""
_WINDOW_S: Final = 10e-3
"""Time before and after it whose means are compared: the wall turns by few mrad meanwhile, so that a gain of
wires that is off by 1 % makes 0.06 mm. Raising it lets errors of the rotation in."""
_NEAR_S: Final = 30e-3
"""How far the LVDTs' crossing may lie from an impact by the wires: a slide of 20 mm s/rad makes 10 ms."""
_FEWEST: Final = 5
"""Impacts from which steps can be told from chance."""
_FEWEST_WIRES: Final = 3
"""Wires from which most tell what the wall does: of two, either may be at fault."""
_SLOWEST_RAD_S: Final = 5e-3
"""Speed below which noise tells the side that a wall falls to."""
_COEFFICIENTS: Final = 3
"""Of speed, with its sign and without, and of the sign alone."""
_BOTH_SIDES: Final = 0.3
"""Turn that the wires of one side show over that of the other, from which it is the wall's: a wire at fault
shows it alone. Lowering it takes a wire's fault for a turn."""
_CHANCE: Final = 1e-4
"""Probability by which scatter alone makes such steps. Raising it names sound walls."""
_LEAPING: Final = 0.9
"""Share of the variance of steps that speed must explain where wires leap: of slides of 5 mm it is 0.99, of
wires that freeze for moments 0.7. Lowering it takes a loose contact for a slide."""
_SMALLEST_M: Final = 2e-4
"""Largest step of a test that is named, at a wire: sensors that are 20 µs apart make 0.05 mm. Lowering it
names what moves r by less than 0.0005."""


@dataclass(frozen=True, slots=True)
class BaseSteps:
    """Steps at impacts; 0 where there are none that stand out."""

    slide_m: float
    """The largest along x, m."""
    turn_rad: float
    """The largest about the vertical, rad."""


NO_STEPS: Final = BaseSteps(0.0, 0.0)


def base_steps(
    time_s: Floats,
    rotation_rad: Floats,
    residual_m: Floats,
    y_m: Floats,
    impacts_s: Iterable[float],
    *,
    leaping: bool = False,
) -> BaseSteps:
    """Steps that go with the speed of impacts, or with its sign.

    `rotation_rad`: (n,) by the LVDTs at `time_s`; `residual_m`: (wires, n) displacement along x at each wire
    that it does not explain; both NaN where they are not known. `y_m`: (wires,) places along the wall.
    `impacts_s`: about when the impacts were. `leaping`: whether wires leap, with the wall or by themselves.
    """
    crossings = _crossings(time_s, rotation_rad, residual_m, impacts_s)
    if len(crossings) < _FEWEST:
        return NO_STEPS
    turned = np.array([crossing.after_rad - crossing.before_rad for crossing in crossings])
    by_gain = np.outer(turned, _gains(rotation_rad, residual_m, crossings))
    steps = np.array([crossing.after_m - crossing.before_m for crossing in crossings]) - by_gain
    wires = np.isfinite(steps).mean(axis=0) > 0.5
    speeds = np.array([crossing.speed_rad_s for crossing in crossings])
    known = np.isfinite(steps[:, wires]).all(axis=1) & (np.abs(speeds) > _SLOWEST_RAD_S)
    if np.count_nonzero(known) < _FEWEST or np.count_nonzero(wires) < _FEWEST_WIRES:
        return NO_STEPS
    steps, places, speeds = steps[known][:, wires], y_m[wires], speeds[known]
    least = _LEAPING if leaping else 0.0
    shared = np.median(steps, axis=1)
    turns = _turns(steps - shared[:, None], places, speeds)
    reach = float(np.abs(places).max())
    turn = 0.0 if turns is None else _with_speed(turns, speeds, _SMALLEST_M / reach, least)
    return BaseSteps(_with_speed(shared, speeds, _SMALLEST_M, least), turn)


def between_impacts(
    time_s: Floats, rotation_rad: Floats, residual_m: Floats, y_m: Floats, impacts_s: Iterable[float]
) -> HalfCycleSlips | None:
    """How far all wires move between two impacts, and how far they turn; None where they do not tell.

    The arguments are those of `base_steps`.
    """
    crossings = _crossings(time_s, rotation_rad, residual_m, impacts_s)
    known = np.isfinite(residual_m).mean(axis=1) > 0.5
    if len(crossings) < _FEWEST or np.count_nonzero(known) < _FEWEST_WIRES:
        return None
    gains, places = _gains(rotation_rad, residual_m, crossings)[known], y_m[known]
    rows = []
    for one, other in pairwise(crossings):
        inside = rotation_rad[one.end : other.first]
        moved = (other.before_m - one.after_m)[known] - gains * (other.before_rad - one.after_rad)
        if not (inside.size and np.isfinite(inside).all() and np.isfinite(moved).all()):
            continue
        shared = float(np.median(moved))
        apart = [(moved[side] - shared) / places[side] for side in (places > 0.0, places < 0.0)]
        turn = float(np.mean([np.mean(side) for side in apart])) if all(side.size for side in apart) else 0.0
        outwards = math.copysign(1.0, one.speed_rad_s)
        peak, speed = float(np.abs(inside).max()), abs(one.speed_rad_s)
        rows.append((outwards, peak, speed, outwards * shared, outwards * turn))
    return HalfCycleSlips(*np.array(rows).T) if rows else None


def _crossings(
    time_s: Floats, rotation_rad: Floats, residual_m: Floats, impacts_s: Iterable[float]
) -> list[_Crossing]:
    found = (_crossing(time_s, rotation_rad, residual_m, about_s) for about_s in impacts_s)
    return [crossing for crossing in found if crossing is not None]


def _turns(apart: Floats, y_m: Floats, speeds: Floats) -> Floats | None:
    """(impacts,) what wires beside the middle turn by, rad; None where only those of one side show it.

    `apart`: (impacts, wires) steps beyond those that all share, m.
    """
    if not ((y_m > 0.0).any() and (y_m < 0.0).any()):
        return None
    sides = [np.mean(apart[:, side] / y_m[side], axis=1) for side in (y_m > 0.0, y_m < 0.0)]
    one, other = (_explained(side, speeds) for side in sides)
    if one @ other < _BOTH_SIDES * max(one @ one, other @ other):
        return None
    return np.asarray(np.mean(sides, axis=0))


@dataclass(frozen=True, slots=True)
class _Crossing:
    """An impact as the LVDTs show it: means over the windows before and after it."""

    speed_rad_s: float
    """Signed, before it."""
    before_rad: float
    after_rad: float
    before_m: Floats
    """(wires,) of the residual."""
    after_m: Floats
    first: int
    """Sample at which the window before it begins."""
    end: int
    """Sample at which the window after it ends."""


def _crossing(time_s: Floats, rotation_rad: Floats, residual_m: Floats, about_s: float) -> _Crossing | None:
    """The crossing of the LVDTs next to an impact; None where they do not show it."""
    first, last = np.searchsorted(time_s, [about_s - _NEAR_S, about_s + _NEAR_S])
    near = rotation_rad[first:last]
    crossings = np.flatnonzero(np.signbit(near[1:]) != np.signbit(near[:-1]))
    if not crossings.size:
        return None
    # Noise crosses more than once: the middle one counts.
    impact_s = float(time_s[first + crossings[crossings.size // 2]])
    near_s, far_s = _SKIPPED_S, _SKIPPED_S + _WINDOW_S
    edges_s = impact_s + np.array([-far_s - _WINDOW_S, -far_s, -near_s, near_s, far_s])
    early, middle, before, after, end = np.searchsorted(time_s, edges_s)
    if early == 0 or end == time_s.size:
        return None
    levels = [float(rotation_rad[part].mean()) for part in (slice(early, middle), slice(middle, before))]
    if not np.isfinite(levels).all():
        return None
    return _Crossing(
        speed_rad_s=(levels[1] - levels[0]) / _WINDOW_S,
        before_rad=levels[1],
        after_rad=float(rotation_rad[after:end].mean()),
        before_m=residual_m[:, middle:before].mean(axis=1),
        after_m=residual_m[:, after:end].mean(axis=1),
        first=int(middle),
        end=int(end),
    )


def _gains(rotation_rad: Floats, residual_m: Floats, crossings: Sequence[_Crossing]) -> Floats:
    """(wires,) what the residual has of the rotation, m/rad: a gain that is off is no step.

    A step stays from one impact to the next; what the middle of a half-cycle has beyond its ends is gain.
    """
    over, squares = np.zeros(residual_m.shape[0]), 0.0
    for one, other in pairwise(crossings):
        third = (other.first - one.end) // 3
        if third <= 0:
            continue
        top = slice(one.end + third, other.first - third)
        turned = float(rotation_rad[top].mean()) - 0.5 * (one.after_rad + other.before_rad)
        shown = residual_m[:, top].mean(axis=1) - 0.5 * (one.after_m + other.before_m)
        if math.isfinite(turned) and np.isfinite(shown).any():
            over += np.nan_to_num(shown) * turned
            squares += turned**2
    return over / squares if squares > 0.0 else over


def _with_speed(steps: Floats, speeds: Floats, smallest: float, least_share: float) -> float:
    """The largest of the steps that speed and its sign explain; 0 for chance.

    `least_share`: of their variance that it must explain.
    """
    shown = _explained(steps, speeds)
    largest = float(np.abs(shown).max())
    freedom = steps.size - _COEFFICIENTS
    left = float(np.sum((steps - shown) ** 2)) / freedom
    explained = float(np.sum(shown**2)) / max(float(np.sum(steps**2)), 1e-300)
    if largest < smallest or explained < least_share:
        return 0.0
    ratio = float(np.sum(shown**2)) / _COEFFICIENTS / left if left > 0.0 else math.inf
    return largest if fdtrc(_COEFFICIENTS, freedom, ratio) < _CHANCE else 0.0


def _explained(steps: Floats, speeds: Floats) -> Floats:
    """(impacts,) what of the steps goes with the speed, with its sign and without, and with its sign."""
    design = np.column_stack([speeds, np.abs(speeds), np.sign(speeds)])
    return np.asarray(design @ np.linalg.lstsq(design, steps, rcond=None)[0])
