"""How one rotation follows another: gain, offset, drift, and a delay or a first-order response."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from daq_app.rocking.means import mean_of, means_over

Floats = NDArray[np.float64]

LATE_S = 1.5e-3
"""Families further apart in time than this are named. Known skews are below 0.2 ms; raising it hides late
families."""
SLOW_S = 1.5e-3
"""Time constant above which a family is named slow; raising it lets EAV be too low and nothing be said."""
DRIFT_RAD = 1.2e-4
"""Drift of one family against the other over what is compared that is named; sound ones stay below 6e-5 over
the motion and below 9e-5 over a part of it. One of 2e-4 moves r by up to 0.003, r of the fit by more."""
_RATE_HZ = 500.0
_FEWEST = 200
_STEP_S = 2e-4
_LARGEST_S = 0.08
_STEPS_S = (0.002, 0.005, 0.01, 0.02, 0.04, _LARGEST_S)
_GRID_S = (0.0, *(sign * step for step in _STEPS_S for sign in (-1.0, 1.0)))
"""Delays and time constants from which the search begins."""


@dataclass(frozen=True, slots=True)
class Response:
    """follower(t) ≈ gain · [reference, delayed and slowed](t) + offset + drift · t."""

    gain: float
    drift_rad_s: float
    delay_s: float
    response_s: float
    """Time constant of a first order; negative where it is the reference that is slow."""
    residual_rad: float
    span_s: float
    """Length of what was compared."""

    def noise_of_means(self, rate_hz: float, noise_rad: float) -> float:
        """What white noise of `noise_rad` rms in one sample leaves in the means that were compared."""
        return noise_rad / math.sqrt(max(1, round(rate_hz / _RATE_HZ)))

    def made_alike(self, rate_hz: float, reference: Floats, follower: Floats) -> tuple[Floats, Floats]:
        """Both rotations, (n,), with the delay and the slowness of either; NaN where one is not known."""
        unknown = ~np.isfinite(reference + follower)
        x, y = _without_gaps(reference), _without_gaps(follower)
        if self.response_s < 0.0:
            y = _delayed_and_slowed(y, 0.0, -self.response_s * rate_hz)
        else:
            x = _delayed_and_slowed(x, self.delay_s * rate_hz, self.response_s * rate_hz)
        return np.where(unknown, np.nan, x), np.where(unknown, np.nan, y)


def compare(time_s: Floats, reference_rad: Floats, follower_rad: Floats) -> Response | None:
    """Response of `follower_rad` (n,) to `reference_rad` (n,) on one time base; None with too few samples."""
    rate = (time_s.size - 1) / (time_s[-1] - time_s[0]) if time_s.size > 1 else 0.0
    size = max(1, round(rate / _RATE_HZ))
    x, y = (means_over(values, size) for values in (reference_rad, follower_rad))
    if x.size < _FEWEST:
        return None
    step = size / rate
    pair, turned = _Pair(x, y, step), _Pair(y, x, step)
    if min(pair.known, turned.known) < _FEWEST or np.nanstd(x) < 1e-4 or np.nanstd(y) < 1e-4:
        return None
    delay = _least(lambda value: pair.solved(value, 0.0).rms, -_LARGEST_S)
    slow = _least(lambda value: pair.solved(0.0, value).rms, 0.0)
    turned_slow = _least(lambda value: turned.solved(0.0, value).rms, 0.0)
    # A response smooths the noise of what it is applied to: residuals are judged less the noise they hold.
    noise_x, noise_y = _noise(x), _noise(y)
    solved_late, solved_slow, solved_turned = (
        pair.solved(delay, 0.0), pair.solved(0.0, slow), turned.solved(0.0, turned_slow),
    )  # fmt: skip
    candidates = [
        (solved_late.rms**2 - noise_y**2 - (solved_late.gain * noise_x) ** 2, delay, 0.0),
        (
            solved_slow.rms**2 - noise_y**2 - (solved_slow.gain * noise_x) ** 2 * _passed(slow, step),
            0.0,
            slow,
        ),
        (
            (solved_turned.rms**2 - noise_x**2) / solved_turned.gain**2
            - noise_y**2 * _passed(turned_slow, step),
            0.0,
            -turned_slow,
        ),
    ]
    turned_rms = solved_turned.rms / abs(solved_turned.gain)
    span = x.size * step
    _, delay, response = min(candidates)
    if response < 0.0:
        # The reference is the slower one: the other way round the fit is better.
        solved = turned.solved(0.0, -response)
        gain = 1.0 / solved.gain
        return Response(gain, -solved.drift * gain, 0.0, response, turned_rms, span)
    solved = pair.solved(delay, response)
    return Response(solved.gain, solved.drift, delay, response, solved.rms, span)


def _without_gaps(values: Floats) -> Floats:
    """The same, straight across its gaps."""
    places, known = np.arange(values.size, dtype=np.float64), np.isfinite(values)
    return np.interp(places, places[known], values[known])


def _delayed_and_slowed(values: Floats, delay: float, time_constant: float) -> Floats:
    """Values, (n,), later by a delay and behind a first order, both in samples."""
    if delay:
        places = np.arange(values.size, dtype=np.float64)
        values = np.interp(places - delay, places, values)
    if time_constant > 0.0:
        # First order, the input straight between samples (exact for a ramp).
        a = math.exp(-1.0 / time_constant)
        b = 1.0 - (1.0 - a) * time_constant
        start = np.array([values[0] * (1.0 - b)])
        values, _ = lfilter([b, 1.0 - a - b], [1.0, -a], values, zi=start)
    return values


def _noise(values: Floats) -> float:
    """rms of white noise by second differences, robust to jumps of the speed."""
    second = np.diff(values, 2)
    return float(np.nanmedian(np.abs(second))) * 1.4826 / math.sqrt(6.0)


def _passed(response_s: float, step_s: float) -> float:
    """Share of white noise's variance that a first order lets through."""
    return math.tanh(0.5 * step_s / response_s) if response_s > 0.0 else 1.0


