"""r by a fit of the whole motion: exact Housner rocking to the recorded rotation, all at once.

Free: θ0, release time, p, α of either side, what the edges yield by, the zero of the rotation and r; p and α
are held to their nominal values by 5 % and 10 %. Where r scatters from impact to impact, each impact has its
own deviation, held to zero by that scatter: the standard error of the mean r then says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.special import stdtrit

from daq_app.rocking.means import means_over
from daq_app.rocking.motion.fit_errors import covariances
from daq_app.rocking.motion.motion_model import (
    ALPHA_PRIOR,
    FIXED,
    INSET,
    INSET_PRIOR_RAD,
    P_PRIOR,
    POINT_S,
    ZERO_PRIOR_RAD,
    MotionModel,
    below_one,
    held,
)
from daq_app.rocking.motion.swings import REST_ZERO_SIGMA_RAD
from daq_app.rocking.theory.housner import exact_amplitude, exact_energy, exact_quarter_period

Floats = NDArray[np.float64]

_SMALLEST_SHARE = 0.02
"""The motion is fitted until its peaks fall below this share of the first."""
_MOST_IMPACTS = 100
"""Impacts from the release on that are fitted at most: a decay with r = 0.98 is at its smallest share then. A
wall that a shaking floor keeps rocking has hundreds, with a deviation for each. Raising it makes such a fit
last minutes."""

_POOR = 1.5
"""A fit that leaves more than this many times the noise may have ended in a minimum, not the least."""
_NO_CLEAN_FALL = 4.0
"""Misfit in noises above which the motion is fitted from its first impact on: a wall that is let go slowly,
or kicked, falls as no free block does, and rocks on as one."""
_FALL_TO_BLAME = 0.5
"""Where neither explains the motion, the fit without the fall counts if it leaves less than this share of
what the fit with it leaves. Raising it leaves the fall out where the rest is no better understood."""
_HIGHEST = 0.99
"""Share of the energy at which a block falls over that a motion is begun with at most."""
_FIRST_IN_PHASE = 4
"""Impacts that are fitted first, so few that none is out of phase where α is off by a quarter."""
_EVALUATIONS = 60
"""Residuals that one search works out at most; one that comes to an end takes some twenty."""


@dataclass(frozen=True, slots=True)
class MotionFit:
    """Result of the fit; standard errors include the misfit (scaled by its χ² where above 1)."""

    r: float
    standard_error: float
    p_rad_s: float
    sigma_p_rad_s: float
    """NaN, as that of α, in the analysis of a wall that is no rigid block with one r."""
    alpha_rad: float
    sigma_alpha_rad: float
    """Of `alpha_rad`, the mean of both sides."""
    theta0_rad: float
    release_s: float
    zero_rad: float
    restitutions: tuple[float, ...]
    """r of each impact of the fitted span."""
    impacts: int
    residual_rad: float
    """rms of what the model leaves."""
    noise_rad: float
    """rms expected of a perfect model at the fitted points."""
    from_release: bool = True
    """Whether the fall is fitted; else θ0 and release are those of a free fall to the same impact."""
    degrees_of_freedom: float = math.inf
    """Degrees of freedom of the standard error of r, which knows what r scatters by from these impacts only.
    They are infinite where the usual scatter is taken."""
    lean_rad: float = 0.0
    """By how much α is larger where θ > 0, and smaller where θ < 0: the base is off level, or a mass off the
    middle."""
    inset_rad: float = 0.0
    """By how much sin α is smaller where the wall is upright than on sharp edges: the edges yield, and the
    wall stands on a strip (`YieldingEdge.inset_rad`). p and α are those of sharp edges."""
    sigma_inset_rad: float = math.inf
    sigma_inset_if_sharp_rad: float = math.inf
    """The same without what is not known of a strip, which sharp edges do not have."""

    @property
    def explains_the_motion(self) -> bool:
        """Whether the misfit is no more than twice the noise."""
        return self.residual_rad < 2.0 * self.noise_rad

    def interval95(self) -> tuple[float, float]:
        """95 % confidence interval, Student's."""
        reach = float(stdtrit(self.degrees_of_freedom, 0.975)) * self.standard_error
        return self.r - reach, self.r + reach


