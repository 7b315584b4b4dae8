"""Do probabilities mean what they say? Reliability, calibration error, and the temperature that mends them.

A case is the log weights (prior × evidence) of its hypotheses and which of them count as right. The
temperature is set on one set of cases and must be judged on another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from daq_app.gap.core.features import FloatArray


@dataclass(frozen=True, slots=True)
class Case:
    """`log_prior`, `log_evidence`: shape (h,); `right`: shape (h,), which hypotheses are correct."""

    log_prior: FloatArray
    log_evidence: FloatArray
    right: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Bin:
    """One bar of a reliability diagram."""

    low: float
    high: float
    n: int
    claimed: float
    observed: float


def probabilities(case: Case, temperature: float) -> FloatArray:
    """Posterior of the hypotheses at a temperature, shape (h,)."""
    logs = case.log_prior + case.log_evidence / temperature
    found: FloatArray = np.exp(logs - logsumexp(logs))
    return found


def fit_temperature(cases: Sequence[Case], low: float = 0.5, high: float = 50.0) -> float:
    """The temperature with the smallest log loss of the right answer. Needs cases with a right answer."""
    usable = [case for case in cases if any(case.right)]
    if not usable:
        raise ValueError("no case has a right answer among its hypotheses")

    def loss(log_temperature: float) -> float:
        total = 0.0
        for case in usable:
            p = probabilities(case, float(np.exp(log_temperature)))
            total -= float(np.log(max(p[np.array(case.right)].sum(), 1e-12)))
        return total

    best = minimize_scalar(loss, bounds=(np.log(low), np.log(high)), method="bounded")
    return float(np.exp(best.x))


def reliability(claimed: Sequence[float], right: Sequence[bool], bins: int = 10) -> list[Bin]:
    """Reliability diagram: of the answers given with probability about p, how many were right."""
    p, y = np.asarray(claimed, dtype=float), np.asarray(right, dtype=float)
    edges = np.linspace(0.0, 1.0, bins + 1)
    place = np.clip(np.digitize(p, edges[1:-1]), 0, bins - 1)
    found = []
    for k in range(bins):
        inside = place == k
        if inside.any():
            found.append(
                Bin(
                    float(edges[k]),
                    float(edges[k + 1]),
                    int(inside.sum()),
                    float(p[inside].mean()),
                    float(y[inside].mean()),
                )
            )
    return found


def expected_calibration_error(claimed: Sequence[float], right: Sequence[bool], bins: int = 10) -> float:
    """Mean distance between claimed and observed, weighted by the number of answers in a bin."""
    table = reliability(claimed, right, bins)
    total = sum(b.n for b in table)
    return sum(b.n * abs(b.claimed - b.observed) for b in table) / total
