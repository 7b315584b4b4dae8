"""Whether one r holds for a test: how single impacts differ, and what is lost between them.

Housner's block multiplies its speed by the same r at every impact and loses nothing in between. Each impact
shows its own ratio by the speeds just before and after it, fitted apart in the two half-cycles beside it:

    ln(|θ̇⁺_n| / |θ̇⁻_n|) = ln r + b ln(v_n / v_mean) + d s_n / 2 + scatter

with v_n the speed before it and s_n = ± 1 the side that it ends on. b is not zero where r depends on the
size of the motion (bouncing, twist, a rounded edge), d where the edges differ. Half-cycles fitted with a
basis that is free to lose speed show ln(|θ̇ at the end| / |θ̇ at the start|), which is not zero where
friction or drag acts. The half-cycles beside an impact cross zero at one instant; where the second begins
later, the wall yields meanwhile. Where it begins earlier, the wall hopped: both edges were off the ground,
nothing slowed its turning, and its motion after the hop, followed back, crosses zero before it was there.

The half-cycles should be fitted with the wall's own p and α: nominal ones that are off by 1 % bend all of
them alike, and the crossings by 10 to 30 µs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr

from daq_app.rocking.motion.swings import MotionTrack

Floats = NDArray[np.float64]

_USABLE_SIGMA: Final = 0.05
"""ln-ratios of single impacts or half-cycles known worse than this are not used."""
_FEWEST_IMPACTS: Final = 8
"""Impacts below which the three coefficients are not told from scatter."""
_FEWEST_HALF_CYCLES: Final = 4
"""Half-cycles below which a loss between impacts is not told from scatter."""
_ODD_POWER: Final = 3
"""A basis with it may end slower than it begins; one without cannot."""
_ZERO_KEPT: Final = 0.1
"""Share of the zero's error that crossings keep at least: noise alone may seem smaller than it is."""
_ROUNDS: Final = 60
_LEAST_CHANCE: Final = 1e-300
"""Smaller ones have no normal deviate."""
_LONGEST_HOP_S: Final = 0.05
"""A hop is not taken for longer: near r = 1 a pause says nothing of its length."""


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A change of ln r with its standard uncertainty and what chance alone makes of it."""

    value: float
    sigma: float
    chance: float
    """Probability that scatter alone gives a value so far from zero, on either side."""


@dataclass(frozen=True, slots=True)
class ImpactPattern:
    """How impacts differ within a test; None where too few are known."""

    by_speed: Coefficient | None
    """Change of ln r from the fastest to the slowest impact used."""
    by_side: Coefficient | None
    """ln r of impacts that end a lean to +x less that of the others."""
    between: Coefficient | None
    """Mean of ln of the speed that a half-cycle keeps from one impact to the next."""
    pause: Coefficient | None
    """Time from the zero crossing before an impact to the one after it at the mean speed, s; negative where
    it hops. Joints yield for about as long at every impact, hops last in proportion to its speed: of these
    two shapes the one that chance makes more seldom, and its chance counts twice."""
    slowed_1_s: float
    """What gravity changes the speed by in a second, as a share of the mean speed; NaN where not known."""
    r_fast: float
    """r by the regression at the fastest impact used; NaN where there is none."""
    r_slow: float
    impacts: int = 0
    """Impacts behind `by_speed` and `by_side`."""

    @property
    def hop_s(self) -> float:
        """How long the wall is off the ground where the pause is negative; 0 where it is not.

        Both shocks of a hop are taken for equal: it turns on at √r of the speed before, v, for a time t. Its
        motion after the hop, followed back through that rotation, has the speed r v. So the pause is
        t − t √r / r.
        """
        r = 0.5 * (self.r_fast + self.r_slow)
        if self.pause is None or self.pause.value >= 0.0 or not r < 1.0:
            return 0.0
        return min(-self.pause.value / (1.0 / math.sqrt(r) - 1.0), _LONGEST_HOP_S)

    @property
    def change_with_speed(self) -> float:
        """By how much r changes from the fastest to the slowest impact, beyond what its error makes of it; 0
        where nothing is known."""
        if self.by_speed is None:
            return 0.0
        beyond = self.by_speed.value**2 - self.by_speed.sigma**2
        return 0.5 * (self.r_fast + self.r_slow) * math.sqrt(max(beyond, 0.0))

    @property
    def sigma_r_by_speed(self) -> float:
        """Standard uncertainty that a change of r with speed adds to the r of a test.

        r of its impacts lies anywhere between those of the fastest and the slowest: a rectangular
        distribution as wide as the change (JCGM 100:2008, 4.3.7). The change is the mean over both models, r
        that changes and r that does not (Hoeting and others, 1999), weighted by the Bayesian information
        criterion at even odds beforehand: the first has one parameter more, and of n impacts it must show a
        change of more than √(ln n) standard errors to be the likelier one. Scatter alone shows a change
        beyond its error in one test of three.
        """
        if self.by_speed is None:
            return 0.0
        deviate = float(ndtri(0.5 * max(self.by_speed.chance, _LEAST_CHANCE)))
        odds_of_none = math.sqrt(self.impacts) * math.exp(-0.5 * deviate**2)
        return self.change_with_speed / (1.0 + odds_of_none) / math.sqrt(12.0)


def impact_pattern(track: MotionTrack) -> ImpactPattern:
    """Compare the impacts and half-cycles of a track."""
    by_speed, by_side, r_fast, r_slow, impacts = _impacts(track)
    pause, slowed = _pause(track)
    return ImpactPattern(by_speed, by_side, _between(track), pause, slowed, r_fast, r_slow, impacts)


def _impacts(track: MotionTrack) -> tuple[Coefficient | None, Coefficient | None, float, float, int]:
    before, after = np.array(track.speeds_before_rad_s), np.array(track.speeds_after_rad_s)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.log(np.abs(after) / np.abs(before))
        own_before = np.array(track.sigma_speeds_before_rad_s) / np.abs(before)
        own_after = np.array(track.sigma_speeds_after_rad_s) / np.abs(after)
    usable = np.isfinite(ratio) & (np.hypot(own_before, own_after) < _USABLE_SIGMA)
    if np.count_nonzero(usable) < _FEWEST_IMPACTS:
        return None, None, math.nan, math.nan, 0
    zero = _zero_error(track, before, after)
    covariance = np.diag(own_before**2 + own_after**2) + np.outer(zero, zero)
    for n, arc in enumerate(track.arcs[1:]):
        # A half-cycle that cannot lose speed has one error of speed for the impacts at both of its ends.
        if arc is not None and _ODD_POWER not in arc.powers and n + 1 < ratio.size:
            covariance[n, n + 1] -= own_after[n] * own_before[n + 1]
            covariance[n + 1, n] = covariance[n, n + 1]
    log_speed = np.log(np.abs(before[usable]))
    centred = log_speed - log_speed.mean()
    side = np.sign(-before[usable])
    design = np.column_stack([np.ones(centred.size), centred, side / 2.0])
    level, slope, by_side = _regress(ratio[usable], design, covariance[np.ix_(usable, usable)])
    fall = float(centred.min() - centred.max())
    by_speed = Coefficient(slope.value * fall, slope.sigma * abs(fall), slope.chance)
    r_fast, r_slow = np.exp(level.value + slope.value * np.array([centred.max(), centred.min()]))
    return by_speed, by_side, float(r_fast), float(r_slow), centred.size


def _zero_error(track: MotionTrack, before: Floats, after: Floats) -> Floats:
    """(impacts,) what the standard uncertainty of the zero makes of each ln-ratio: by turns up and down."""
    pull = _pull(track) * track.settings.zero_sigma_rad
    return np.asarray(np.sign(before) * pull * (1.0 / after**2 + 1.0 / before**2))


def _pull(track: MotionTrack) -> float:
    """Angular acceleration of the block near upright, rad/s²."""
    return track.settings.p_rad_s**2 * math.sin(track.settings.alpha_rad)


def _between(track: MotionTrack) -> Coefficient | None:
    known = [(arc.kept, arc.sigma_kept) for arc in track.arcs[1:] if arc is not None]
    kept, sigma = np.array(known, dtype=np.float64).reshape(-1, 2).T
    usable = np.isfinite(kept) & (sigma < _USABLE_SIGMA)
    if np.count_nonzero(usable) < _FEWEST_HALF_CYCLES:
        return None
    kept, sigma = kept[usable], sigma[usable]
    return _multiple(kept, np.ones(kept.size), sigma)


def _pause(track: MotionTrack) -> tuple[Coefficient | None, float]:
    pauses, sigmas, speeds = [], [], []
    for before, after in pairwise(track.arcs):
        if before is None or after is None:
            continue
        speed = abs(before.speed_end_rad_s)
        pauses.append(after.start_s - before.end_s)
        # The zero moves both crossings alike and does not count.
        zero = track.settings.zero_sigma_rad / speed
        noise = before.sigma_end_s**2 + after.sigma_start_s**2 - 2.0 * zero**2
        sigmas.append(math.sqrt(max(noise, (_ZERO_KEPT * zero) ** 2)))
        speeds.append(speed)
    if len(pauses) < _FEWEST_IMPACTS:
        return None, math.nan
    weights = 1.0 / np.square(sigmas)
    mean_speed = float(weights @ speeds / weights.sum())
    shapes = np.ones(len(pauses)), np.array(speeds) / mean_speed
    found = [_multiple(np.array(pauses), shape, np.array(sigmas)) for shape in shapes]
    likelier = min(found, key=lambda pause: pause.chance)
    pause = replace(likelier, chance=min(len(found) * likelier.chance, 1.0))
    return pause, _pull(track) / mean_speed


def _coefficient(value: float, sigma: float, freedom: float) -> Coefficient:
    return Coefficient(value, sigma, 2.0 * float(stdtr(freedom, -abs(value) / sigma)))


def _multiple(values: Floats, shape: Floats, sigmas: Floats) -> Coefficient:
    """How many times `shape` the values are, by weighted least squares.

    For what a block does not do at all, so that it cannot scatter: where the values leave more than their
    errors, all errors count as too small by the same factor (Birge, 1932).
    """
    scaled, freedom = shape / sigmas, values.size - 1
    squares = float(scaled @ scaled)
    value = float(scaled @ (values / sigmas)) / squares
    left = values / sigmas - value * scaled
    return _coefficient(value, math.sqrt(max(float(left @ left) / freedom, 1.0) / squares), freedom)


def _regress(values: Floats, design: Floats, covariance: Floats) -> list[Coefficient]:
    """Generalised least squares: the coefficient of each column of `design`.

    A scatter that is alike for all values comes to their own errors, just so large that the weighted
    residuals are as many as the degrees of freedom (Paule and Mandel, 1982); none where they are fewer. A few
    values that are known well may be all that tell how large it is: chance is Student's with the degrees of
    freedom that this leaves of a coefficient's variance (Satterthwaite; Giesbrecht and Burns, 1985).
    """
    freedom = values.size - design.shape[1]
    low, high, scatter = 0.0, 4.0 * float(values.var()) + 1e-8, 0.0
    misfit = _solve(values, design, covariance)[2]
    if misfit > freedom:
        for _ in range(_ROUNDS):
            scatter = 0.5 * (low + high)
            misfit = _solve(values, design, covariance + scatter * np.eye(values.size))[2]
            low, high = (scatter, high) if misfit > freedom else (low, scatter)
            if high - low < 1e-4 * high:
                break
    total = covariance + scatter * np.eye(values.size)
    solution, normal, _ = _solve(values, design, total)
    inverse, weights = np.linalg.inv(normal), np.linalg.inv(total)
    carried = inverse @ design.T @ weights
    projector = weights - weights @ design @ carried
    by_scatter = np.einsum("ij,ij->i", carried, carried)
    variances = np.diag(inverse)
    known = variances**2 * np.einsum("ij,ij->", projector, projector) / by_scatter**2
    return [
        _coefficient(value, sigma, min(own, float(freedom)))
        for value, sigma, own in zip(
            solution.tolist(), np.sqrt(variances).tolist(), known.tolist(), strict=True
        )
    ]


def _solve(values: Floats, design: Floats, covariance: Floats) -> tuple[Floats, Floats, float]:
    weighted = np.linalg.solve(covariance, design)
    normal = design.T @ weighted
    solution = np.linalg.solve(normal, weighted.T @ values)
    left = values - design @ solution
    misfit = float(left @ np.linalg.solve(covariance, left))
    return np.asarray(solution, dtype=np.float64), np.asarray(normal, dtype=np.float64), misfit