def fit_motion(
    time_s: Floats,
    rotation_rad: Floats,
    *,
    release_s: float,
    theta0_rad: float,
    impacts_s: list[float],
    peaks_rad: list[float],
    speeds_rad_s: list[float],
    r: float,
    scatter: float | None,
    noise_rad: float,
    p_rad_s: float,
    alpha_rad: float,
    edges_yield: bool = True,
) -> MotionFit | None:
    """Fit the rotation (n,) from release to the last half-cycle worth it.

    None with too few impacts, and where r would be 0.993 and more: no wall loses as little as that.

    `r`, `impacts_s`, `peaks_rad` (release first) and `speeds_rad_s` (at the impacts) start the fit;
    `noise_rad` is the rms of one sample.
    `scatter` is the relative standard deviation of r from impact to impact (at least 0.0003 is
    allowed for); None says that r is the same at every impact. Without `edges_yield` edges are held to be
    sharp, and the errors hold for sharp ones only.
    """
    count = _span(peaks_rad, len(impacts_s))
    if count < 2 or not 0.0 < r <= 1.0:
        return None
    stop_s = impacts_s[count - 1] + 0.5 * (
        impacts_s[count] - impacts_s[count - 1] if count < len(impacts_s) else 0.0
    )
    side, log_r = 1.0 if theta0_rad > 0 else -1.0, math.log(r)
    known = (impacts_s, speeds_rad_s, p_rad_s, alpha_rad)
    record = _Record(time_s, rotation_rad, noise_rad, *known, count, stop_s, side, edges_yield)
    at_release = _Start(release_s - 0.1, release_s, abs(theta0_rad), log_r, scatter)
    whole = record.fit(at_release, thorough=False)
    if whole is None or whole.residual_rad < _NO_CLEAN_FALL * whole.noise_rad:
        poor = whole is None or whole.residual_rad > _POOR * whole.noise_rad
        return record.fit(at_release, thorough=True) if poor else whole
    amplitude, begin_s, own = _fall_to_first_impact(
        impacts_s[0], peaks_rad[1], _deviations(speeds_rad_s[1:], count, log_r), log_r, p_rad_s, alpha_rad
    )
    # What lets go slowly may hold the wall back beyond the impact, until it first turns: midway between two.
    at_turn = _Start(0.5 * (impacts_s[0] + impacts_s[1]), begin_s, amplitude, own, scatter)
    later: MotionFit | None = None
    for thorough in (False, True):
        if math.isfinite(begin_s) and (later is None or later.residual_rad > _POOR * later.noise_rad):
            later = record.fit(at_turn, thorough=thorough)
    if later is None or not later.explains_the_motion:
        whole = record.fit(at_release, thorough=True)
        if later is None or (whole is not None and later.residual_rad > _FALL_TO_BLAME * whole.residual_rad):
            return whole
    return replace(later, from_release=False)


@dataclass(frozen=True, slots=True)
class _Start:
    """Where a fit begins in the record, and the motion that it starts from."""

    first_s: float
    """Time of the first point that is fitted."""
    begin_s: float
    """Release."""
    amplitude_rad: float
    log_r: float
    scatter: float | None


@dataclass(frozen=True, slots=True)
class _Record:
    """A recorded rotation with its impacts, of which the first `count`, up to `stop_s`, are fitted."""

    time_s: Floats
    rotation_rad: Floats
    noise_rad: float
    impacts_s: list[float]
    speeds_rad_s: list[float]
    p_rad_s: float
    alpha_rad: float
    count: int
    stop_s: float
    side: float
    edges_yield: bool

    def fit(self, start: _Start, *, thorough: bool) -> MotionFit | None:
        """None with too few points."""
        t, y, sigma = _points(self.time_s, self.rotation_rad, start.first_s, self.stop_s, self.noise_rad)
        if t.size < 4 * FIXED:
            return None
        spread = None if start.scatter is None else max(start.scatter, 3e-4)
        own = np.zeros(0)
        if spread is not None:
            own = _deviations(self.speeds_rad_s, self.count, start.log_r) / spread
        wall = (self.side, self.p_rad_s, self.alpha_rad, start.log_r, spread, self.edges_yield)
        problem = MotionModel(t, y, sigma, start.begin_s, start.amplitude_rad, *wall)
        return _stepwise(problem, own, self.impacts_s, self.count, self.stop_s, thorough=thorough)


