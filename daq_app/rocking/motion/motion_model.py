"""The model behind the fit of the whole motion: parameters to residuals, and the exact Jacobian.

Parameters are scaled deviations from the start: [θ0, release, ln p, ln α, zero, mean ln r, lean, then the
deviation of ln r of each impact]. The lean makes α larger to one side and smaller to the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.theory.housner import (
    FreeRocking,
    exact_amplitude,
    exact_energy,
    exact_quarter_period,
    free_rocking,
    half_cycle_rotation,
)

Floats = NDArray[np.float64]

P_PRIOR, ALPHA_PRIOR, ZERO_PRIOR_RAD = 0.05, 0.10, 5e-4
LEAN_PRIOR_RAD = 2e-3
"""Standard deviation of half the difference of α of both sides beforehand, rad: a base 1 mm/m off level and a
centre of mass of 1.4 m height 2 mm off the middle (assumed). Half-cycles tell it a hundred times better;
lowering it makes α, p and single r take up what a wall leans by."""
POINT_S = 0.008
"""The fitted points are means over this time."""
FIXED = 7
"""Parameters before the deviations of single impacts."""
_LOG_R, LEAN = 5, 6
"""Places of the mean ln r and of the lean among them."""
_HELD = (2, 3, 4, LEAN)
"""Parameters that a prior holds: p, α, the zero and the lean; so are the deviations of single impacts."""
_THETA0_STEP_RAD, _RELEASE_STEP_S, _R_STEP = 1e-3, 0.01, 0.01
_SOFT = 100.0
_LEAST_R = 1e-3
_MOST_LEAN = 0.2
"""Share of α that the lean is kept below: a search that strays goes no further."""
_EPSILON = 1e-6


def below_one(log_r: Floats) -> tuple[Floats, Floats]:
    """r kept below 1 without a corner, for ln r of any sign, and d ln r / d`log_r`; of one shape.

    −ln(1 + e^(−100 ln r))/100 in place of ln r: a fit cannot get stuck at 1.
    """
    softened = np.logaddexp(0.0, -_SOFT * log_r)
    return np.exp(-softened / _SOFT), -np.expm1(-softened)


def held(parameters: int) -> list[int]:
    """Places of those of so many parameters that a prior holds, in the order of the residual's last rows."""
    return [*_HELD, *range(FIXED, parameters)]


@dataclass(frozen=True, slots=True)
class _Course:
    """The motion of one set of parameters at the fitted instants."""

    motion: FreeRocking
    index: NDArray[np.int_]
    """Half-cycle of each instant."""
    local: Floats
    """Time from its peak."""
    sign: Floats
    rotation: Floats
    """Unsigned, as the half-cycle has it."""
    speed: Floats


