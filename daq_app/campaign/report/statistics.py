"""Means over tests: each test has its own standard error, and tests differ among themselves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its `special` is loaded with the first use: what draws needs none of it
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, slots=True)
class GroupMean:
    """Mean of several tests with its 95 % confidence interval."""

    mean: float
    standard_error: float
    low95: float
    high95: float
    scatter: float
    """Standard deviation of the true values from test to test (random effect)."""
    tests: int

    @property
    def known(self) -> bool:
        """Whether there were tests at all."""
        return self.tests > 0


NO_TESTS = GroupMean(math.nan, math.nan, math.nan, math.nan, math.nan, 0)


def random_effects_mean(values: Sequence[float], standard_errors: Sequence[float]) -> GroupMean:
    """Mean of `values` (n,) of which each is known to its own standard error (n,).

    Random-effects model, value_i = mean + scatter + error_i; the scatter by restricted maximum
    likelihood, the interval by Hartung and Knapp's t with n − 1 degrees of freedom, never narrower
    than the plain one. Values that are not finite are left out. One value has an interval from its
    own standard error alone.
    """
    y, s = _known(values, standard_errors)
    if y.size == 0:
        return NO_TESTS
    if y.size == 1:
        reach = 1.959964 * float(s[0])
        return GroupMean(float(y[0]), float(s[0]), float(y[0]) - reach, float(y[0]) + reach, math.nan, 1)
    scatter = _scatter([(y, s)])
    weights = 1.0 / (s**2 + scatter**2)
    mean = float(weights @ y / weights.sum())
    spread = float(weights @ (y - mean) ** 2 / (y.size - 1))
    error = math.sqrt(max(spread, 1.0) / float(weights.sum()))
    reach = student_reach(y.size - 1) * error
    return GroupMean(mean, error, mean - reach, mean + reach, scatter, int(y.size))


def student_reach(freedom: int) -> float:
    """Half width, in standard errors, of the 95 % interval of Student's distribution of `freedom` ≥ 1."""
    return float(scipy.special.stdtrit(freedom, 0.975))


@dataclass(frozen=True, slots=True)
class SharedScatter:
    """What tests scatter by from one to the next, which several groups of them have in common."""

    scatter: float
    """Standard deviation of the true values about their group's."""
    stretch: float
    """Factor of standard errors where values scatter more than `scatter` and their errors make them; or 1."""
    degrees_of_freedom: int
    """How many values are free to show it; 0 where every group has one."""

    def error_of_mean(self, standard_errors: Sequence[float]) -> float:
        """Standard error of the weighted mean of tests that are known to these errors (n,)."""
        _, s = _known([0.0] * len(standard_errors), standard_errors)
        return self.stretch / math.sqrt(float(np.sum(1.0 / (s**2 + self.scatter**2))))


def shared_scatter(groups: Sequence[tuple[Sequence[float], Sequence[float]]]) -> SharedScatter:
    """The scatter of several groups of (values, standard errors), each about a mean of its own.

    Restricted maximum likelihood over all groups, and Hartung and Knapp's factor, never below one.
    """
    known = [(y, s) for y, s in (_known(*group) for group in groups) if y.size]
    freedom = sum(y.size - 1 for y, _ in known)
    if not freedom:
        return SharedScatter(0.0, 1.0, 0)
    scatter = _scatter(known)
    squares = 0.0
    for y, s in known:
        weights = 1.0 / (s**2 + scatter**2)
        squares += float(weights @ (y - weights @ y / weights.sum()) ** 2)
    return SharedScatter(scatter, math.sqrt(max(squares / freedom, 1.0)), freedom)


def _known(values: Sequence[float], standard_errors: Sequence[float]) -> tuple[Floats, Floats]:
    """Values and their errors, those that are not finite left out."""
    y, s = np.asarray(values, dtype=np.float64), np.asarray(standard_errors, dtype=np.float64)
    if y.shape != s.shape:
        raise ValueError(f"{y.size} values but {s.size} standard errors")
    good = np.isfinite(y) & np.isfinite(s) & (s > 0)
    return y[good], s[good]


def _scatter(groups: Sequence[tuple[Floats, Floats]]) -> float:
    """Restricted maximum likelihood of the standard deviation between tests, each group about its mean."""

    def cost(tau: float) -> float:
        total = 0.0
        for y, s in groups:
            variance = s**2 + tau**2
            weights = 1.0 / variance
            mean = weights @ y / weights.sum()
            total += np.log(variance).sum() + np.log(weights.sum()) + weights @ (y - mean) ** 2
        return float(total)

    top = max(3.0 * float(y.std()) + float(s.max()) for y, s in groups)
    tau = _least(cost, 0.0, top)
    return 0.0 if cost(0.0) <= cost(tau) else tau


def _least(cost: Callable[[float], float], low: float, high: float) -> float:
    """Where a function with one minimum in low … high is least, to 1e-9 of the range (golden section)."""
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = cost(left), cost(right)
    end = 1e-9 * (high - low)
    while high - low > end:
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = cost(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = cost(right)
    return (low + high) / 2.0
