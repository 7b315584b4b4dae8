"""A hypothesis on a set of runs, written as a vector of unknowns in unit coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from daq_app.gap.core.effects import Effect
from daq_app.gap.core.features import FloatArray
from daq_app.gap.core.fitting.experiment import Experiment
from daq_app.gap.core.model import Prediction
from daq_app.gap.core.parameters import Parameter

STEP = 1e-4
"""Half width of central differences, in prior standard deviations."""
STEEPEST = 1e100
"""Slope of a feature, in its unit over a prior sd, beyond which a model has left what can be squared."""
Columns = dict[tuple[str, int | None], FloatArray]
"""Columns of Jacobians, shape (n,) each, by (key, run index)."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """One entry of the vector; `run` is None where all runs share it."""

    key: str
    parameter: Parameter
    run: int | None = None
    effect: str = ""


@dataclass(slots=True)
class Linearised:
    """One run at a point: residual y − f, Jacobian of f in unit coordinates (n, p), prediction."""

    residual: FloatArray
    jacobian: FloatArray
    prediction: Prediction


class Problem:
    """Maps the vector u to the model's values and linearises the prediction."""

    def __init__(self, experiment: Experiment, effects: Sequence[Effect]) -> None:
        self.experiment = experiment
        model = self.model = experiment.model
        self.runs = experiment.runs
        self.effects = tuple(effects)
        unknowns = [Unknown(p.name, p) for p in model.nuisance]
        for effect in effects:
            unknowns += [Unknown(effect.key(p), p, None, effect.name) for p in effect.shared]
        for index, run in enumerate(self.runs):
            unknowns += [Unknown(p.name, p, index) for p in model.local_nuisance(run)]
            for effect in effects:
                unknowns += [Unknown(effect.key(p), p, index, effect.name) for p in effect.per_run]
        self.unknowns = tuple(unknowns)
        bounds = np.array([u.parameter.unit_bounds for u in self.unknowns]).reshape(-1, 2)
        self.low, self.high = bounds[:, 0], bounds[:, 1]
        self._columns = [
            np.array([k for k, u in enumerate(self.unknowns) if u.run is None or u.run == i], dtype=np.intp)
            for i in range(len(self.runs))
        ]
        self._asked = [
            [(int(k), self.unknowns[k].key, self.unknowns[k].parameter.value) for k in columns]
            for columns in self._columns
        ]

    def __len__(self) -> int:
        return len(self.unknowns)

    def columns(self, run: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Indices of the unknowns that act on a run."""
        return self._columns[run]

    def values(self, run: int, u: FloatArray) -> dict[str, float]:
        """Parameters by name, in their own units, for one run; `u` (p,) are unit coordinates."""
        coordinates = u.tolist()
        return {key: value(coordinates[k]) for k, key, value in self._asked[run]}

    def columns_of(self, lines: Iterable[Linearised], linear_only: bool = False) -> Columns:
        """Columns of Jacobians for later use: all, or those of linear parameters, which never change."""
        return {
            (self.unknowns[k].key, run): line.jacobian[:, k]
            for run, line in enumerate(lines)
            for k in self._columns[run]
            if self.unknowns[k].parameter.linear or not linear_only
        }

    def predict(self, run: int, u: FloatArray) -> Prediction:
        """The model's features of one run at `u`, (p,). Whatever the model raises passes through."""
        return self.model.predict(self.runs[run], self.values(run, u))

    def linearise(
        self,
        run: int,
        u: FloatArray,
        prediction: Prediction | None = None,
        known: Columns | None = None,
        exact: bool = True,
        effect: str | None = None,
    ) -> Linearised:
        """Residual and Jacobian of one run.

        Differences are central (one-sided at a bound) where `exact`, else forward: half the work, and
        good enough to walk by. `known` are columns taken from elsewhere, shape (n,) by (key, run).
        With `effect` no columns but those of its unknowns are worked out; the others are zero.
        """
        values = self.values(run, u)
        here = prediction or self.model.predict(self.runs[run], values)
        jacobian = np.zeros((here.features.size, len(self)))
        for k, key, _ in self._asked[run]:
            if effect is not None and self.unknowns[k].effect != effect:
                continue
            column = known.get((key, run)) if known else None
            jacobian[:, k] = self._slope(run, u, values, k, here, exact) if column is None else column
        return Linearised(self.runs[run].features.values - here.features, jacobian, here)

    def _slope(
        self, run: int, u: FloatArray, values: Mapping[str, float], k: int, here: Prediction, exact: bool
    ) -> FloatArray:
        ahead, behind = min(u[k] + STEP, self.high[k]), max(u[k] - STEP, self.low[k])
        if exact:
            first, second = self._at(run, values, k, ahead), self._at(run, values, k, behind)
            slope: FloatArray = (first - second) / (ahead - behind)
        elif ahead > u[k]:
            slope = (self._at(run, values, k, ahead) - here.features) / (ahead - u[k])
        else:
            slope = (here.features - self._at(run, values, k, behind)) / (u[k] - behind)
        # Beside the place where the model diverges there is no slope to follow; value_at keeps off it.
        return np.where(np.abs(slope) < STEEPEST, slope, 0.0)

    def _at(self, run: int, values: Mapping[str, float], k: int, coordinate: float) -> FloatArray:
        """Features with one unknown moved to a coordinate."""
        unknown = self.unknowns[k]
        moved = {**values, unknown.key: unknown.parameter.value(float(coordinate))}
        return self.model.predict(self.runs[run], moved).features

    def start(self, known: Mapping[tuple[str, int | None], float]) -> FloatArray:
        """A starting vector: `known` unit coordinates by (key, run), else 0, inside the bounds."""
        u = np.array([known.get((q.key, q.run), _nothing(q)) for q in self.unknowns], dtype=float)
        return np.asarray(np.clip(u, self.low, self.high))


def _nothing(unknown: Unknown) -> float:
    """Unit coordinate of a value of 0, at which an effect is none; of what has no such value, the centre."""
    has_none = bool(unknown.effect) and unknown.parameter.scale == "linear"
    return unknown.parameter.unit_coordinate(0.0) if has_none else 0.0
