"""The runs of one diagnosis, the model that shall predict them, and their groups of features."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from daq_app.gap.core.features import FloatArray, Run
from daq_app.gap.core.model import Model, Prediction

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Groups:
    """Features that share one size of the model's discrepancy: one group per channel and observable.

    `index[i]`: group of each feature of run i, shape (n,). `variance[i]`: nominal variance of each, shape
    (n,): measurement error, known couplings and scatter at its prior median. A discrepancy is counted in it.
    """

    names: tuple[tuple[str, str], ...]
    index: tuple[Indices, ...]
    variance: tuple[FloatArray, ...]

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, slots=True)
class Coupling:
    """The rows that loadings (n, k) couple, and L Lᵀ of these rows."""

    loadings: FloatArray | None
    rows: Indices
    product: FloatArray

    @classmethod
    def of(cls, loadings: FloatArray | None) -> Coupling:
        """None and empty loadings couple nothing."""
        if loadings is None or not loadings.shape[1]:
            return cls(loadings, np.zeros(0, dtype=np.intp), np.zeros((0, 0)))
        rows = np.flatnonzero(loadings.any(axis=1))
        return cls(loadings, rows, loadings[rows] @ loadings[rows].T)


@dataclass(frozen=True, slots=True)
class Experiment:
    """Model, runs and groups; the couplings of fixed loadings, which most models never change."""

    model: Model
    runs: tuple[Run, ...]
    groups: Groups
    couplings: tuple[Coupling, ...]

    @classmethod
    def of(cls, model: Model, runs: Sequence[Run]) -> Experiment:
        """Groups by the labels of the features, variances by the model at the centres of its priors."""
        listed = tuple(runs)
        order: dict[tuple[str, str], int] = {}
        index: list[Indices] = []
        for run in listed:
            keys = [(label.channel, label.observable) for label in run.features.labels]
            index.append(np.array([order.setdefault(key, len(order)) for key in keys], dtype=np.intp))
        nominal = [_nominal(model, run) for run in listed]
        variance = tuple(variance for variance, _ in nominal)
        groups = Groups(tuple(order), tuple(index), variance)
        return cls(model, listed, groups, tuple(Coupling.of(p.fixed_loadings) for _, p in nominal))

    @classmethod
    def without_groups(cls, model: Model, runs: Sequence[Run]) -> Experiment:
        """Enough to predict with: the model is not asked for anything, and nothing can be fitted."""
        return cls(model, tuple(runs), Groups((), (), ()), ())

    def only(self, kept: Sequence[int]) -> Experiment:
        """The same with some of the runs; the groups keep their places."""
        groups = Groups(
            self.groups.names,
            tuple(self.groups.index[i] for i in kept),
            tuple(self.groups.variance[i] for i in kept),
        )
        couplings = tuple(self.couplings[i] for i in kept)
        return Experiment(self.model, tuple(self.runs[i] for i in kept), groups, couplings)


def _nominal(model: Model, run: Run) -> tuple[FloatArray, Prediction]:
    """Nominal variance of each feature, and the prediction at the centres of the priors."""
    unknowns = (*model.nuisance, *model.local_nuisance(run))
    prediction = model.predict(run, {p.name: p.value(0.0) for p in unknowns})
    medians = {scatter.name: scatter.median for scatter in model.scatters}
    return run.features.sd**2 + random_variance(prediction, medians), prediction


def random_variance(prediction: Prediction, scatter: dict[str, float]) -> FloatArray:
    """Variance of each feature by scatter and known couplings, without measurement error; shape (n,)."""
    variance = np.zeros(prediction.features.size)
    for name, loading in prediction.loadings.items():
        square = (scatter[name] * loading) ** 2
        variance += square if square.ndim == 1 else square.sum(axis=1)
    if prediction.fixed_loadings is not None:
        variance += np.sum(prediction.fixed_loadings**2, axis=1)
    return variance
