"""How well the gain of a mean of sensors is known: from their calibration and from how they differ."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CALIBRATION_SHARE = 0.0021
"""Prior standard uncertainty of one sensor's gain, place of its ends included: root mean square of the 0.1 to
0.3 % of laboratories."""
PRIOR_WEIGHT = 7.0
"""Degrees of freedom that the prior counts for: 2 E(v)² / Var(v) of the variances v of laboratories whose
standard deviations lie anywhere between 0.1 and 0.3 %."""


def single_gain_share(
    deviations: Floats, freedom: float, prior: float = CALIBRATION_SHARE
) -> tuple[float, float]:
    """Scale of one sensor's gain error and its degrees of freedom, the prior's included.

    `deviations` (sensors,): relative, from what all say together; `freedom`: how many of them are free. The
    prior is a standard deviation: the scale of a Student's distribution of ν degrees of freedom is
    √((ν − 2)/ν) of that.
    """
    total = PRIOR_WEIGHT + freedom
    squares = (PRIOR_WEIGHT - 2.0) * prior**2 + float(deviations @ deviations)
    return math.sqrt(squares / total), total


def gain_sigma_of_mean(
    deviations: Floats, weights: Floats, freedom: float, prior: float = CALIBRATION_SHARE
) -> float:
    """Standard uncertainty of the gain of a weighted mean, a share; `weights` (sensors,) as it has them.

    `prior`: of one sensor, before its deviation is seen.

    A scale of ν degrees of freedom makes the error Student's, whose standard deviation is √(ν/(ν − 2)) of it
    (JCGM 101:2008, 6.4.9).
    """
    single, total = single_gain_share(deviations, freedom, prior)
    return single * math.sqrt(total / (total - 2.0)) * float(np.sqrt(np.sum(weights**2)))
