"""Parameters with priors, and the unit coordinates in which everything is fitted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

NORMAL_95 = 1.96
"""Half width of the interval that holds 95 % of a Gaussian, in standard deviations."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One unknown with its prior.

    A ``linear`` parameter has a Gaussian prior N(mean, sd²); a ``log`` one has a Gaussian prior in
    its logarithm, with `mean` the median and `sd` the standard deviation of ln(value). `low` and
    `high` cut the prior off; a fit never leaves them. The unit coordinate u of a value is its
    distance from the prior's centre in prior standard deviations, so that the prior is N(0, 1).
    """

    name: str
    mean: float
    sd: float
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    scale: Literal["linear", "log"] = "linear"
    meaning: str = ""
    per_run: bool = False
    """An effect's parameter that takes its own value in every run."""
    starts: tuple[float, ...] = ()
    """Values from which a fit is started; empty means one prior sd to either side, within bounds."""
    linear: bool = False
    """The prediction is a straight line in it whose slope no other parameter changes: one column for all."""
    smallest: float = 0.0
    """Strength (on a linear scale, centred on zero) below which, to either side, there is no effect: the
    prior has nothing there."""
    usual_of: str = ""
    """Effect that this unknown of a model is the usual size of: as much of it as any sound specimen has."""

    def __post_init__(self) -> None:
        if self.sd <= 0:
            raise ValueError(f"parameter {self.name}: the prior's sd must be positive, not {self.sd}")
        if self.scale == "log" and (self.mean <= 0 or self.low < 0):
            raise ValueError(f"parameter {self.name}: a log parameter must be positive")
        if self.smallest and (self.scale == "log" or self.mean != 0.0 or self.smallest >= self.high):
            raise ValueError(f"parameter {self.name}: only a linear strength about zero has a smallest size")
        if not self.low <= self.mean <= self.high:
            raise ValueError(
                f"parameter {self.name}: prior mean {self.mean} is outside [{self.low}, {self.high}]"
            )

    def value(self, u: float) -> float:
        """Value at the unit coordinate `u`."""
        if self.scale == "log":
            return self.mean * math.exp(self.sd * u)
        return self.mean + self.sd * u

    def unit_coordinate(self, value: float) -> float:
        """Inverse of `value`."""
        if self.scale == "log":
            return math.log(value / self.mean) / self.sd
        return (value - self.mean) / self.sd

    @property
    def unit_bounds(self) -> tuple[float, float]:
        """The bounds in the unit coordinate."""
        if self.scale == "log":
            low = -math.inf if self.low <= 0 else self.unit_coordinate(self.low)
        else:
            low = self.unit_coordinate(self.low) if math.isfinite(self.low) else -math.inf
        return low, self.unit_coordinate(self.high) if math.isfinite(self.high) else math.inf

    def interval(self, u: float, sd_u: float) -> tuple[float, float]:
        """Central interval of the value, 95 %, within the bounds."""
        low, high = self.unit_bounds
        ends = (max(u - NORMAL_95 * sd_u, low), min(u + NORMAL_95 * sd_u, high))
        return self.value(min(ends[0], high)), self.value(max(ends[1], low))

    def start_coordinates(self) -> tuple[float, ...]:
        """Unit coordinates from which to start a fit; always inside the bounds."""
        if self.starts:
            return tuple(self.unit_coordinate(value) for value in self.starts)
        low, high = self.unit_bounds
        inside = tuple(u for u in (-1.0, 1.0) if low <= u <= high)
        return inside or (0.0,)


def known(name: str, sd: float, unit: str, meaning: str, *, mean: float = 0.0) -> Parameter:
    """What is known of a sensor to within `sd`, and what every prediction is a straight line in."""
    return Parameter(name, mean, sd, unit, meaning=meaning, linear=True)


def signed(name: str, reach: float, unit: str = "", meaning: str = "", *, linear: bool = False) -> Parameter:
    """A strength of either sign: prior N(0, (reach/2)²), bounded at 6·reach.

    A linear one is started from 0 alone: from anywhere else its fit would arrive at the same place.
    """
    return Parameter(
        name,
        0.0,
        reach / 2,
        unit,
        -6 * reach,
        6 * reach,
        meaning=meaning,
        starts=(0.0,) if linear else (-reach / 4, reach / 4),
        linear=linear,
    )


def positive(name: str, reach: float, unit: str = "", meaning: str = "") -> Parameter:
    """A strength that cannot be negative: half-normal prior of scale reach/2, bounded at 6·reach."""
    starts = (reach / 20, reach / 2)
    return Parameter(name, 0.0, reach / 2, unit, 0.0, 6 * reach, meaning=meaning, starts=starts)


def between(name: str, low: float, high: float, unit: str = "", meaning: str = "") -> Parameter:
    """A positive scale known to within [low, high] (about two sd of its logarithm to either side)."""
    middle = math.sqrt(low * high)
    spread = math.log(high / low) / 4
    ends = (middle * math.exp(-spread), middle * math.exp(spread))
    return Parameter(name, middle, spread, unit, low / 3, high * 3, "log", meaning, starts=ends)
