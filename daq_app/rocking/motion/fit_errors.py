"""Covariance of the parameters of a whole-motion fit: noise, a zero that walks, a strip that is not known."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_CORRELATED_POINTS = 12
"""Residuals this many points (0.1 s) apart may still be correlated: slow noise, hum, sway of the wall."""
_LEAST_LEFT = 0.2
"""Share of slow noise that a fit is taken to leave at least: of less, residuals say too little."""


def covariances(jacobian: Floats, residuals: Floats, walk: float, by_lift: Floats) -> tuple[Floats, Floats]:
    """Covariances of the parameters where it is known how edges yield, and where it is not; (k, k) each.

    `jacobian`: the rows of the points, whose `residuals` (n,) are over their noise, and behind them those of
    the priors. `walk`: how far the zero may walk in the time of the fit, over the noise of a point. `by_lift`
    (n,): what one standard deviation of ln θ₁ makes of the points. `numpy.linalg.LinAlgError` where points
    do not tell the parameters.
    """
    points = jacobian[: residuals.size]
    answer = np.asarray(np.linalg.solve(jacobian.T @ jacobian, points.T), dtype=np.float64)
    # Rows of points are weakened by what the model leaves; priors keep their weight.
    scaled = jacobian.copy()
    scaled[: residuals.size] /= math.sqrt(max(1.0, long_run_variance(residuals, points, answer.T)))
    on_known_edges = np.linalg.inv(scaled.T @ scaled) + _of_walking_zero(answer, walk)
    return on_known_edges, on_known_edges + _of_unknown_strip(answer, by_lift)


def long_run_variance(residuals: Floats, points: Floats, answer: Floats) -> float:
    """Variance that counts for slow parameters: autocovariances under a flat top (Politis and Romano 1995).

    Up to half the lags count whole. Weights that fall from the first lag on (Bartlett's) leave out 7 % of the
    variance of noise that stays correlated for 10 ms.
    `points` (n, parameters): the rows of the Jacobian J of `residuals` (n,), without those of the priors;
    `answer`, of the same shape: what each point makes of the parameters, those rows of J (JᵀJ)⁻¹. A parameter
    takes up what is as slow as itself, so that residuals hold less of slow noise than there was:
    each sum is divided by the share of it that the fit leaves of white noise, whose covariance of residuals
    is I − J (JᵀJ)⁻¹ Jᵀ. At least the plain variance: neighbours that alternate make nothing better known.
    """
    lags = range(1, min(_CORRELATED_POINTS, residuals.size - 1) + 1)
    weights = [min(1.0, 2.0 * (1.0 - k / (_CORRELATED_POINTS + 1.0))) for k in lags]
    plain, left = float(residuals @ residuals), residuals.size - float(np.sum(answer * points))
    total = plain + 2.0 * sum(
        w * float(residuals[k:] @ residuals[:-k]) for k, w in zip(lags, weights, strict=True)
    )
    taken = 2.0 * sum(w * float(np.sum(answer[k:] * points[:-k])) for k, w in zip(lags, weights, strict=True))
    return max(plain / left, total / max(left - taken, _LEAST_LEFT * residuals.size))


def _of_walking_zero(answer: Floats, walk: float) -> Floats:
    """Covariance that a zero adds which walks from the first fitted point to the last.

    It walks by `walk`, over the noise of a point. The fit takes up a zero that stands
    still; one that walks bends late half-cycles against early ones, which p and α of small motions answer to.
    The parameters answer to the points by `answer` (parameters, points), (JᵀJ)⁻¹Jᵀ; each step of the walk
    moves all points before it. Places of sensors that are a millimetre off make a tenth to a third of that in
    p and are left out.
    """
    steps = np.cumsum(answer, axis=1) * (walk / math.sqrt(answer.shape[1]))
    return np.asarray(steps @ steps.T)


def _of_unknown_strip(answer: Floats, by_lift: Floats) -> Floats:
    """Covariance that a strip adds which lifts at another rotation than the one that is taken.

    `by_lift`: what one standard deviation of ln θ₁ makes of the points; the parameters answer by `answer`.
    """
    moved = answer @ by_lift
    return np.outer(moved, moved)