def _least(cost: Callable[[float], float], low: float) -> float:
    """Where `cost` is least between `low` and the largest delay: the best of a grid, then Brent about it."""
    grid = [place for place in _GRID_S if place >= low]
    values = [cost(place) for place in grid]
    best = grid[int(np.argmin(values))]
    reach = max(abs(best) / 2.0, 2.0 * _STEPS_S[0])
    bounds = (max(best - reach, low), best + reach)
    found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": _STEP_S / 4.0})
    return float(found.x) if found.fun <= min(values) else best


@dataclass(frozen=True, slots=True)
class _Solved:
    gain: float
    drift: float
    rms: float


@dataclass(frozen=True)
class _Pair:
    """Reference and follower at one spacing; NaN where unknown."""

    reference: Floats
    follower: Floats
    step_s: float

    @cached_property
    def both(self) -> NDArray[np.bool_]:
        """(n,) where both are known."""
        return np.asarray(np.isfinite(self.reference) & np.isfinite(self.follower))

    @property
    def known(self) -> int:
        return int(np.count_nonzero(self.both))

    @cached_property
    def _places(self) -> Floats:
        return np.arange(self.reference.size, dtype=np.float64)

    @cached_property
    def _filled(self) -> Floats:
        """The reference, straight across its gaps."""
        return _without_gaps(self.reference)

    @cached_property
    def _rest(self) -> tuple[Floats, Floats]:
        """Columns of the offset and the drift where both are known, and the follower there."""
        time = (self._places - self._places.mean()) * self.step_s
        known = time[self.both]
        return np.column_stack([np.ones(known.size), known]), self.follower[self.both]

    def solved(self, delay_s: float, response_s: float) -> _Solved:
        """Linear part for a delay and a response: residuals where both are known."""
        filled = _delayed_and_slowed(self._filled, delay_s / self.step_s, response_s / self.step_s)
        rest, y = self._rest
        table = np.empty((y.size, 3))
        table[:, 0], table[:, 1:] = filled if y.size == filled.size else filled[self.both], rest
        normal = table.T @ table
        solution = np.linalg.solve(normal, table.T @ y)
        left = y - table @ solution
        gain, _, drift = solution.tolist()
        return _Solved(gain, drift, math.sqrt(mean_of(left * left)))