def _fall_to_first_impact(
    impact_s: float, next_peak_rad: float, deviations: Floats, log_r: float, p_rad_s: float, alpha_rad: float
) -> tuple[float, float, float]:
    """Amplitude and release of a free fall that leads to this impact and the peak after it, and ln r.

    The fall that was is in φ0 of CRT and in the first speed: r is that of the impacts that are left.
    """
    own = log_r + float(np.median(deviations[:-1]))
    energy = exact_energy(np.array([next_peak_rad]), alpha_rad) * math.exp(-2.0 * own)
    amplitude = exact_amplitude(np.minimum(energy, _HIGHEST), alpha_rad)
    fall_s = float(exact_quarter_period(amplitude, p_rad_s, alpha_rad)[0])
    return float(amplitude[0]), impact_s - fall_s, own


def _stepwise(
    problem: MotionModel,
    start: Floats,
    impacts_s: list[float],
    count: int,
    stop_s: float,
    *,
    thorough: bool,
) -> MotionFit | None:
    """The fit of `count` impacts.

    Where r is one number, later half-cycles join once the earlier ones are in phase; where every impact has
    its own, the speeds put all of them in phase from the start, unless α or p is far from the survey's.
    `thorough`: they join anyway, and all at once in other ways as well where that leaves too much.
    """

    def joined(spans: Iterable[int], *, thorough: bool) -> OptimizeResult:
        x = np.zeros(FIXED)
        for span in spans:
            x = np.concatenate((x, start[x.size - FIXED : span]))
            end = min(impacts_s[span] if span < len(impacts_s) else stop_s, stop_s)
            solution = _least(problem, x, span, end, thorough=thorough)
            x = solution.x
        return solution

    few = min(_FIRST_IN_PHASE, count)
    growing = [few * 2**k for k in range(count.bit_length()) if few * 2**k < count]
    usual = sorted({few, count}) if problem.spread is None else [count]
    best = joined([*growing, count] if thorough else usual, thorough=False)
    if thorough and np.mean(best.fun**2) > _POOR**2:
        best = min(best, joined(usual, thorough=True), key=lambda found: float(found.cost))
    return _result(problem, best, count, stop_s)


def _least(
    problem: MotionModel, start: Floats, span: int, stop_s: float, *, thorough: bool
) -> OptimizeResult:
    """The fit of the first `span` impacts; `thorough`: where it leaves too much, in other ways as well.

    A search that used up its evaluations on its way along a valley, where the level and the deviations from
    it change against each other, begins again within a trust region, which comes to its end in some ten
    evaluations where Levenberg's steps creep, or goes on from the level that suits them.
    """
    search = partial(
        least_squares,
        problem.residual,
        jac=problem.jacobian,
        args=(span, stop_s),
        x_scale="jac",
        max_nfev=_EVALUATIONS,
    )
    best = search(start, method="lm")
    if best.status == 0 and problem.spread is not None:
        levelled = problem.levelled(best.x)
        kept = np.concatenate((levelled[:FIXED], np.clip(levelled[FIXED:], -1.0, 1.0)))
        for other, method in ((start, "trf"), (kept, "lm"), (levelled, "lm")):
            if best.status == 0:
                best = min(best, search(other, method=method), key=lambda found: float(found.cost))
    if not thorough:
        return best
    settled = np.concatenate((best.x[:FIXED], np.clip(best.x[FIXED:], -1.0, 1.0)))
    for other, method in ((start, "trf"), (settled, "lm")):
        if np.mean(best.fun**2) > _POOR**2:
            best = min(best, search(other, method=method), key=lambda found: float(found.cost))
    return best


