"""One search: Levenberg–Marquardt for the unknowns, restricted likelihood for the sizes."""

from __future__ import annotations

import math

import numpy as np

from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.likelihood import Sizes, log_density
from daq_app.gap.core.fitting.linear import Linear, relaxed
from daq_app.gap.core.fitting.problem import Columns, Problem
from daq_app.gap.core.model import Prediction

TOLERANCE = 1e-2
"""A change of the log posterior below this ends a search."""
_SIZE_ROUNDS = 8
_TRIALS = 8
_DAMPING = 1e-3
"""Least damping that there is: below it there is none, and a step that fails begins with it."""


class Search:
    """State of one search from one start.

    `known` are columns of the Jacobian that are taken as they are (those of linear parameters, or all of
    the fit without the effect while the search is far from its end); the others are differences.
    """

    def __init__(self, problem: Problem, u: FloatArray, sizes: Sizes, known: Columns | None = None) -> None:
        self.problem, self.u, self.sizes = problem, u, sizes
        self.known = known or {}
        self.predictions = [problem.predict(i, u) for i in range(len(problem.runs))]
        self.objective = self.value_at(u, self.predictions)
        self._damping = 0.0
        self._linear: Linear | None = None

    def value_at(self, u: FloatArray, predictions: list[Prediction]) -> float:
        """−log posterior at `u`, (p,); infinite where the model diverges."""
        total = 0.5 * float(u @ u) + self.sizes.cost(self.problem.model.scatters)
        for i, (run, prediction) in enumerate(zip(self.problem.runs, predictions, strict=True)):
            residual = run.features.values - prediction.features
            if not np.all(np.isfinite(residual)):
                return math.inf
            covariance = self.sizes.covariance(self.problem.experiment, i, prediction)
            total -= run.features.independent_fraction * log_density(residual, covariance)
        return total if math.isfinite(total) else math.inf

    @property
    def linear(self) -> Linear:
        """The linearisation at the point."""
        if self._linear is None:
            self.linearise()
        assert self._linear is not None
        return self._linear

    def linearise(self, exact: bool = False) -> None:
        """Jacobians at the point; afterwards the columns of linear parameters are known for good."""
        lines = [
            self.problem.linearise(i, self.u, prediction, self.known, exact)
            for i, prediction in enumerate(self.predictions)
        ]
        self.known = self.problem.columns_of(lines, linear_only=True) | self.known
        self._linear = Linear(self.problem, self.u, lines, self.sizes)

    def use(self, known: Columns) -> None:
        """Take these columns of the Jacobian as they are from now on."""
        self.known = known
        self._linear = None

    def step(self) -> float:
        """One accepted step; returns the gain (0 when none was found)."""
        linear = self.linear
        for _ in range(_TRIALS):
            trial = linear.solution(damping=self._damping)
            if not np.all(np.isfinite(trial)):  # the equations are singular at so little damping
                self._damping = max(self._damping * 10, _DAMPING)
                continue
            if self.objective - linear.objective_at(trial) < 0.1 * TOLERANCE:
                return 0.0
            predictions = [self.problem.predict(i, trial) for i in range(len(self.problem.runs))]
            objective = self.value_at(trial, predictions)
            if objective < self.objective:
                gain = self.objective - objective
                self.u, self.predictions, self.objective = trial, predictions, objective
                self._linear = None
                # Down to nothing: any damping left would leave a stiff direction short of its optimum.
                self._damping = 0.0 if self._damping < _DAMPING else self._damping / 10
                return gain
            self._damping = max(self._damping * 10, _DAMPING)
        return 0.0

    def walk(self, steps: int, tolerance: float = TOLERANCE) -> float:
        """Steps at the sizes as they are, until one gains less than `tolerance`; returns the gain."""
        gained = 0.0
        for _ in range(steps):
            gain = self.step()
            gained += gain
            if gain < tolerance:
                break
        return gained

    def update_sizes(self) -> float:
        """Sizes at the optimum of the linearisation; returns by how much the marginal falls."""
        linear, _ = relaxed(self.linear, _SIZE_ROUNDS)
        before = self.linear.marginal_at(self.linear.solution())
        self.sizes, self._linear = linear.sizes, linear
        self.objective = self.value_at(self.u, self.predictions)
        return before - linear.marginal_at(linear.solution())

    def run(self, rounds: int, steps: int, tolerance: float = TOLERANCE) -> bool:
        """Alternate steps and sizes; True when neither changes anything any more."""
        for _ in range(rounds):
            gained = self.walk(steps, tolerance)
            if gained + self.update_sizes() < 5 * tolerance:
                return True
        return False