@dataclass(frozen=True)
class MotionModel:
    """Residuals in units of their sigma, priors included."""

    time_s: Floats
    rotation_rad: Floats
    sigma: float
    release_s: float
    theta0: float
    side: float
    p: float
    alpha: float
    log_r: float
    spread: float | None
    """None: r is the same at every impact."""
    _last: dict[tuple[bytes, int, int], _Course] = field(default_factory=dict, init=False, repr=False)
    """A fit asks for residuals and derivatives at the same place, one after the other."""

    def restitutions(self, x: Floats) -> Floats:
        """r of each impact (one value where all are the same).

        A search that strays to nothing has the least r, with which it finds no better place.
        """
        return np.maximum(below_one(self._log_r(x))[0], _LEAST_R)

    def levelled(self, x: Floats) -> Floats:
        """Parameters of the same motion whose deviations of single impacts have the mean zero."""
        same = x.copy()
        if self.spread is not None and x.size > FIXED:
            mean = float(np.mean(x[FIXED:]))
            same[_LOG_R] += self.spread * mean / _R_STEP
            same[FIXED:] -= mean
        return same

    def motion(self, x: Floats, impacts: int) -> FreeRocking:
        """The motion of these parameters."""
        alpha = self.alpha * math.exp(min(max(ALPHA_PRIOR * x[3], -0.5), 0.5))
        lean = min(max(LEAN_PRIOR_RAD * x[LEAN], -_MOST_LEAN * alpha), _MOST_LEAN * alpha)
        theta0 = min(max(self.theta0 + _THETA0_STEP_RAD * x[0], 1e-3), 0.97 * (alpha + self.side * lean))
        return free_rocking(
            self.side * theta0,
            self.restitutions(x),
            self.p * math.exp(P_PRIOR * x[2]),
            alpha,
            release_s=self.release_s + _RELEASE_STEP_S * x[1],
            smallest_peak_rad=0.0,
            max_impacts=impacts + 1,
            lean_rad=lean,
        )

    def residual(self, x: Floats, span: int, stop_s: float) -> Floats:
        """(points + priors,) of the points up to `stop_s`, with `span` impacts in the motion."""
        inside = self.time_s <= stop_s
        model = self._rotation(x, self._course(x, span, self.time_s[inside]), self.time_s[inside])
        priors = x[held(x.size)]
        return np.concatenate(((model - self.rotation_rad[inside]) / self.sigma, priors))

    def jacobian(self, x: Floats, span: int, stop_s: float) -> Floats:
        """Derivatives of `residual`.

        A half-cycle depends on its energy and on when it begins; those depend on θ0, the release and
        every r before through sums. So all columns of r need one further evaluation, not one each.
        """
        time = self.time_s[self.time_s <= stop_s]
        course = self._course(x, span, time)
        motion, index = course.motion, course.index
        rotation = course.sign * course.rotation
        by_energy, by_peak_time = self._local(course)
        energy, peak_time = self._chain(x, motion)
        columns = by_energy[:, None] * energy[index] + by_peak_time[:, None] * peak_time[index]
        # All times after the release are as 1/p: a larger p shows later rotations.
        columns[:, 2] = -P_PRIOR * np.maximum(time - motion.release_s, 0.0) * by_peak_time
        for place in (3, LEAN):
            step = np.zeros(x.size)
            step[place] = _EPSILON
            columns[:, place] = (self.motion(x + step, span).at(time)[0] - rotation) / _EPSILON
        columns[:, 4] = ZERO_PRIOR_RAD
        priors = np.eye(x.size)[held(x.size)]
        return np.vstack((columns / self.sigma, priors))

    def _log_r(self, x: Floats) -> Floats:
        deviations = np.zeros(1) if self.spread is None else self.spread * x[FIXED:]
        return np.asarray(self.log_r + _R_STEP * x[_LOG_R] + deviations)

    def _course(self, x: Floats, span: int, time_s: Floats) -> _Course:
        key = (x.tobytes(), span, time_s.size)
        course = self._last.get(key)
        if course is None:
            motion = self.motion(x, span)
            index, local, sign = motion.locate(time_s)
            rotation, speed = half_cycle_rotation(
                local, motion.peaks_rad[index], motion.p_rad_s, motion.alphas_rad[index]
            )
            course = _Course(motion, index, local, sign, rotation, speed)
            self._last.clear()
            self._last[key] = course
        return course

    def _rotation(self, x: Floats, course: _Course, time_s: Floats) -> Floats:
        motion, model = course.motion, course.sign * course.rotation
        # A point is a mean over `POINT_S`: of a parabola that is its middle plus θ̈ h²/24.
        free = time_s > motion.release_s
        bend = -(motion.p_rad_s**2) * np.sin(motion.alphas_rad[course.index] * np.sign(model) - model) * free
        return np.asarray(model + bend * POINT_S**2 / 24.0 + ZERO_PRIOR_RAD * x[4])

    def _local(self, course: _Course) -> tuple[Floats, Floats]:
        """dθ by d(ln E) of the half-cycle at fixed time from its peak, and by d(time of its peak)."""
        motion, index, alpha = course.motion, course.index, course.motion.alphas_rad
        larger = exact_amplitude(exact_energy(motion.peaks_rad, alpha) * math.exp(_EPSILON), alpha)
        changed = half_cycle_rotation(course.local, larger[index], motion.p_rad_s, alpha[index])[0]
        return course.sign * (changed - course.rotation) / _EPSILON, -course.sign * course.speed

    def _chain(self, x: Floats, motion: FreeRocking) -> tuple[Floats, Floats]:
        """(half-cycles, parameters) d(ln E_n)/dx and d(time of peak n)/dx, for θ0, release and r."""
        n, p, alpha = motion.peaks_rad.size, motion.p_rad_s, motion.alphas_rad
        start = motion.peaks_rad[0]
        nearby = exact_energy(np.array([start - 1e-6, start, start + 1e-6]), alpha[0])
        energy = np.zeros((n, x.size))
        energy[:, 0] = _THETA0_STEP_RAD * (nearby[2] - nearby[0]) / 2e-6 / nearby[1]
        soft = below_one(self._log_r(x))[1]
        each = np.concatenate((soft, np.full(max(n - 1 - soft.size, 0), soft[-1])))[: n - 1]
        energy[1:, _LOG_R] = 2.0 * _R_STEP * np.cumsum(each)
        if self.spread is not None:
            for k in range(x.size - FIXED):
                energy[k + 1 :, FIXED + k] = 2.0 * self.spread * soft[k]
            # Impacts beyond the last deviation use the last r again.
            beyond = np.maximum(np.arange(n) - (x.size - FIXED), 0)
            energy[:, -1] += 2.0 * self.spread * soft[-1] * beyond
        energies = exact_energy(motion.peaks_rad, alpha)
        larger = exact_amplitude(energies * math.exp(_EPSILON), alpha)
        quarter = exact_quarter_period(motion.peaks_rad, p, alpha)
        by_energy = (exact_quarter_period(larger, p, alpha) - quarter) / _EPSILON
        # Peak n comes a quarter after impact n, impact n after the first quarter and n − 1 halves.
        before = np.tril(np.full((n, n), 2.0), -1) + np.eye(n)
        before[:, 0] = 1.0
        before[0] = 0.0
        peak_time = before @ (by_energy[:, None] * energy)
        peak_time[:, 1] = _RELEASE_STEP_S
        return energy, peak_time