def _span(peaks_rad: list[float], impacts: int) -> int:
    floor = _SMALLEST_SHARE * abs(peaks_rad[0])
    large = [n for n in range(1, min(len(peaks_rad), impacts)) if abs(peaks_rad[n]) >= floor]
    return min(max(large, default=0), _MOST_IMPACTS)


def _deviations(speeds_rad_s: list[float], count: int, log_r: float) -> Floats:
    """ln r of single impacts about `log_r`, from the speeds at neighbouring impacts; 0 where unknown."""
    speeds = np.abs(np.asarray(speeds_rad_s, dtype=np.float64))
    with np.errstate(invalid="ignore", divide="ignore"):
        log_ratios = np.log(speeds[1:] / speeds[:-1]) - log_r
    log_ratios = np.where(np.isfinite(log_ratios), np.clip(log_ratios, -0.2, 0.2), 0.0)
    return np.concatenate((log_ratios, np.zeros(count)))[:count]


def _points(
    time_s: Floats, rotation_rad: Floats, start_s: float, stop_s: float, noise_rad: float
) -> tuple[Floats, Floats, float]:
    """Averages over 8 ms and their noise."""
    low, high = np.searchsorted(time_s, [start_s, stop_s])
    size = max(1, round(POINT_S * (time_s.size - 1) / (time_s[-1] - time_s[0])))
    t, y = means_over(time_s[low:high], size), means_over(rotation_rad[low:high], size)
    good = np.isfinite(y)
    return t[good], y[good], noise_rad / math.sqrt(size)


def _result(problem: MotionModel, found: OptimizeResult, count: int, stop_s: float) -> MotionFit | None:
    x, sigma = found.x, problem.sigma
    data = found.fun[: found.fun.size - len(held(x.size))]
    try:
        on_known_edges, covariance = covariances(
            found.jac, data, REST_ZERO_SIGMA_RAD / sigma, problem.by_lift(x, count, stop_s)
        )
    except np.linalg.LinAlgError:
        return None
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    motion = problem.motion(x, count)
    # The level that suits deviations of equal weight is their mean: a search may end before it finds that,
    # for the motion is the same with another level and deviations to match. How far it was still to go is
    # in the error.
    deviation = 0.0 if problem.spread is None else problem.spread * float(np.mean(x[FIXED:]))
    log_r = problem.log_r + 0.01 * x[5] + deviation
    if log_r >= 0.0:
        return None
    r, slope = below_one(np.asarray(log_r))
    return MotionFit(
        r=float(r),
        standard_error=float(r * slope) * math.hypot(0.01 * float(deviations[5]), deviation),
        p_rad_s=motion.sharp.p_rad_s,
        sigma_p_rad_s=motion.sharp.p_rad_s * P_PRIOR * float(deviations[2]),
        alpha_rad=motion.sharp.alpha_rad,
        sigma_alpha_rad=motion.sharp.alpha_rad * ALPHA_PRIOR * float(deviations[3]),
        theta0_rad=motion.sharp.side * float(motion.half_cycles.peaks_rad[0]),
        release_s=motion.sharp.release_s,
        zero_rad=ZERO_PRIOR_RAD * float(x[4]),
        restitutions=tuple(float(value) for value in motion.sharp.restitution[:count]),
        impacts=count,
        residual_rad=float(np.sqrt(np.mean(data**2))) * sigma,
        noise_rad=sigma,
        degrees_of_freedom=max(count - 1, 1),
        lean_rad=motion.sharp.lean_rad,
        inset_rad=float(motion.half_cycles.edge.inset_rad),
        sigma_inset_rad=INSET_PRIOR_RAD * float(deviations[INSET]),
        sigma_inset_if_sharp_rad=INSET_PRIOR_RAD * math.sqrt(max(float(on_known_edges[INSET, INSET]), 0.0)),
    )
