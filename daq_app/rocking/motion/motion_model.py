"""The model behind the fit of the whole motion: parameters to residuals, and the exact Jacobian.

Parameters are scaled deviations from the start: [θ0, release, ln p, ln α, zero, mean ln r, lean, inset,
then the deviation of ln r of each impact]. The lean makes α larger to one side and smaller to the other; the
inset is that of the strip which both edges yield in (`theory.yielding_edge`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from daq_app.rocking.theory.housner import exact_energy
from daq_app.rocking.theory.yielding_edge import HalfCycles, YieldingEdge, YieldingRocking, free_rocking_on

Floats = NDArray[np.float64]

P_PRIOR, ALPHA_PRIOR, ZERO_PRIOR_RAD = 0.05, 0.10, 5e-4
LEAN_PRIOR_RAD = 2e-3
"""Standard deviation of half the difference of α of both sides beforehand, rad: a base 1 mm/m off level and a
centre of mass of 1.4 m height 2 mm off the middle (assumed). Half-cycles tell it a hundred times better;
lowering it makes α, p and single r take up what a wall leans by."""
POINT_S = 0.008
"""The fitted points are means over this time."""
INSET_PRIOR_RAD = 1e-3
"""Standard deviation beforehand of the inset of edges that yield, rad: 1.5 mm, half of a strip of 3 mm, over
1.5 m from the edge to the centre of mass (assumed). It holds insets below 0 as well, for sharp edges are then
found sharp in the mean. Raising it widens p and α of tests that tell no inset, those from 0.15 α and those
of few impacts; lowering it puts p and α of edges that yield by as much off beyond their errors."""
_LIFT_RAD, _LIFT_FACTOR = 4e-3, 3.0
"""θ₁ of the strip, rad, and the factor that it is known to: 3 mm under 50 kN, 1.2 m long and as stiff as
10 mm of stone with 20 GPa (assumed). The motion hardly tells it: it is in the errors and not searched for.
Raising the factor widens p and α of edges that yield, in proportion to their inset."""
FIXED = 8
"""Parameters before the deviations of single impacts."""
_LOG_R, LEAN, INSET = 5, 6, 7
"""Places of the mean ln r, the lean and the inset among them."""
_HELD = (2, 3, 4, LEAN, INSET)
"""Parameters that a prior holds: p, α, the zero, the lean and the inset; so are the deviations of single
impacts."""
_THETA0_STEP_RAD, _RELEASE_STEP_S, _R_STEP = 1e-3, 0.01, 0.01
_SOFT = 100.0
_LEAST_R = 1e-3
_MOST_LEAN = 0.2
"""Share of α that the lean is kept below, and the inset: a search that strays goes no further."""
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

    motion: YieldingRocking
    index: NDArray[np.int_]
    """Half-cycle of each instant."""
    local: Floats
    """Time from its peak."""
    sign: Floats
    rotation: Floats
    """Unsigned, as the half-cycle has it."""


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
    edges_yield: bool = True
    """Else the inset moves nothing."""
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

    def motion(self, x: Floats, impacts: int, lift_rad: float = _LIFT_RAD) -> YieldingRocking:
        """The motion of these parameters on a strip that lifts at `lift_rad`."""
        alpha = self.alpha * math.exp(min(max(ALPHA_PRIOR * x[3], -0.5), 0.5))
        lean = min(max(LEAN_PRIOR_RAD * x[LEAN], -_MOST_LEAN * alpha), _MOST_LEAN * alpha)
        theta0 = min(max(self.theta0 + _THETA0_STEP_RAD * x[0], 1e-3), 0.97 * (alpha + self.side * lean))
        inset = INSET_PRIOR_RAD * x[INSET] if self.edges_yield else 0.0
        inset = min(max(inset, -_MOST_LEAN * alpha), _MOST_LEAN * alpha)
        return free_rocking_on(
            YieldingEdge(inset, lift_rad),
            self.side * theta0,
            self.restitutions(x),
            self.p * math.exp(P_PRIOR * x[2]),
            alpha,
            release_s=self.release_s + _RELEASE_STEP_S * x[1],
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
        larger = motion.half_cycles.with_energy_times(math.exp(_EPSILON))
        by_energy, by_peak_time = self._local(course, larger)
        energy, peak_time = self._chain(x, motion, larger)
        columns = by_energy[:, None] * energy[index] + by_peak_time[:, None] * peak_time[index]
        # All times after the release are as 1/p: a larger p shows later rotations.
        columns[:, 2] = -P_PRIOR * np.maximum(time - motion.sharp.release_s, 0.0) * by_peak_time
        for place in (3, LEAN, INSET) if self.edges_yield else (3, LEAN):
            step = np.zeros(x.size)
            step[place] = _EPSILON
            columns[:, place] = (self.motion(x + step, span).rotation(time) - rotation) / _EPSILON
        columns[:, 4] = ZERO_PRIOR_RAD
        priors = np.eye(x.size)[held(x.size)]
        return np.vstack((columns / self.sigma, priors))

    def by_lift(self, x: Floats, span: int, stop_s: float) -> Floats:
        """What a standard deviation of ln θ₁ makes of the rows of `residual` that are points, (points,)."""
        time = self.time_s[self.time_s <= stop_s]
        early, late = (
            self.motion(x, span, _LIFT_RAD * f).rotation(time) for f in (1.0 / _LIFT_FACTOR, _LIFT_FACTOR)
        )
        return (late - early) / (2.0 * self.sigma)

    def _log_r(self, x: Floats) -> Floats:
        deviations = np.zeros(1) if self.spread is None else self.spread * x[FIXED:]
        return np.asarray(self.log_r + _R_STEP * x[_LOG_R] + deviations)

    def _course(self, x: Floats, span: int, time_s: Floats) -> _Course:
        key = (x.tobytes(), span, time_s.size)
        course = self._last.get(key)
        if course is None:
            motion = self.motion(x, span)
            index, local, sign = motion.locate(time_s)
            rotation = motion.half_cycles.rotation(index, local)
            course = _Course(motion, index, local, sign, rotation)
            self._last.clear()
            self._last[key] = course
        return course

    def _rotation(self, x: Floats, course: _Course, time_s: Floats) -> Floats:
        motion, model = course.motion, course.sign * course.rotation
        # A point is a mean over `POINT_S`: of a parabola that is its middle plus θ̈ h²/24.
        sharp = motion.sharp
        free = time_s > sharp.release_s
        bend = -(sharp.p_rad_s**2) * np.sin(sharp.alphas_rad[course.index] * np.sign(model) - model) * free
        return np.asarray(model + bend * POINT_S**2 / 24.0 + ZERO_PRIOR_RAD * x[4])

    def _local(self, course: _Course, larger: HalfCycles) -> tuple[Floats, Floats]:
        """dθ by d(ln E) of the half-cycle at fixed time from its peak, and by d(time of its peak).

        `larger`: the half-cycles with e^`_EPSILON` of their energies.
        """
        changed = larger.rotation(course.index, course.local)
        speed = np.sign(course.local) * course.motion.half_cycles.speed(course.index, course.rotation)
        return course.sign * (changed - course.rotation) / _EPSILON, course.sign * speed

    def _chain(self, x: Floats, motion: YieldingRocking, larger: HalfCycles) -> tuple[Floats, Floats]:
        """(half-cycles, parameters) d(ln E_n)/dx and d(time of peak n)/dx, for θ0, release and r."""
        cycles, alpha = motion.half_cycles, motion.sharp.alphas_rad[0]
        n, start = cycles.peaks_rad.size, cycles.peaks_rad[0]
        # E = ∫ lever dθ: of unit size is what overturns the block.
        lever = np.sin(alpha - start) - cycles.edge.shortening(start)
        potential = (1.0 - math.cos(alpha)) * exact_energy(cycles.sharp_peaks_rad[0], alpha)
        energy = np.zeros((n, x.size))
        energy[:, 0] = _THETA0_STEP_RAD * lever / potential
        soft = below_one(self._log_r(x))[1]
        each = np.concatenate((soft, np.full(max(n - 1 - soft.size, 0), soft[-1])))[: n - 1]
        energy[1:, _LOG_R] = 2.0 * _R_STEP * np.cumsum(each)
        if self.spread is not None:
            for k in range(x.size - FIXED):
                energy[k + 1 :, FIXED + k] = 2.0 * self.spread * soft[k]
            # Impacts beyond the last deviation use the last r again.
            beyond = np.maximum(np.arange(n) - (x.size - FIXED), 0)
            energy[:, -1] += 2.0 * self.spread * soft[-1] * beyond
        by_energy = (larger.quarters_s - cycles.quarters_s) / _EPSILON
        # Peak n comes a quarter after impact n, impact n after the first quarter and n − 1 halves.
        before = np.tril(np.full((n, n), 2.0), -1) + np.eye(n)
        before[:, 0] = 1.0
        before[0] = 0.0
        peak_time = before @ (by_energy[:, None] * energy)
        peak_time[:, 1] = _RELEASE_STEP_S
        return energy, peak_time
