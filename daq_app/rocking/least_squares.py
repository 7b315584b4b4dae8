"""Small nonlinear least squares by Levenberg and Marquardt, with a known Jacobian."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Minimum:
    """Where the search ended."""

    x: Floats
    residual: Floats
    jacobian: Floats


def least_squares(
    residual: Callable[[Floats], Floats],
    jacobian: Callable[[Floats], Floats],
    start: Floats,
    *,
    damping: float = 0.0,
    tolerance: float = 1e-9,
    max_steps: int = 60,
) -> Minimum:
    """Least |residual(x)|² from `start` (n,); `residual` gives (m,), `jacobian` (m, n).

    Normal equations, damped on their own diagonal: for well-scaled problems whose Jacobian has full rank
    (priors among the residuals). `damping` to begin with: 0 goes whole steps at once, 1 feels its way. It
    ends when a step is expected to lower the sum by less than `tolerance` of it, or after `max_steps` tries.
    """
    x = np.array(start, dtype=np.float64)
    here = residual(x)
    slopes = jacobian(x)
    cost = float(here @ here)
    for _ in range(max_steps):
        gradient = slopes.T @ here
        normal = slopes.T @ slopes
        diagonal = np.diag(normal) + 1e-300
        step = np.linalg.solve(normal + np.diag((damping + 1e-13) * diagonal), -gradient)
        expected = -float(step @ gradient) - float(np.sum(step**2 * damping * diagonal))
        if not expected > tolerance * cost:
            break
        there = residual(x + step)
        new = float(there @ there)
        if new <= cost:
            x, here, cost = x + step, there, new
            slopes = jacobian(x)
            damping = damping / 10.0 if damping > 1e-6 else 0.0
        else:
            damping = max(10.0 * damping, 1e-3)
    return Minimum(x, here, slopes)
